"""What a recording says of each thing that happens, and what is made of it again."""

import json
from collections.abc import Mapping
from typing import Any

import jsonschema
import pytest

from tests.unit.test_video import baseline_sps
from urc.model.driver import Argument, Command, Driver, FramingSpec, Hold, TransportSpec
from urc.model.values import Reading, Sample, Signal
from urc.protocol.values.occupancy_grid import Grid, encode_grid
from urc.protocol.values.point_cloud import Cloud, encode_cloud
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.hub import (
    AuditRecord,
    LinkState,
    LinkStatus,
    LogEntry,
    MotionRecord,
    Tapped,
    Traffic,
)
from urc.runtime.recording.events import event_of
from urc.runtime.recording.shapes import DRIVING, LOG, RecordingEncoder, channels
from urc.testing.profile import text
from urc.video import VideoUnit, encode_unit

BORN_NS = 1_700_000_000_000_000_000
FLOOR = encode_grid(Grid(2, 1, 0.05, -1.0, 2.0, 0.5, "map", b"\x00\xff"))
CLOUDS = [
    encode_cloud(Cloud("lidar", colour, 2, bytes(range(2 * size))))
    for colour, size in (("intensity", 16), ("rgb", 16), ("", 12))
]
PNG = b"\x89PNG\r\n\x1a\n rest"
UNIT = VideoUnit("avc1.42001E", True, 64, 48, 1.5, baseline_sps(64, 48) + b"\0\0\1\x65\x88")
SIGNALS = {
    one.name: one
    for one in (
        Signal("battery", "integer", unit="%"),
        Signal("word", "string"),
        Signal("ranges", "array"),
        Signal("pose", "object"),
        Signal("camera", "image"),
        Signal("floor", "occupancy_grid"),
        Signal("cloud", "point_cloud"),
        Signal("dump", "blob"),
        Signal("film", "video"),
        Signal("isOn", "boolean"),
    )
}
DRIVER = Driver(
    {
        "wire": TransportSpec("wire", "tcp"),
        "udp": TransportSpec("udp", "udp", framing=FramingSpec("datagram")),
    },
    SIGNALS,
    commands={
        "drive": Command(
            "drive",
            "wire",
            text("M {{ speed }}"),
            arguments={"speed": Argument("speed", "number")},
            hold=Hold(0.05, release={"speed": 0}),
        )
    },
)

# As published by their authors (github.com/foxglove/foxglove-sdk, schemas/jsonschema, MIT), without
# the descriptions.
TIME = {
    "type": "object",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999},
    },
}
FOXGLOVE: Mapping[str, Any] = {
    "foxglove.CompressedImage": {
        "type": "object",
        "properties": {
            "timestamp": TIME,
            "frame_id": {"type": "string"},
            "data": {"type": "string", "contentEncoding": "base64"},
            "format": {"type": "string"},
        },
        "required": ["timestamp", "frame_id", "data", "format"],
    },
    "foxglove.CompressedVideo": {
        "type": "object",
        "properties": {
            "timestamp": TIME,
            "frame_id": {"type": "string"},
            "data": {"type": "string", "contentEncoding": "base64"},
            "format": {"type": "string"},
        },
        "required": ["timestamp", "frame_id", "data", "format"],
    },
    "foxglove.Log": {
        "type": "object",
        "properties": {
            "timestamp": TIME,
            "level": {"oneOf": [{"const": number} for number in range(6)]},
            "message": {"type": "string"},
            "name": {"type": "string"},
            "file": {"type": "string"},
            "line": {"type": "integer", "minimum": 0},
        },
        "required": ["timestamp", "level", "message", "name", "file", "line"],
    },
}


def shapes() -> RecordingEncoder:
    return RecordingEncoder(DRIVER, lambda time_s: BORN_NS + round(time_s * 1e9))


def told(event: Tapped) -> tuple[str, int, bytes]:
    (message,) = shapes().messages(event)
    return message


EVENTS: Mapping[str, Tapped] = {
    "whole number": Sample("battery", 42, 1.5, "low"),
    "nothing": Sample("battery", None, 1.5),
    "text": Sample("word", "naïve <b> \u202e", 1.5),
    "truth": Sample("isOn", True, 1.5),
    "list": Sample("ranges", (1.0, None, 2.5), 1.5),
    "mapping": Sample("pose", {"x": 1, "at": (1, 2), "in": {"y": None}}, 1.5),
    "image": Sample("camera", PNG, 1.5),
    "map": Sample("floor", FLOOR, 1.5),
    "points": Sample("cloud", CLOUDS[0], 1.5),
    "coloured points": Sample("cloud", CLOUDS[1], 1.5),
    "plain points": Sample("cloud", CLOUDS[2], 1.5),
    "bytes": Sample("dump", b"\x00\xff", 1.5),
    "video": Sample("film", encode_unit(UNIT), 1.5),
    "line": LinkStatus(
        "wire", "silent", "tcp 127.0.0.1:6789", 1.5, "no answer", 2, 3, is_ready=True
    ),
    "note": LogEntry(1.5, "warning", "wire", "it hung up"),
    "text on the wire": Traffic(1.5, "wire", "received", b"42\n"),
    "bytes on the wire": Traffic(1.5, "udp", "sent", b"\xff\x00\x81"),
}


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS)
def test_what_happened_is_made_of_it_again(event: Tapped) -> None:
    topic, time_ns, data = told(event)
    assert time_ns == BORN_NS + 1_500_000_000
    assert event_of(topic, data, 1.5, SIGNALS) == event


@pytest.mark.parametrize(("state", "is_ready"), [("live", True), ("connecting", False)])
def test_an_older_recording_says_by_its_state_whether_a_link_is_ready(
    state: LinkState, is_ready: bool
) -> None:
    """Recordings made before this field existed have no `ready`."""
    data = json.dumps({"state": state, "address": "tcp x:1"}).encode()
    link = event_of("/link/wire", data, 1.5, SIGNALS)
    assert isinstance(link, LinkStatus)
    assert link.is_ready == is_ready


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS)
def test_every_message_fits_the_schema_that_the_file_says(event: Tapped) -> None:
    topic, _, data = told(event)
    known = {channel.topic: channel for channel in channels(DRIVER)}[topic]
    message = json.loads(data)
    if b"null" not in data:  # "not available" stands in place of any value
        jsonschema.validate(message, dict(known.schema))
    if known.shape in FOXGLOVE:
        jsonschema.validate(message, FOXGLOVE[known.shape])


def test_images_and_the_log_have_the_names_that_programs_know() -> None:
    names = {channel.topic: channel.shape for channel in channels(DRIVER)}
    assert names["/signals/camera"] == "foxglove.CompressedImage"
    assert names["/signals/floor"] == "foxglove.CompressedImage"
    assert names["/signals/film"] == "foxglove.CompressedVideo"
    assert json.loads(told(EVENTS["map"])[2])["format"] == "png"
    assert names["/signals/cloud"] == "foxglove.PointCloud"
    assert names[LOG] == "foxglove.Log"
    assert json.loads(told(EVENTS["image"])[2])["format"] == "png"


def test_who_drove_is_a_line_of_the_log_again() -> None:
    entry = AuditEntry(
        1_700_000_001.0, "bot", "moved", "screen 1", command="drive", outcome="begins"
    )
    topic, time_ns, data = told(AuditRecord(1.0, entry))
    assert (topic, time_ns) == (DRIVING, BORN_NS + 1_000_000_000)
    assert json.loads(data)["command"] == "drive"
    assert event_of(topic, data, 2.0, {}) == LogEntry(
        2.0, "info", "driving", "screen 1 moved drive begins"
    )


def test_motion_is_told_by_its_arguments_and_ends_with_what_stops_it() -> None:
    """So that a plot of them shows what the robot was told, and when that was over."""
    made = shapes()
    ticks = [made.messages(MotionRecord(1.0 + at, "drive", {"speed": at})) for at in (0, 0.5)]
    told = [(topic, json.loads(data)) for ((topic, _, data),) in ticks]
    assert told == [("/commands/drive", {"speed": 0}), ("/commands/drive", {"speed": 0.5})]
    ended = made.messages(AuditRecord(2.0, AuditEntry(0.0, "bot", "stopped", command="drive")))
    assert [(topic, json.loads(data).get("speed")) for topic, _, data in ended] == [
        (DRIVING, None),
        ("/commands/drive", 0),
    ]
    known = {channel.topic: channel.schema for channel in channels(DRIVER)}
    assert known["/commands/drive"]["properties"] == {"speed": {"type": "number"}}


def test_times_never_go_back() -> None:
    """A reading has the time of its first byte, which is told after its last one."""
    made = shapes()
    (first,) = made.messages(Traffic(2.0, "wire", "received", b"4"))
    (second,) = made.messages(Sample("battery", 4, 1.0))
    assert second[1] == first[1]


ODD: Mapping[str, Reading] = {
    "no number": float("nan"),
    "too large": float("inf"),
    "of many bits": 2**70,
    "half a letter": "\ud800",
    "bytes inside": {"a": b"\x01"},
    "all of it": {"\ud800": ("\udfff", float("nan"), 2**70, b"\x01", {"a": None})},
}


@pytest.mark.parametrize("value", ODD.values(), ids=ODD)
def test_whatever_a_robot_says_becomes_json(value: Reading) -> None:
    """Of what JSON has no word for, another program still reads the message, and so do we."""
    topic, _, data = told(Sample("pose", {"of": value}, 1.0))
    json.loads(data, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert isinstance(event_of(topic, data, 1.0, SIGNALS), Sample)


@pytest.mark.parametrize("time_s", [1e300, -1e300, float("nan"), float("inf"), 0.0])
def test_whatever_time_it_says_fits_into_a_file(time_s: float) -> None:
    assert 0 <= told(Sample("battery", 1, time_s))[1] < 2**63


def test_a_clock_that_is_set_moves_nothing() -> None:
    """An entry of the audit has the time of day; what comes after it has its own time."""
    made = shapes()
    made.messages(AuditRecord(1.0, AuditEntry(1_900_000_000.0, "bot", "lease")))
    ((_, time_ns, _),) = made.messages(Sample("battery", 1, 2.0))
    assert time_ns == BORN_NS + 2_000_000_000


@pytest.mark.parametrize(
    ("topic", "data"),
    [
        ("/signals/battery", b"no json"),
        ("/signals/battery", b"[1]"),
        ("/signals/battery", b"{}"),
        ("/signals/battery", b'{"value": 1, "alarm": "red"}'),
        ("/signals/gone", b'{"value": 1}'),
        ("/signals/camera", b'{"data": "\xc3\xa9"}'),
        ("/signals/camera", b'{"value": 7}'),
        ("/signals/cloud", b'{"data": "AAAA", "fields": [], "point_stride": 12, "frame_id": ""}'),
        ("/signals/cloud", b'{"data": "", "fields": [], "point_stride": 0, "frame_id": ""}'),
        ("/signals/battery", b'{"value": "42"}'),
        ("/signals/battery", b'{"value": true}'),
        ("/signals/word", b'{"value": 1}'),
        ("/signals/isOn", b'{"value": 1}'),
        ("/signals/ranges", b'{"value": {}}'),
        ("/signals/pose", b'{"value": []}'),
        ("/signals/battery", b'{"value": ' + b"[" * 900 + b"]" * 900 + b"}"),
        ("/link/wire", b'{"state": "fine", "address": ""}'),
        ("/link/wire", b'{"state": "live", "address": "", "attempts": "many"}'),
        ("/wire/wire", b'{"direction": "sent", "hex": "zz"}'),
        ("/wire/wire", b'{"direction": "sent"}'),
        ("/log", b'{"level": 2}'),
        ("/other", b'{"value": 1}'),
        ("", b""),
    ],
)
def test_what_is_not_ours_or_damaged_tells_nothing(topic: str, data: bytes) -> None:
    assert event_of(topic, data, 1.0, SIGNALS) is None
