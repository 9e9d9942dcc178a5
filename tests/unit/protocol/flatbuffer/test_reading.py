"""Messages in FlatBuffers: our reader against flatc and Foxglove's classes, and hostile input.

`kinds.bfbs`, `one.bin` and `none.bin` are the output of flatc 25.12.19 for `kinds.fbs`, `one.json`
and an empty object.
"""

import random
import struct
import time
from pathlib import Path
from typing import Any

import flatbuffers
import pytest
from foxglove_schemas_flatbuffer import LaserScan

from tests.unit.protocol.flatbuffer import messages
from urc.model.payload import Envelope
from urc.protocol.flatbuffer.read import MAX_VALUES, FlatbufferReader
from urc.protocol.flatbuffer.schema import parse_schema
from urc.protocol.ros.definition import MAX_TEXT, BadDefinition
from urc.protocol.ros.read_source import BadRosMessage
from urc.protocol.ros.topic_codec import TopicCodec
from urc.protocol.ros.wanted import wanted_of

HERE = Path(__file__).parent
KINDS = (HERE / "kinds.bfbs").read_bytes()
ONE = {
    "a": False, "b": -3, "c": 200, "d": -300, "e": 60000, "f": -70000, "g": 4000000000,
    "h": -5000000000, "i": 2**64 - 1, "j": None, "k": -2.5, "l": -1, "m": 0, "n": "µ☃",
    "o": b"\1\xff", "p": [-1, 2], "q": [0.5, None], "r": [True, False], "s": ["a", ""],
    "t": [{"x": 1, "y": 2}, {"x": 3, "y": 4}],
    "u": [{
        "name": "leaf", "value": 5,
        "parent": {
            "leaves": [{"name": "deep", "value": -7, "parent": None}], "where": {"x": 7, "y": 8}
        },
    }],
    "v": {
        "corner": {"x": 1, "y": 2}, "sizes": [1, 2, 3], "mode": 1,
        "ends": [{"x": 5, "y": 6}, {"x": 7, "y": 8}],
    },
    "w_type": 1, "w": {"name": "chosen", "value": -7, "parent": None},
    "x_type": [3, 4, 2], "x": [{"x": 1, "y": 2}, "hello", {"leaves": [], "where": None}],
    "y": [1, -1], "z": None,
}  # fmt: skip
NONE = {
    **dict.fromkeys("bdefghi", 0), **{name: [] for name in "pqrstuxy"}, "a": True, "c": 9, "j": 1.5,
    "k": 0.0, "l": 1, "m": None, "n": "", "o": b"", "v": None, "w": None, "w_type": 0,
    "x_type": b"", "z": None,
}  # fmt: skip


def reader(name: str, wanted: Any = True) -> FlatbufferReader:
    schema = KINDS if name == "Kinds" else messages.binary_schema(name)
    full = "pkg.sub.Kinds" if name == "Kinds" else f"foxglove.{name}"
    return FlatbufferReader(parse_schema(messages.text_of(schema)), full, wanted)


def test_every_kind_of_value_is_read_as_flatc_wrote_it() -> None:
    assert reader("Kinds").read((HERE / "one.bin").read_bytes()) == ONE
    found = reader("Kinds").read((HERE / "none.bin").read_bytes())
    assert {**found, "x_type": bytes(found["x_type"])} == NONE


def test_random_scans_are_read_as_by_foxgloves_class() -> None:
    chance = random.Random(5)  # noqa: S311 - no secret
    ours = reader("LaserScan")
    for _ in range(100):
        values = [chance.uniform(0, 9) for _ in range(chance.randrange(40))]
        data = messages.scan(chance.random(), chance.random(), values)
        theirs = LaserScan.LaserScan.GetRootAs(data)
        found = ours.read(data)
        assert found["start_angle"] == theirs.StartAngle()
        assert found["ranges"] == [theirs.Ranges(at) for at in range(theirs.RangesLength())]
        assert found["intensities"] == []
        assert found["timestamp"] is None


def test_only_the_wanted_fields_are_read() -> None:
    data = messages.pose_in_frame((1.5, 2, 0), (0, 0, 0, 1), "map", 8, 9)
    wanted = wanted_of([("pose", "position", "x"), ("timestamp", "nanosec")])
    found = reader("PoseInFrame", wanted).read(data)
    assert found == {"pose": {"position": {"x": 1.5}}, "timestamp": {"nanosec": 9}}


@pytest.mark.parametrize("name", ["Kinds", "LaserScan", "SceneUpdate"])
def test_changed_bytes_are_read_or_refused_but_never_crash(name: str) -> None:
    chance = random.Random(11)  # noqa: S311 - no secret
    sample = (HERE / "one.bin").read_bytes()
    ours, refused = reader(name), 0
    for _ in range(500):
        data = bytearray(sample)
        for _ in range(4):
            data[chance.randrange(len(data))] = chance.randrange(256)
        try:
            ours.read(bytes(data[: chance.randint(1, len(data))]))
        except BadRosMessage:
            refused += 1
    assert refused


def test_shared_tables_cannot_fill_the_memory() -> None:
    """A message of 2 kB whose 30 levels each lead to the next one eight times."""
    builder = flatbuffers.Builder()
    table = None
    for _ in range(30):
        listed = None
        if table is not None:
            builder.StartVector(4, 8, 4)
            for _ in range(8):
                builder.PrependUOffsetTRelative(table)
            listed = builder.EndVector()
        builder.StartObject(2)  # pkg.sub.Node
        if listed is not None:
            builder.PrependUOffsetTRelativeSlot(0, listed, 0)
        node = builder.EndObject()
        builder.StartObject(3)  # pkg.sub.Leaf
        builder.PrependUOffsetTRelativeSlot(1 + 1, node, 0)
        table = builder.EndObject()
    builder.Finish(table)
    types = parse_schema(messages.text_of(KINDS))
    began_s = time.process_time()
    with pytest.raises(BadRosMessage, match=f"more than {MAX_VALUES} values"):
        FlatbufferReader(types, "pkg.sub.Leaf").read(bytes(builder.Output()))
    assert time.process_time() - began_s < 20


def test_shared_text_cannot_fill_the_memory() -> None:
    builder = flatbuffers.Builder()
    text = builder.CreateString("x" * 100_000)
    builder.StartVector(4, 10_000, 4)
    for _ in range(10_000):
        builder.PrependUOffsetTRelative(text)
    listed = builder.EndVector()
    builder.StartObject(30)
    slot = next(one.offset for one in reader("Kinds")._types.objects[1].fields if one.name == "s")
    builder.PrependUOffsetTRelativeSlot((slot - 4) // 2, listed, 0)
    builder.Finish(builder.EndObject())
    with pytest.raises(BadRosMessage, match="longer than 4 times the message"):
        reader("Kinds").read(bytes(builder.Output()))


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "does not match its definition"),
        (b"\xff\xff\xff\x7f" + bytes(20), "leads out of the message"),
        (struct.pack("<Ii", 4, 400) + bytes(20), "table of offsets lies outside"),
        (struct.pack("<Ii", 4, -2000) + bytes(20), "table of offsets lies outside"),
    ],
)
def test_offsets_that_lie_are_refused(data: bytes, text: str) -> None:
    with pytest.raises(BadRosMessage, match=text):
        reader("Kinds").read(data)


@pytest.mark.parametrize(
    ("schema", "text"),
    [
        ("A" * (10 * 1024 * 1024), f"more than {MAX_TEXT} characters"),
        ("not base64!", "not a binary schema"),
        ("", "it lacks the mark BFBS"),
        (messages.text_of(b"\xff\xff\xff\xffBFBS" + bytes(8)), "leads out of the message"),
        (messages.text_of(KINDS[:400]), "not a binary schema"),
    ],
)
def test_hostile_schemas_are_refused_in_one_line(schema: str, text: str) -> None:
    with pytest.raises(BadDefinition, match=text) as raised:
        FlatbufferReader(parse_schema(schema), "pkg.sub.Kinds")
    assert len(str(raised.value)) < 200


def test_changed_schemas_are_read_or_refused_in_bounded_time() -> None:
    chance = random.Random(3)  # noqa: S311 - no secret
    sample = (HERE / "one.bin").read_bytes()
    refused, began_s = 0, time.process_time()
    for _ in range(300):
        data = bytearray(KINDS)
        for _ in range(3):
            data[chance.randrange(8, len(data))] = chance.randrange(256)
        try:
            FlatbufferReader(parse_schema(messages.text_of(bytes(data))), "x").read(sample)
        except (BadDefinition, BadRosMessage):
            refused += 1
    assert refused
    assert time.process_time() - began_s < 20


def test_a_codec_reads_flatbuffers_after_their_definition() -> None:
    codec = TopicCodec({"/log": [("message",), ("level",)]})
    said = {"topic": "/log", "type": "foxglove.Log"}
    kind = {**said, "encoding": "flatbuffer", "notation": "flatbuffer"}
    definition = Envelope("definition", kind, messages.text_of(messages.binary_schema("Log")))
    assert not codec.received(definition).fault
    data = messages.log(4, "arm", "hot")
    found = codec.received(Envelope("message", {**said, "encoding": "flatbuffer"}, data)).envelope
    assert found is not None
    assert found.body == {"message": "hot", "level": 4}
