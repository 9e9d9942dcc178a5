"""Parts of the camera transport: options, the bounds of a stream, and what the relay refuses."""

import struct
from pathlib import Path

import pytest

from tests.unit.test_video import baseline_sps
from urc.cli.main import main
from urc.images import MAX_PIXELS
from urc.transports import camera
from urc.transports.base import MissingPackage, Transport, TransportError, TransportSetup
from urc.transports.camera_options import read_low_options, read_options
from urc.transports.camera_process import EarlyUnits, capture_s
from urc.transports.camera_records import (
    NOTE,
    QUEUE_BYTES,
    RECORD,
    CapturedUnits,
    UnitQueue,
)
from urc.transports.camera_relay import RtspWatch
from urc.video import MAX_UNIT_BYTES, VideoUnit
from urc.video_reader import NO_KEYFRAME_S, UnitReader, VideoFault

KEY, DELTA = b"\0\0\1\x65image", b"\0\0\1\x41change"


def made(**options: object) -> Transport:
    return camera.from_setup(TransportSetup("eye", options))


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("rtsp://10.0.0.2/live?n=1", "camera rtsp://10.0.0.2:554/live?n=1"),
        ("rtsps://cam.local/live", "camera rtsps://cam.local:322/live"),
        ("rtsp://[fe80::1]:8554/", "camera rtsp://[fe80::1]:8554/"),
        ("http://10.0.0.2:8080/film.mp4", "camera http://10.0.0.2:8080/film.mp4"),
        ("udp://0.0.0.0:11111", "camera udp *:11111 (listening)"),
        ("udp://127.0.0.1:11111", "camera udp 127.0.0.1:11111 (listening)"),
    ],
)
def test_the_address_is_shown_with_its_port(url: str, shown: str) -> None:
    assert made(url=url).address == shown


AUTH = {"type": "digest", "user": "viewer", "password": "x"}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"url": "file:///etc/passwd"}, "camera: url must begin with one of rtsp://, "),
        ({"url": "concat:a|b"}, "camera: url must begin with one of rtsp://, "),
        ({"url": "rtsp://u:p@10.0.0.2/"}, "camera: put user and password under auth"),
        ({"url": "udp://10.0.0.2"}, "camera: url must be a local address such as udp://0.0.0.0"),
        ({"url": "udp://0.0.0.0:1/x"}, "camera: url must be a local address such as udp://0.0.0.0"),
        ({"url": "udp://0.0.0.0:1", "auth": AUTH}, "camera: a stream over udp has no sign-in"),
        ({"url": "rtsp://a/", "host": "b"}, "camera: host has an effect only with a udp:// url"),
        ({"url": "http://a/", "rtp": "udp"}, "camera: rtp has an effect only with an rtsp:// url"),
        ({"url": "rtsp://a/", "rtp": "quic"}, "camera: rtp must be tcp or udp, not 'quic'"),
    ],
)
def test_an_invalid_option_is_named(options: dict[str, object], said: str) -> None:
    with pytest.raises(TransportError) as told:
        made(**options)
    assert str(told.value).startswith(said)


STREAMS = {"high": "rtsp://10.0.0.2/1", "low": "rtsp://10.0.0.2/2"}


def test_two_streams_share_all_other_options() -> None:
    setup = TransportSetup("eye", {"streams": STREAMS, "auth": AUTH, "rtp": "udp"})
    high, low = read_options(setup), read_low_options(setup)
    assert low is not None
    assert (high.place.path, low.place.path) == ("/1", "/2")
    assert low._replace(place=high.place) == high
    assert made(streams=STREAMS).address == "camera rtsp://10.0.0.2:554/1"
    assert read_low_options(TransportSetup("eye", {"url": "rtsp://a/"})) is None


def test_an_invalid_low_stream_is_named() -> None:
    with pytest.raises(TransportError) as told:
        made(streams={**STREAMS, "low": "rtsp://u:p@10.0.0.2/"})
    assert str(told.value).startswith("camera: put user and password under auth")


def test_a_missing_library_is_named_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "find_spec", lambda _: None)
    with pytest.raises(MissingPackage) as told:
        made(url="rtsp://10.0.0.2/")
    assert str(told.value).startswith("camera needs the package av: ")


# The bounds of a stream


def test_nothing_is_passed_on_before_the_first_keyframe() -> None:
    """No decoder could begin with the rest of a group."""
    queue = UnitQueue()
    for number in range(3):
        queue.put(b"%d" % number, is_key=False)
    queue.put(b"key", is_key=True)
    queue.end()
    assert [queue.take(), queue.take()] == [b"key", None]


def test_a_slow_reader_gets_the_newest_group_from_its_keyframe() -> None:
    queue = UnitQueue(max_units=10)
    for number in range(35):
        queue.put(b"%d" % number, is_key=number % 8 == 0)
    queue.end()
    taken = list(iter(queue.take, None))
    assert taken == [b"32", b"33", b"34"]


def test_an_endless_group_takes_bounded_memory() -> None:
    """After an overflow, images are lost until the next keyframe."""
    queue, piece = UnitQueue(max_units=1000), bytes(100_000)
    queue.put(piece, is_key=True)
    for _ in range(1000):
        queue.put(piece, is_key=False)
        assert queue._bytes <= QUEUE_BYTES
    queue.put(b"key", is_key=True)
    queue.end()
    assert list(iter(queue.take, None))[-1] == b"key"


def test_a_stream_without_keyframes_is_ended() -> None:
    reader = UnitReader(is_hevc=False, began_s=100.0)
    assert reader.unit(DELTA, 100.0 + NO_KEYFRAME_S) is None
    with pytest.raises(VideoFault, match=r"^no keyframe within 20 s: set a keyframe interval of"):
        reader.unit(DELTA, 100.1 + NO_KEYFRAME_S)


def test_a_keyframe_counts_anew() -> None:
    reader = UnitReader(is_hevc=False, began_s=100.0)
    first = reader.unit(baseline_sps(640, 480) + KEY, 119.0)
    assert first is not None
    assert (first.is_key, first.width, first.height, first.time_s) == (True, 640, 480, 119.0)
    second = reader.unit(DELTA, 138.0)
    assert second is not None
    assert (second.is_key, second.codec, second.data) == (False, "avc1.42001E", DELTA)


def test_a_gigantic_image_is_refused_before_anything_decodes_it() -> None:
    reader = UnitReader(is_hevc=False, began_s=0.0)
    with pytest.raises(VideoFault) as told:
        reader.unit(baseline_sps(30_000, 30_000) + KEY, 0.0)
    assert str(told.value) == (
        f"the camera sends images of 30000 by 30000 pixels; the limit is {MAX_PIXELS} in total:"
        " select a smaller image in the camera's settings"
    )


def test_a_gigantic_access_unit_is_refused() -> None:
    reader = UnitReader(is_hevc=False, began_s=0.0)
    with pytest.raises(VideoFault, match=r"^an encoded image has 4194305 bytes; the limit is"):
        reader.unit(bytes(MAX_UNIT_BYTES + 1), 0.0)


def early(*stamps: float | None) -> list[float]:
    """Return the times of units that the library delivers at once, 2 s after the first byte."""
    units = EarlyUnits(100.0)
    for place, pts_s in enumerate(stamps):
        unit = VideoUnit("avc1.42", place == 0, 640, 480, 102.0, b"x")
        units.add(unit, pts_s)
    return [round(one.time_s, 3) for one in units.stamped()]


def test_units_kept_during_the_detection_are_not_younger_than_they_are() -> None:
    """By the time stamps of the stream, and never before its first byte."""
    assert early(7.0, 7.5, 8.5) == [100.5, 101.0, 102.0]
    assert early(7.0, 7.5, 77.0) == [100.0, 100.0, 102.0]
    assert early(9.0, 7.5, 8.5) == [102.0, 101.0, 102.0]
    assert early(None, None, None, None) == [100.5, 101.0, 101.5, 102.0]
    assert early() == []


def test_the_detection_ends_with_the_first_wait_for_the_network() -> None:
    units = EarlyUnits(100.0)
    assert not units.ends(0.001)
    assert units.ends(0.02)
    assert not units.is_over
    units.stamped()
    assert units.is_over


# What the relay refuses

REDIRECT = b"RTSP/1.0 302 Moved Temporarily\r\nCSeq: 1\r\nLocation: rtsp://evil.example/x\r\n\r\n"
FINE = b"RTSP/1.0 200 OK\r\nCSeq: 1\r\nContent-Length: 0\r\n\r\n"
SAID = "the camera redirects to rtsp://evil.example/x; URC follows no redirects"


@pytest.mark.parametrize("before", [b"", FINE, FINE + b"$\0\0\4abcd\r\n"])
def test_a_redirect_never_reaches_the_library(before: bytes) -> None:
    assert RtspWatch(refuses_basic=False).received(before + REDIRECT).startswith(SAID)


@pytest.mark.parametrize("size", range(1, 30))
def test_a_redirect_in_pieces_never_reaches_the_library_as_a_whole(size: int) -> None:
    """The library acts on a complete status line, so one piece of it must be held back."""
    watch, passed = RtspWatch(refuses_basic=False), b""
    whole = FINE + REDIRECT
    for start in range(0, len(whole), size):
        piece = whole[start : start + size]
        if watch.received(piece):
            break
        passed += piece
    else:
        pytest.fail("the redirect was passed on")
    assert b"RTSP/1.0 302" not in passed


def test_an_ordinary_stream_is_passed_on() -> None:
    watch = RtspWatch(refuses_basic=False)
    for piece in (FINE, FINE[:20], FINE[20:], bytes(range(256)) * 100):
        assert watch.received(piece) == ""


@pytest.mark.parametrize("at", range(1, 60, 7))
def test_a_password_as_plain_text_is_held_back_if_the_document_says_digest(at: int) -> None:
    said = b"DESCRIBE rtsp://c/ RTSP/1.0\r\nAuthorization: Basic dTpw\r\n\r\n"
    watch = RtspWatch(refuses_basic=True)
    told = watch.sent(said[:at]) or watch.sent(said[at:])
    assert told.startswith("the camera asks for the password as plain text, but auth says digest")
    assert RtspWatch(refuses_basic=False).sent(said) == ""


def test_a_digest_is_sent() -> None:
    said = b'DESCRIBE rtsp://c/ RTSP/1.0\r\nAuthorization: Digest username="u"\r\n\r\n'
    assert RtspWatch(refuses_basic=True).sent(said) == ""


def test_validate_names_the_missing_library_and_finds_no_mistake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "eye.yaml"
    file.write_text(
        "urc: 1\nkind: robot\nname: eye\n"
        'transports:\n  eye: { type: camera, url: "rtsp://10.0.0.2/" }\n'
        "signals:\n  picture: { type: video }\n"
        "messages:\n  picture: { raw: picture }\n",
        "utf-8",
    )
    assert main(["validate", str(file)]) == 0
    assert "needs the package" not in capsys.readouterr().err
    monkeypatch.setattr(camera, "find_spec", lambda _: None)
    assert main(["validate", str(file)]) == 0
    told = capsys.readouterr().err.splitlines()
    assert "cannot be opened on this computer: camera needs the package av: " in told[0]
    assert told[1].startswith("1 document: 0 errors, 0 warnings")


# Times of capture


class Packet:
    """A packet of the library, with the library's bytes for a time of capture."""

    def __init__(self, **sides: bytes) -> None:
        self._sides = sides

    def has_sidedata(self, kind: str) -> bool:
        return kind in self._sides

    def get_sidedata(self, kind: str) -> bytes:
        return self._sides[kind]


def prft(captured_s: float) -> Packet:
    return Packet(prft=struct.pack("=qi4x", round(captured_s * 1e6), 24))


def test_the_time_of_capture_is_a_time_of_day() -> None:
    assert capture_s(prft(1_700_000_000.25)) == 1_700_000_000.25
    assert capture_s(Packet()) is None
    assert capture_s(Packet(prft=b"short")) is None
    assert capture_s(prft(-5.0)) is None
    assert capture_s(object()) is None, "as with PyAV 15"


def test_a_unit_that_waited_is_older_than_its_arrival() -> None:
    units, queue = CapturedUnits(), UnitQueue()

    def age_s(captured_s: float | None, came_s: float) -> float:
        unit = VideoUnit("avc1.42", True, 640, 480, came_s, b"x")
        return round(came_s - units.aged(unit, captured_s, queue).time_s, 3)

    assert age_s(None, 10.0) == 0
    assert age_s(1_700_000_000.0, 10.1) == 0
    assert age_s(1_700_000_000.1, 11.2) == 1.0
    assert age_s(1_700_000_000.2, 200.0) == 50.0, "not more than the server believes"
    queue.end()
    assert queue.take() is None


def test_a_step_of_the_cameras_clock_is_one_line_for_the_log() -> None:
    units, queue = CapturedUnits(), UnitQueue()
    for place, captured_s in enumerate((1000.0, 1000.1, 900.2, 900.3, 1000.4)):
        unit = VideoUnit("avc1.42", True, 640, 480, 10.0 + place / 10, b"x")
        assert units.aged(unit, captured_s, queue).time_s == pytest.approx(unit.time_s)
    queue.put(b"unit", is_key=True)
    queue.end()
    taken = list(iter(queue.take, None))
    assert taken[0] == b"unit"
    size, kind = RECORD.unpack(taken[1][: RECORD.size])
    assert (size, kind) == (len(taken[1]) - RECORD.size, NOTE)
    assert b"100.0 s behind the earlier ones" in taken[1]
    assert len(taken) == 2
