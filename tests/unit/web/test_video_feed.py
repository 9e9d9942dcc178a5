"""Access units to the pages that show them: whole groups of pictures, encoded once, and bounded."""

import json
import struct
from collections.abc import Callable

import pytest

from urc.model.values import Sample, Signal
from urc.runtime.hub import Hub
from urc.runtime.still_process import Still
from urc.testing.clock import FakeClock, settle
from urc.video import VideoUnit, encode_unit, read_unit
from urc.web.feed import video_stills
from urc.web.feed.fanout import Fanout, Place
from urc.web.feed.video_feed import GROUP_BYTES, VideoFeed, VideoSubscription
from urc.web.wire import messages as wire
from urc.web.wire.picture import encode_video
from urc.wire.client_messages import ImageSelection
from urc.wire.picture import PICTURE, REPEATED, VIDEO_HEADER, read_picture

NAMES = ("front", "rear")


class Desk:
    """A feed with two cameras."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.hub = Hub({name: Signal(name, "video") for name in (*NAMES, "other")})
        self.feed = VideoFeed(self.hub, self.clock)

    def arrives(self, name: str, *units: str, late_s: float = 0.0) -> None:
        """Let access units arrive: ``K…`` is a keyframe."""
        for text in units:
            now_s = self.clock.now()
            unit = VideoUnit("avc1.42", text[0] == "K", 640, 480, now_s - late_s, text.encode())
            self.feed.take([Sample(name, encode_unit(unit), now_s)])

    def sent(self, page: VideoSubscription, most: int = 99) -> list[str]:
        """Return the access units that a page receives."""
        frames = []
        while len(frames) < most and (frame := self.feed.next_frame(page)) is not None:
            frames.append(frame)
        return [parts(frame)[-1].decode() for frame in frames]


def page(*names: str) -> VideoSubscription:
    made = VideoSubscription()
    made.show(names)
    return made


def parts(frame: bytes) -> tuple[int, int, int, int, int, int, str, bytes]:
    """Return number, age, width, height, index, key, codec and data of a frame."""
    size = frame[1]
    start = 2 if size < 126 else 4 if size == 126 else 10
    message = frame[start:]
    kind, length, index, age_ms, _, number, width, height, key = VIDEO_HEADER.unpack_from(message)
    assert kind == 2
    at = VIDEO_HEADER.size + length
    codec = message[VIDEO_HEADER.size : at].decode()
    return number, age_ms, width, height, index, key, codec, message[at:]


pytestmark = pytest.mark.anyio


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_a_unit_says_all_that_a_decoder_needs(desk: Desk) -> None:
    desk.arrives("rear", "K1")
    frame = desk.feed.next_frame(page("rear"))
    assert frame is not None
    assert parts(frame) == (1, 0, 640, 480, 1, 1, "avc1.42", b"K1")
    header = struct.unpack(">BBHIdIHHB", frame[2:27])
    assert header[4] == round(desk.clock.now() * 1000)
    message = read_picture(frame[2:])  # what a program receives from the server
    assert message is not None
    assert message[:2] == (1, 0)
    assert read_unit(message.data) == VideoUnit("avc1.42", True, 640, 480, 0.0, b"K1")


@pytest.mark.parametrize("length", range(35))
def test_a_truncated_message_is_no_unit(length: int) -> None:
    whole = encode_video(1, VideoUnit("avc1.42", True, 640, 480, 0.0, b"123"), 1, 0, 0)
    assert len(whole) == 35
    found = read_picture(whole[:length])
    assert found is None or length > 25 + len("avc1.42")


def test_a_new_page_starts_with_the_keyframe_of_the_newest_group(desk: Desk) -> None:
    desk.arrives("front", "a", "K1", "b", "K2", "c", "d")
    assert desk.sent(page("front")) == ["K2", "c", "d"]


def test_a_page_receives_each_unit_once_and_in_order(desk: Desk) -> None:
    one = page("front")
    desk.arrives("front", "K1", "a")
    assert desk.sent(one) == ["K1", "a"]
    desk.arrives("front", "b")
    assert desk.sent(one) == ["b"]
    desk.arrives("front", "K2")
    assert desk.sent(one) == ["K2"]
    assert desk.sent(one) == []


def test_a_page_that_fell_behind_continues_with_the_newest_group(desk: Desk) -> None:
    slow, fast = page("front"), page("front")
    desk.arrives("front", "K1", "a", "b", "c")
    assert desk.sent(slow, 2) == ["K1", "a"]
    assert desk.sent(fast) == ["K1", "a", "b", "c"]
    desk.arrives("front", "K2", "d")
    assert desk.sent(slow) == ["K2", "d"]
    assert desk.sent(fast) == ["K2", "d"]


def test_before_the_first_keyframe_nothing_is_sent(desk: Desk) -> None:
    one = page("front")
    desk.arrives("front", "a", "b")
    assert desk.sent(one) == []


def test_two_cameras_take_turns(desk: Desk) -> None:
    both = page(*NAMES)
    desk.arrives("front", "K1", "a", "b")
    desk.arrives("rear", "K2", "c", "d")
    assert desk.sent(both) == ["K1", "K2", "a", "c", "b", "d"]


def test_a_video_shown_again_starts_with_a_keyframe(desk: Desk) -> None:
    one = page("front")
    desk.arrives("front", "K1", "a")
    assert desk.sent(one) == ["K1", "a"]
    one.show(())
    desk.arrives("front", "b")
    one.show(("front",))
    assert desk.sent(one) == ["K1", "a", "b"]


def test_the_age_counts_from_the_arrival_at_the_computer(desk: Desk) -> None:
    """A server that was held up for 3 s does not make the image younger."""
    desk.arrives("front", "K1", late_s=3.0)
    frame = desk.feed.next_frame(page("front"))
    assert frame is not None
    assert parts(frame)[1] == 3000


@pytest.mark.parametrize("late_s", [-5.0, 3600.0])
def test_an_arrival_by_another_computers_clock_does_not_count(desk: Desk, late_s: float) -> None:
    """A recording contains such times."""
    desk.arrives("front", "K1", late_s=late_s)
    frame = desk.feed.next_frame(page("front"))
    assert frame is not None
    assert parts(frame)[1] == 0


async def test_all_pages_share_one_frame_until_its_age_is_wrong(desk: Desk) -> None:
    desk.arrives("front", "K1")
    first, second = (desk.feed.next_frame(page("front")) for _ in range(2))
    assert first is second
    await desk.clock.advance(0.2)
    third = desk.feed.next_frame(page("front"))
    assert third is not None
    assert parts(third)[1] == 200


def test_an_endless_group_takes_bounded_memory(desk: Desk) -> None:
    """Its beginning is dropped, so pages wait for the next keyframe."""
    one, large = page("front"), "x" * 1_000_000
    desk.arrives("front", "K1")
    assert desk.sent(one) == ["K1"]
    for _ in range(40):
        desk.arrives("front", large)
        kept = desk.feed.groups["front"].units
        assert sum(len(each.unit.data) for each in kept) <= GROUP_BYTES
    assert desk.feed.overflows == 1
    assert desk.sent(one) == []
    desk.arrives("front", "K2", "a")
    assert desk.sent(one) == ["K2", "a"]


def test_other_bytes_are_ignored(desk: Desk) -> None:
    desk.feed.take([Sample("front", b"\xff\xd8\xff", 0.0), Sample("other", None, 0.0)])
    assert desk.sent(page("front", "other")) == []


def test_a_page_that_decodes_gets_units_and_counts_as_a_viewer() -> None:
    """A picture never goes out for a video, and no video for a picture."""
    hub = Hub({"eye": Signal("eye", "video"), "cam": Signal("cam", "image")})
    clock = FakeClock()
    fanout, place = Fanout(hub, clock=clock), Place()
    fanout.show(place, ["eye", "cam"])
    assert hub.viewers.sees(["eye"], 0.0)
    unit = encode_unit(VideoUnit("avc1.42", True, 640, 480, clock.now(), b"K1"))
    with hub.passed_to(fanout.videos.take):
        hub.publish([Sample("eye", unit, clock.now()), Sample("cam", b"\xff\xd8\xff", clock.now())])
    first, second = fanout.next_picture(place), fanout.next_picture(place)
    assert first is not None
    assert second is not None
    assert parts(first)[-1] == b"K1"
    assert second[2] == 1
    assert fanout.next_picture(place) is None
    fanout.show(place, ())
    assert not hub.viewers.sees(["eye", "cam"], 0.0)


class FakeMaker:
    """A maker without a process, which keeps what it is given."""

    started: list[str] = []  # noqa: RUF012 - shared by all makers of one test

    def __init__(
        self, name: str, made: Callable[[str, Still], None], frozen_after_s: float
    ) -> None:
        self.name = name
        self.frozen_after_s = frozen_after_s
        self.made = made
        self.taken: list[tuple[bytes, bool]] = []

    def start(self) -> None:
        self.started.append(self.name)

    def take(self, value: bytes, *, is_key: bool) -> None:
        self.taken.append((value, is_key))

    async def stop(self) -> None:
        self.started.remove(self.name)


async def test_only_pages_that_cannot_decode_get_jpeg_images(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One maker serves all of them, the log tells of it, and it ends with the last page."""
    monkeypatch.setattr(video_stills, "StillMaker", FakeMaker)
    monkeypatch.setattr(FakeMaker, "started", [])
    hub, clock = Hub({"eye": Signal("eye", "video", frozen_after_s=2.0)}), FakeClock()
    fanout = Fanout(hub, clock=clock)
    decoding, first, second = Place(), Place(), Place()
    fanout.show(decoding, ["eye"])
    assert FakeMaker.started == []
    for place in (first, second):
        fanout.show(place, ["eye"], ["eye"])
    assert FakeMaker.started == ["eye"]
    assert ["JPEG" in note.text for note in hub.notes] == [True]
    unit = encode_unit(VideoUnit("avc1.42", True, 640, 480, clock.now(), b"K1"))
    with hub.passed_to(fanout.videos.take):
        hub.publish([Sample("eye", unit, clock.now())])
    maker = fanout.stills._makers["eye"]
    assert isinstance(maker, FakeMaker)
    assert maker.frozen_after_s == 2.0
    assert maker.taken == [(unit, True)]
    assert fanout.next_picture(first) is None
    maker.made("eye", Still(clock.now() - 1.5, b"\xff\xd8\xff jpeg"))
    for place in (first, second):
        frame = fanout.next_picture(place)
        assert frame is not None
        message = read_picture(frame[2:])
        assert message is not None
        assert message[1:] == (1500, b"\xff\xd8\xff jpeg")
    frame = fanout.next_picture(decoding)
    assert frame is not None
    assert parts(frame)[-1] == b"K1"
    for is_repeated, kind in ((True, REPEATED), (False, PICTURE)):
        maker.made("eye", Still(clock.now() - 90.0, b"\xff\xd8\xff same", is_repeated))
        frame = fanout.next_picture(first)
        assert frame is not None
        message = read_picture(frame[2:])
        assert message is not None
        assert (frame[2], message.age_ms) == (kind, 90_000 if is_repeated else 0)
    fanout.show(first, ())
    await settle()
    assert FakeMaker.started == ["eye"]
    fanout.show(second, ["eye"])
    await settle()
    assert FakeMaker.started == []
    await fanout.stills.close()


def test_a_page_names_the_videos_that_it_cannot_decode() -> None:
    said = json.dumps({"t": "show", "signals": ["a", "b"], "stills": ["b"]})
    assert wire.decode(said) == ImageSelection(("a", "b"), ("b",))
