"""Videos in messages: nothing is passed on that no decoder could begin with."""

from pathlib import Path
from typing import Any

import pytest

from tests.unit.test_video import baseline_sps, encoded
from urc.config.load import load_profile
from urc.model.payload import LOST, Envelope
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Samples, Violation
from urc.runtime.registries import built_in_catalog
from urc.video import MAX_UNIT_BYTES, VideoUnit, read_unit
from urc.video_reader import NO_KEYFRAME_S

KEY, DELTA = baseline_sps(640, 480) + b"\0\0\1\x65image", b"\0\0\1\x41change"
PROFILE = """
urc: 1
kind: robot
name: rover
transports: { ros: { type: ros, via: foxglove, host: 127.0.0.1 } }
signals: { film: { type: video }, raw: { type: video, capture_time: false } }
messages:
  film: { subscribe: { topic: /film, type: foxglove.CompressedVideo }, json: { film: "@" } }
  raw:
    subscribe: { topic: /raw, type: ffmpeg_image_transport_msgs/FFMPEGPacket }
    json: { raw: "@" }
"""


class Rover:
    """An engine with a video from each kind of server."""

    def __init__(self, folder: Path) -> None:
        file = folder / "rover.yaml"
        file.write_text(PROFILE)
        profile = load_profile(file, built_in_catalog())
        self.engine = Engine(profile.driver, {})
        self.engine.start("ros", 0.0)

    def hear(self, body: object, now: float, *, lost: bool = False, topic: str = "/film") -> Any:
        """Return the access unit, None if the message sets nothing, or the reason of a refusal."""
        attributes = {"topic": topic, **({LOST: True} if lost else {})}
        events = self.engine.receive("ros", Envelope("message", attributes, body), now)
        return _unit(events)


def _unit(events: list[Event]) -> VideoUnit | str | None:
    for event in events:
        if isinstance(event, Violation):
            return event.message
        if isinstance(event, Samples) and event.samples:
            (sample,) = event.samples
            assert isinstance(sample.value, bytes)
            found = read_unit(sample.value)
            assert found is not None
            assert found.time_s == sample.time_s
            return found
    return None


def foxglove(data: bytes, stamp_s: int = 0, form: str = "h264") -> dict[str, Any]:
    stamp = {"sec": stamp_s, "nanosec": 0}
    return {"timestamp": stamp, "frame_id": "eye", "data": data, "format": form}


def packet(data: bytes, encoding: str = "h264") -> dict[str, Any]:
    head = {"stamp": {"sec": 5, "nanosec": 0}, "frame_id": "eye"}
    return {
        "header": head,
        "width": 640,
        "height": 480,
        "encoding": encoding,
        "pts": 7,
        "flags": 1,
        "is_bigendian": False,
        "data": data,
    }


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        ("/film", foxglove),
        ("/raw", packet),
        ("/raw", lambda data: packet(data, "libx264;yuv420p;bgr8;bgr8")),
    ],
)
def test_messages_become_access_units_from_the_first_keyframe_on(
    tmp_path: Path, topic: str, message: Any
) -> None:
    rover = Rover(tmp_path)
    assert rover.hear(message(DELTA), 10.0, topic=topic) is None
    first = rover.hear(message(KEY), 10.1, topic=topic)
    assert first == VideoUnit("avc1.42001E", True, 640, 480, 10.1, KEY)
    second = rover.hear(message(DELTA), 10.2, topic=topic)
    assert (second.is_key, second.width, second.data, second.time_s) == (False, 640, DELTA, 10.2)


@pytest.mark.parametrize(("codec", "form"), [("libx264", "h264"), ("libx265", "h265")])
def test_the_streams_of_real_encoders_pass_unchanged(tmp_path: Path, codec: str, form: str) -> None:
    rover = Rover(tmp_path)
    sent = encoded(codec, 320, 240, 4, preset="ultrafast", tune="zerolatency")
    found = [rover.hear(foxglove(data, form=form), 10 + n / 30) for n, data in enumerate(sent)]
    assert [one.data for one in found] == sent
    assert found[0].is_key
    assert {one[2:4] for one in found} == {(320, 240)}


def test_after_a_loss_nothing_comes_before_the_next_keyframe(tmp_path: Path) -> None:
    rover = Rover(tmp_path)
    assert rover.hear(foxglove(KEY), 1.0, lost=True).is_key, "the first of a connection"
    assert not rover.hear(foxglove(DELTA), 1.1).is_key
    assert rover.hear(foxglove(DELTA), 1.2, lost=True) is None
    assert rover.hear(foxglove(DELTA), 1.3) is None
    assert rover.hear(foxglove(KEY), 1.4).is_key
    assert not rover.hear(foxglove(DELTA), 1.5).is_key


def test_a_loss_of_one_topic_costs_no_other_video(tmp_path: Path) -> None:
    rover = Rover(tmp_path)
    rover.hear(foxglove(KEY), 1.0)
    rover.hear(packet(KEY), 1.0, topic="/raw")
    assert rover.hear(foxglove(DELTA), 1.1, lost=True) is None
    assert rover.hear(packet(DELTA), 1.1, topic="/raw").data == DELTA


def test_an_access_unit_that_waited_is_older_than_its_arrival(tmp_path: Path) -> None:
    """In its value too, from which other images are made."""
    rover = Rover(tmp_path)
    assert rover.hear(foxglove(KEY, 1_700_000_000), 10.0).time_s == 10.0
    assert rover.hear(foxglove(KEY, 1_700_000_001), 12.0).time_s == 11.0


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (foxglove(KEY, form="vp9"), "film: the video has the format 'vp9'; URC supports H.264"),
        ({"data": KEY}, "film: "),
        ({"format": "h264"}, "film: "),
        ({"format": 7, "data": KEY}, "film: "),
        (foxglove(bytes(MAX_UNIT_BYTES + 1)), "film: an encoded image has 4194305 bytes"),
        (foxglove(baseline_sps(30_000, 30_000) + b"\0\0\1\x65"), "film: the camera sends images"),
        (foxglove(b"\0\0\1\x67\x42"), "film: the camera's stream is damaged"),
    ],
)
def test_a_message_without_a_usable_video_is_refused(
    tmp_path: Path, message: dict[str, Any], said: str
) -> None:
    rover = Rover(tmp_path)
    rover.hear(foxglove(KEY), 1.0)
    found = rover.hear(message, 1.1)
    assert isinstance(found, str)
    assert found.startswith(said)
    assert rover.hear(foxglove(DELTA), 1.2) is None, "no decoder could go on"
    assert rover.hear(foxglove(KEY), 1.3).is_key


def test_a_video_without_keyframes_is_refused_with_a_remedy(tmp_path: Path) -> None:
    rover = Rover(tmp_path)
    rover.hear(foxglove(KEY), 1.0)
    assert "set a keyframe interval of 1 s" in rover.hear(foxglove(DELTA), 1.1 + NO_KEYFRAME_S)
