"""Messages in Protocol Buffers that we write, as Google's library reads them."""

import random
import time
from typing import Any

import pytest

from tests.unit.protocol.protobuf.messages import (
    FOXGLOVE,
    every_kind,
    expected,
    filled,
    foxglove_type,
    schema_of,
)
from urc.protocol.protobuf.schema import parse_schema
from urc.protocol.protobuf.write import ProtobufWriter
from urc.protocol.ros.write_source import Unwritable
from urc.transports.ros.robot_time import RobotTime

KINDS: dict[str, Any] = {name: foxglove_type(name) for name in FOXGLOVE}
KINDS |= {syntax: every_kind(syntax) for syntax in ("proto2", "proto3")}


def writer(kind: Any) -> ProtobufWriter:
    return ProtobufWriter(parse_schema(schema_of(kind.DESCRIPTOR)), kind.DESCRIPTOR.full_name)


@pytest.mark.parametrize("name", KINDS)
def test_messages_arrive_as_they_were(name: str) -> None:
    chance, kind = random.Random(3), KINDS[name]  # noqa: S311 - no secret
    ours = writer(kind)
    for _ in range(100):
        message = expected(filled(kind, chance, is_finite=True))
        sent = kind.FromString(ours.write(message).data)
        assert expected(sent) == message


def test_now_becomes_the_robots_time() -> None:
    kind = foxglove_type("SceneUpdate")
    entity = {"frame_id": "map", "timestamp": "now"}
    written = writer(kind).write({"entities": [entity, {"id": "x" * 300}, entity]})
    assert len(written.stamps) == 2
    clock = RobotTime()
    now_ns = time.time_ns()
    clock.told(1_800_000_000_123_456_789, now_ns)
    data = clock.stamped(written.data, written.stamps, now_ns, is_protobuf=True)
    found = kind.FromString(data).entities
    for place in (0, 2):
        assert found[place].timestamp.ToNanoseconds() == 1_800_000_000_123_456_789


@pytest.mark.parametrize(
    ("kind", "message", "text"),
    [
        (
            "PoseInFrame",
            {"pose": {"position": {"x": "a"}}},
            "pose.position.x: 'a' is not a valid d",
        ),
        ("PoseInFrame", {"pose": {"place": {}}}, "pose has no 'place'; it has: position, orient"),
        ("PoseInFrame", {"pose": 4}, "pose: 4 is not a mapping of fields"),
        ("PoseInFrame", [1], r"the message: \[1\] is not a mapping of fields"),
        ("LaserScan", {"ranges": 4}, "ranges: 4 is not a list"),
        ("LaserScan", {"ranges": [1, True]}, r"ranges\[1\]: True is not a valid double"),
        ("Log", {"level": "LOUD"}, "level: 'LOUD' is not one of: UNKNOWN, DEBUG, INFO"),
        ("Log", {"line": -1}, "line: -1 is not a valid fixed32"),
        ("Log", {"message": 4}, "message: 4 is not text"),
        ("CompressedImage", {"data": "not base64"}, "data: 'not base64' is not bytes, base64"),
    ],
)
def test_values_that_do_not_fit_are_named(kind: str, message: Any, text: str) -> None:
    with pytest.raises(Unwritable, match=text):
        writer(foxglove_type(kind)).write(message)


def test_enumerations_have_names_or_numbers() -> None:
    kind = foxglove_type("Log")
    for level in ("WARNING", 3):
        assert kind.FromString(writer(kind).write({"level": level}).data).level == 3
