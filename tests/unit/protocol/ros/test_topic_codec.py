"""The codec of a connection: definitions, calls and published messages, through the engine."""

from pathlib import Path

import jmespath
import pytest

from urc.config.load import load_profile
from urc.model.payload import Envelope, ReadSpec
from urc.protocol.engine import Engine
from urc.protocol.ros.topic_codec import MAX_COMPILED, TopicCodec
from urc.protocol.ros.wanted import ALL, paths_of, wanted_of
from urc.protocol.ros.write_source import Unwritable
from urc.runtime.registries import built_in_catalog


def definition(topic: str, text: str, encoding: str = "cdr") -> Envelope:
    said = {"topic": topic, "type": "pkg/msg/T", "encoding": encoding, "notation": "ros2msg"}
    return Envelope("definition", said, text)


def message(topic: str, data: bytes, encoding: str = "cdr") -> Envelope:
    return Envelope("message", {"topic": topic, "encoding": encoding}, data)


def test_a_message_is_read_after_its_definition() -> None:
    codec = TopicCodec({"/a": [("x",)]})
    early = codec.received(message("/a", b"\0\1\0\0\5\0"))
    assert early.fault == "/a: a message arrived without the definition of its type"
    assert codec.received(definition("/a", "int8 y\nint8 x")) == (None, None, "")
    found = codec.received(message("/a", b"\0\1\0\0\5\7")).envelope
    assert found is not None
    assert found.body == {"x": 7}


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"\0\2\0\0\5", "/a: the message begins with 00 02 00 00, which is not CDR"),
        (b"", "/a: the message begins with , which is not CDR"),
        (b"\0\1\0\0", "/a: the message does not match its definition ("),
    ],
)
def test_a_bad_message_is_a_fault_with_its_topic(data: bytes, text: str) -> None:
    codec = TopicCodec()
    codec.received(definition("/a", "int8 x"))
    assert codec.received(message("/a", data)).fault.startswith(text)


def test_the_number_of_compiled_types_is_limited() -> None:
    codec = TopicCodec()
    faults = [
        codec.received(definition("/a", f"int8 f{number}")).fault
        for number in range(MAX_COMPILED + 1)
    ]
    assert not any(faults[:-1])
    assert faults[-1] == f"/a: the robot has announced more than {MAX_COMPILED} types"
    codec.reset()
    assert not codec.received(definition("/a", "int8 again")).fault


def test_a_published_message_has_its_bytes_and_its_plain_body() -> None:
    codec = TopicCodec()
    said = {"topic": "/go", "type": "std_msgs/Int8"}
    sent = codec.sent(Envelope("publish", said, {"data": 5}))
    assert sent == Envelope(
        "publish", {**said, "encoding": "cdr", "data": b"\0\1\0\0\5", "stamps": []}, {"data": 5}
    )
    strange = Envelope("publish", {"topic": "/go", "type": "my_msgs/Own"}, {"data": 5})
    assert codec.sent(strange) is strange
    with pytest.raises(Unwritable, match="data: 500 is not a whole number of 8 bits"):
        codec.sent(Envelope("publish", said, {"data": 500}))


def test_a_call_comes_back_with_its_types_and_leaves_in_bytes() -> None:
    codec = TopicCodec()
    call = Envelope("call", {"service": "/lamp", "id": 3}, {"data": True})
    assert codec.sent(call) is call
    types = {
        "request": ["std_srvs/srv/SetBool_Request", "cdr", "ros2msg", "bool data"],
        "response": ["std_srvs/srv/SetBool_Response", "cdr", "ros2msg", "bool success"],
    }
    found = codec.received(Envelope("unencoded", {**call.attributes, **types}, call.body))
    assert found.reply is not None
    assert found.reply.attributes["data"] == b"\0\1\0\0\1"
    assert codec.sent(call) == found.reply
    said = {"id": 3, "ok": True, "service": "/lamp", "encoding": "cdr"}
    answer = codec.received(Envelope("response", said, b"\0\1\0\0\1")).envelope
    assert answer is not None
    assert answer.body == {"success": True}
    wrong = Envelope("unencoded", {**call.attributes, **types}, {"date": True})
    refused = codec.received(wrong).envelope
    assert refused is not None
    assert refused.attributes["reason"] == "the message has no 'date'; it has: data"


ROBOT = """
urc: 1
kind: robot
name: robot
transports:
  ros: { type: ros, via: foxglove, host: 127.0.0.1 }
signals: { x: {} }
messages:
  odom: { subscribe: { topic: /odom, type: pkg/T }, json: { x: data.x } }
commands:
  go:
    args: { v: { min: -1, max: 1, default: 0 } }
    send: { publish: { topic: /go, type: std_msgs/Float32, json: { data: "{{ v }}" } } }
    hold: { repeat: 100ms, release: { v: 0 }, watchdog: none }
"""


def test_an_engine_reads_the_bound_fields_and_renders_the_stop(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(ROBOT, "utf-8")
    engine = Engine(load_profile(file, built_in_catalog()).driver, {})
    stop = engine.motions.stop_frame("go")
    assert isinstance(stop, Envelope)
    assert stop.attributes["data"] == bytes.fromhex("00010000 00000000")
    text = "string name\nInner data\n" + "=" * 80 + "\nMSG: pkg/Inner\nfloat32 x\nfloat32[4] rest"
    engine.start("ros", 0.0)
    engine.receive("ros", definition("/odom", text), 0.0)
    data = bytes.fromhex("00010000 02000000 61000000 0000c03f") + bytes(16)
    events = engine.receive("ros", message("/odom", data), 0.0)
    assert [sample.value for one in events for sample in getattr(one, "samples", ())] == [1.5]


@pytest.mark.parametrize(
    ("expression", "paths"),
    [
        ("a.b.c", {("a", "b", "c")}),
        ("transforms[?child=='x'] | [0].t", {("transforms",)}),
        ("[a.x, b.y]", {("a", "x"), ("b", "y")}),
        ("length(ranges)", {("ranges",)}),
        ("a.{x: b, y: c}", {("a", "b"), ("a", "c")}),
        ("@", {()}),
    ],
)
def test_an_expression_wants_what_it_reads(expression: str, paths: set[tuple[str, ...]]) -> None:
    read = ReadSpec("json", {"paths": {"x": jmespath.compile(expression)}})
    assert set(paths_of(read)) == paths


def test_wanted_parts_contain_their_longer_paths() -> None:
    assert wanted_of([("a", "b"), ("a",), ("c", "*", "d")]) == {"a": True, "c": {"*": {"d": True}}}
    assert wanted_of([("a",), ("a", "b")]) == {"a": True}
    assert wanted_of([("a",), ()]) is ALL


OWN = Envelope("publish", {"topic": "/go", "type": "pkg/T"}, {"x": 5})


def sent(codec: TopicCodec) -> tuple[object, object]:
    """Return the bytes of a message, and the definition from an earlier connection."""
    envelope = codec.sent(OWN)
    assert isinstance(envelope, Envelope)
    return envelope.attributes.get("data"), envelope.attributes.get("definition")


def test_a_type_of_the_robot_is_written_on_the_next_connection_before_it_is_defined_again() -> None:
    """A stop is sent first there; the transport compares the definition with the robot's."""
    codec = TopicCodec()
    assert sent(codec) == (None, None)
    codec.received(definition("/a", "int8 x"))
    for _ in range(3):
        assert sent(codec) == (b"\0\1\0\0\5", None)
        codec.reset()
        assert sent(codec) == (b"\0\1\0\0\5", "int8 x")
        codec.reset()
        codec.received(definition("/a", "int8 x"))
    codec.reset()
    codec.received(definition("/a", "int8 y\nint8 x"))
    assert sent(codec) == (b"\0\1\0\0\0\5", None), "the robot has another version now"


def test_kept_definitions_are_bounded() -> None:
    codec = TopicCodec()
    for connection in range(4):
        for number in range(MAX_COMPILED // 2):
            said = {"topic": "/a", "encoding": "cdr", "notation": "ros2msg"}
            kind = f"pkg{connection}/msg/T{number}"
            codec.received(Envelope("definition", {**said, "type": kind}, "int8 x"))
        codec.reset()
    kinds = [(connection, 0) for connection in range(4)]
    known = [
        codec.sent(OWN._replace(attributes={"topic": "/go", "type": f"pkg{first}/T{second}"}))
        for first, second in kinds
    ]
    assert ["data" in one.attributes for one in known] == [False, False, True, True]  # type: ignore[union-attr] # all are envelopes
