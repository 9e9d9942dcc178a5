"""Messages in Protocol Buffers: our reader against Google's library, and hostile input."""

import base64
import random
import time
import tracemalloc
from typing import Any

import pytest
from google.protobuf import descriptor_pb2, struct_pb2

from tests.unit.protocol.protobuf.messages import (
    FOXGLOVE,
    every_kind,
    expected,
    filled,
    foxglove_type,
    schema_of,
)
from urc.model.payload import Envelope
from urc.protocol.protobuf.read import MAX_VALUES, ProtobufReader
from urc.protocol.protobuf.schema import MAX_FIELDS, MAX_TYPES, parse_schema
from urc.protocol.ros.definition import MAX_TEXT, BadDefinition
from urc.protocol.ros.read_source import MAX_NUMBERS, BadRosMessage
from urc.protocol.ros.topic_codec import MAX_PREPARED, TopicCodec
from urc.protocol.ros.wanted import EACH, wanted_of

KINDS: dict[str, Any] = {name: foxglove_type(name) for name in FOXGLOVE}
KINDS |= {syntax: every_kind(syntax) for syntax in ("proto2", "proto3")}


def reader(kind: Any, wanted: Any = True) -> ProtobufReader:
    """Return our reader for a message class of Google's library."""
    return ProtobufReader(
        parse_schema(schema_of(kind.DESCRIPTOR)), kind.DESCRIPTOR.full_name, wanted
    )


def field(owner: Any, name: str, number: int, kind: int = 11, label: int = 1, of: str = "") -> None:
    owner.field.add(name=name, number=number, type=kind, label=label, type_name=of or None)


def text_of(*files: descriptor_pb2.FileDescriptorProto) -> str:
    made = descriptor_pb2.FileDescriptorSet(file=files)
    return base64.b64encode(made.SerializeToString()).decode()


@pytest.mark.parametrize("name", KINDS)
def test_random_messages_are_read_as_by_googles_library(name: str) -> None:
    chance, kind = random.Random(7), KINDS[name]  # noqa: S311 - no secret
    ours = reader(kind)
    for _ in range(100):
        message = filled(kind, chance)
        assert ours.read(message.SerializeToString()) == expected(message)


@pytest.mark.parametrize("name", KINDS)
def test_changed_bytes_are_read_or_refused_but_never_crash(name: str) -> None:
    chance, kind = random.Random(11), KINDS[name]  # noqa: S311 - no secret
    ours, refused = reader(kind), 0
    for _ in range(200):
        data = bytearray(filled(kind, chance).SerializeToString() or b"\0")
        for _ in range(3):
            data[chance.randrange(len(data))] = chance.randrange(256)
        try:
            ours.read(bytes(data[: chance.randint(1, len(data))]))
        except BadRosMessage:
            refused += 1
    assert refused


def test_only_the_wanted_fields_are_read() -> None:
    pose = foxglove_type("PoseInFrame")(frame_id="map")
    pose.pose.position.x = 1.5
    pose.timestamp.seconds = 8
    wanted = wanted_of([("pose", "position", "x"), ("timestamp", "sec")])
    found = reader(type(pose), wanted).read(pose.SerializeToString())
    assert found == {"pose": {"position": {"x": 1.5}}, "timestamp": {"sec": 8}}
    transforms = foxglove_type("FrameTransforms")()
    for name in ("base", "arm"):
        transforms.transforms.add(child_frame_id=name, parent_frame_id="map")
    each = reader(type(transforms), wanted_of([("transforms", EACH, "child_frame_id")]))
    found = each.read(transforms.SerializeToString())
    assert found == {"transforms": [{"child_frame_id": "base"}, {"child_frame_id": "arm"}]}


def test_a_message_in_two_parts_is_merged_and_the_last_of_a_oneof_counts() -> None:
    kind = every_kind("proto3")
    first, second = kind(any_int32=4), kind(any_string="x")
    first.one_message.x = 2
    second.one_message.deeper.one_bool = True
    data = first.SerializeToString() + second.SerializeToString()
    assert reader(kind).read(data) == expected(kind.FromString(data))


def test_a_type_that_contains_itself_is_read_to_a_hundred_levels() -> None:
    value: Any = 1.0
    for _ in range(30):  # three messages for each list
        value = [value]
    message = struct_pb2.ListValue()
    message.extend(value)
    ours = reader(struct_pb2.ListValue)
    assert ours.read(message.SerializeToString()) == expected(message)
    deep = b""
    for _ in range(200):
        deep = (
            b"\x0a"
            + _size(len(deep) + 1 + len(_size(len(deep))))
            + b"\x32"
            + _size(len(deep))
            + deep
        )
    with pytest.raises(BadRosMessage, match="nested more than 100 levels"):
        ours.read(deep)


def _size(value: int) -> bytes:
    return bytes([value]) if value < 128 else bytes([value & 127 | 128, value >> 7])


def test_small_messages_cannot_fill_the_memory() -> None:
    """A message of 200 kB needs 780 MB in Google's library."""
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p", syntax="proto3")
    outer, inner = file.message_type.add(name="A"), file.message_type.add(name="B")
    field(outer, "b", 1, label=3, of=".p.B")
    for number in range(1, 1001):
        field(inner, f"f{number}", number, kind=1)
    ours = ProtobufReader(parse_schema(text_of(file)), "p.A")
    tracemalloc.start()
    with pytest.raises(BadRosMessage, match=f"more than {MAX_VALUES} values"):
        ours.read(b"\x0a\0" * 100_000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100_000_000


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"\x2a" + _size(9000) + b"\0" * 80, "a field is longer than its message"),
        (b"\x31\0\0", "a field is longer than its message|does not match"),
        (b"\x80" * 11 + b"\1", "more than ten bytes"),
        (b"\x07", "unknown kind 7"),
        (b"\x32\x05\0\0\0\0\0", "a list of numbers has 5 bytes, not 8 each"),
    ],
)
def test_lengths_that_lie_are_refused(data: bytes, text: str) -> None:
    with pytest.raises(BadRosMessage, match=text):
        reader(foxglove_type("LaserScan")).read(data)


def test_the_numbers_of_a_message_are_limited() -> None:
    count = MAX_NUMBERS + 1
    size = count
    length = bytearray()
    while size > 127:
        length.append(size & 127 | 128)
        size >>= 7
    length.append(size)
    kind = every_kind("proto3")
    number = kind.DESCRIPTOR.fields_by_name["each_uint32"].number
    tag = bytes([number << 3 & 127 | 2 | 128, number >> 4])
    with pytest.raises(BadRosMessage, match=f"more than {MAX_NUMBERS} numbers"):
        reader(kind).read(tag + bytes(length) + bytes(count))


# ---- schemas


def _wide(fields: int, types: int = 1) -> str:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p")
    for place in range(types):
        one = file.message_type.add(name=f"A{place}")
        for number in range(1, fields + 1):
            field(one, "x", number, kind=1)
    return text_of(file)


def _deep() -> str:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p")
    one = file.message_type.add(name="A0")
    for _ in range(40):
        one = one.nested_type.add(name="A0")
    return text_of(file)


def _chain(length: int) -> str:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p")
    for place in range(length):
        field(file.message_type.add(name=f"A{place}"), "x", 1, of=f".p.A{place + 1}")
    file.message_type.add(name=f"A{length}")
    return text_of(file)


def _missing() -> str:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p")
    file.dependency.append("other.proto")
    field(file.message_type.add(name="A0"), "x", 1, of=".other.B")
    return text_of(file)


def _group() -> str:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p")
    field(file.message_type.add(name="A0"), "g", 1, kind=10, of=".p.A0")
    return text_of(file)


@pytest.mark.parametrize(
    ("schema", "text"),
    [
        ("A" * (10 * 1024 * 1024), f"more than {MAX_TEXT} characters"),
        ("not base64!", "not a FileDescriptorSet"),
        ("/////w==", "not a FileDescriptorSet"),
        (base64.b64encode(b"\x0a\xff\xff\xff\xff\x0f").decode(), "longer than its message"),
        ("", "the definition does not contain the type 'p.A0'"),
        (_missing(), "the definition does not contain the type 'other.B'"),
        (_wide(MAX_FIELDS + 1), f"more than {MAX_FIELDS} fields"),
        (_wide(0, MAX_TYPES + 1), f"more than {MAX_TYPES} types"),
        (_deep(), "levels deep"),
        (_chain(1500), "nested too deeply"),
        (_group(), "p.A0 has the group g: not supported"),
    ],
)
def test_hostile_schemas_are_refused_in_one_line(schema: str, text: str) -> None:
    began_s = time.process_time()
    with pytest.raises(BadDefinition, match=text) as raised:
        ProtobufReader(parse_schema(schema), "p.A0")
    assert len(str(raised.value)) < 200
    assert time.process_time() - began_s < 2


def test_a_cyclic_schema_is_read() -> None:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p", syntax="proto3")
    one, two = file.message_type.add(name="A0"), file.message_type.add(name="B")
    field(one, "b", 1, of=".p.B")
    field(two, "a", 1, of=".p.A0")
    ours = ProtobufReader(parse_schema(text_of(file)), "p.A0")
    assert ours.read(b"\x0a\x02\x0a\x00") == {"b": {"a": {"b": None}}}


def test_defaults_of_proto2_and_presence_of_editions() -> None:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p", syntax="proto2")
    one = file.message_type.add(name="A0")
    for number, (kind, text) in enumerate(
        [(5, "-7"), (1, "inf"), (8, "true"), (9, "hi"), (12, r"\001a"), (2, "2.5")], 1
    ):
        field(one, f"f{number}", number, kind=kind)
        one.field[-1].default_value = text
    found = ProtobufReader(parse_schema(text_of(file)), "p.A0").read(b"")
    assert found == {"f1": -7, "f2": None, "f3": True, "f4": "hi", "f5": b"\1a", "f6": 2.5}
    for presence, value in ((1, None), (2, 0)):
        new = descriptor_pb2.FileDescriptorProto(
            name="a.proto", package="p", syntax="editions", edition=1000
        )
        new.options.features.field_presence = presence
        field(new.message_type.add(name="A0"), "x", 1, kind=5)
        assert ProtobufReader(parse_schema(text_of(new)), "p.A0").read(b"") == {"x": value}


def test_types_that_share_a_large_one_cannot_fill_the_memory_of_a_codec() -> None:
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="p", syntax="proto3")
    large = file.message_type.add(name="Large")
    for number in range(1, 5001):
        field(large, "x", number, kind=5)
    for place in range(60):
        field(file.message_type.add(name=f"A{place}"), "large", 1, of=".p.Large")
    codec, text = TopicCodec(), text_of(file)
    faults = []
    for place in range(60):
        said = {"topic": "/a", "type": f"p.A{place}", "encoding": "protobuf"}
        faults.append(
            codec.received(Envelope("definition", {**said, "notation": "protobuf"}, text)).fault
        )
    assert faults[0] == ""
    assert faults[-1] == f"/a: the robot's types have more than {MAX_PREPARED} fields"
