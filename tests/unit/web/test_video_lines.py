"""Videos on a slow line: fewer images but no old ones, and the low stream where there is one."""

import pytest

from urc.model.values import Sample, Signal
from urc.motion.driving_lock import SeenImage, SentImages
from urc.runtime.hub import Hub
from urc.runtime.image_viewers import low_stream
from urc.testing.clock import FakeClock
from urc.video import VideoUnit, encode_unit
from urc.web.feed.delivery_window import DeliveryWindow
from urc.web.feed.fanout import Fanout, Place
from urc.web.feed.video_feed import LOST_S
from urc.web.feed.video_quality import CALM_S, LATE_S
from urc.web.wire.picture import FIRST_LOW
from urc.wire.picture import KEY, LOW, SPARSE, VIDEO_HEADER

pytestmark = pytest.mark.anyio

GROUP_S = 1.0
HERTZ = 10


class Street:
    """A camera with two streams of ten images a second, and a page on a line."""

    def __init__(self, *, has_low: bool = True) -> None:
        self.clock = FakeClock()
        self.hub = Hub({"eye": Signal("eye", "video")})
        self.hub.low_streams = {"camera": ["eye"]} if has_low else {}
        self.fanout = Fanout(self.hub, clock=self.clock)
        self.place = Place(images=SentImages(frozenset(("eye",))))
        self.fanout.restart(self.place, DeliveryWindow(0.0))
        self.fanout.show(self.place, ["eye"])
        self.streams = {"high"}
        """Streams that the camera sends."""
        self.is_stuck = False
        """Whether the line delivers nothing."""
        self.count = 0
        self.seen: list[tuple[str, int]] = []
        """Name and flags of each image on the page."""

    async def run(self, seconds: float) -> list[tuple[str, int]]:
        """Let the camera send for a while; return what the page has received."""
        before = len(self.seen)
        for _ in range(round(seconds * HERTZ)):
            await self.clock.advance(1 / HERTZ)
            self._send()
            if not self.is_stuck:
                self.deliver()
        return self.seen[before:]

    def _send(self) -> None:
        now_s, is_key = self.clock.now(), self.count % round(HERTZ * GROUP_S) == 0
        for stream in self.streams:
            unit = VideoUnit("avc1.42", is_key, 640, 480, now_s, f"{stream}{self.count}".encode())
            if stream == "high":
                self.fanout.videos.take([Sample("eye", encode_unit(unit), now_s)])
            else:
                self.fanout.videos.take_low("eye", encode_unit(unit))
        self.count += 1

    def deliver(self) -> None:
        """Let the line deliver everything."""
        while (message := self.fanout.next_message(self.place)) is not None:
            _, length, _, _, _, self.number, _, _, flags = VIDEO_HEADER.unpack_from(message)
            self.seen.append((bytes(message[VIDEO_HEADER.size + length :]).decode(), flags))

    async def stall(self) -> None:
        """Let the line deliver nothing twice, for so long that images become late."""
        for _ in range(2):
            self.is_stuck = True
            await self.run(LATE_S + 0.1)
            self.is_stuck = False
            self.deliver()

    @property
    def viewed(self) -> list[str]:
        now_s = self.clock.now()
        names = ("eye", low_stream("eye"))
        return [name for name in names if self.hub.viewers.sees([name], now_s)]


def flags_of(seen: list[tuple[str, int]]) -> set[int]:
    """Return the flags of images, without the one of keyframes."""
    return {flags & ~KEY for _, flags in seen}


async def test_a_good_line_gets_every_image_of_the_high_stream() -> None:
    it = Street()
    seen = await it.run(3.0)
    assert [text for text, _ in seen] == [f"high{number}" for number in range(30)]
    assert flags_of(seen) == {0}
    assert it.viewed == ["eye"]


async def test_after_a_late_image_only_keyframes_follow_without_a_low_stream() -> None:
    it = Street(has_low=False)
    await it.run(2.2)
    await it.stall()
    seen = await it.run(5.0)
    assert [text for text, _ in seen] == [f"high{number}" for number in (30, 40, 50, 60, 70)]
    assert {flags for _, flags in seen} == {KEY | SPARSE}


async def test_the_quality_rises_again_at_a_keyframe() -> None:
    it = Street(has_low=False)
    await it.run(2.2)
    await it.stall()
    await it.run(CALM_S)
    seen = await it.run(2.0)
    last = next(place for place, (_, flags) in enumerate(seen) if not flags & SPARSE)
    assert seen[last][1] == KEY
    assert flags_of(seen[last:]) == {0}
    numbers = [int(text.removeprefix("high")) for text, _ in seen[last:]]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


async def test_the_low_stream_is_requested_and_shown_from_a_keyframe_on() -> None:
    it = Street()
    await it.run(2.2)
    await it.stall()
    assert it.viewed == ["eye", low_stream("eye")]
    seen = await it.run(2.0)
    assert {flags for _, flags in seen} == {KEY | SPARSE}, "until the low stream is open"
    it.streams = {"high", "low"}
    seen = await it.run(2.0)
    place = next(place for place, (_, flags) in enumerate(seen) if flags & LOW)
    assert seen[place][1] == KEY | LOW
    assert flags_of(seen[place:]) == {LOW}
    assert it.viewed == [low_stream("eye")], "no page needs the high stream"
    assert it.number > FIRST_LOW


async def lowered() -> Street:
    """Return a page that shows the low stream, while the high one is closed."""
    it = Street()
    it.streams = {"high", "low"}
    await it.run(2.2)
    await it.stall()
    await it.run(1.0)
    it.streams = {"low"}
    assert flags_of(await it.run(1.0)) == {LOW}
    return it


async def test_the_low_stream_stays_until_the_high_one_has_a_keyframe() -> None:
    it = await lowered()
    await it.run(CALM_S)
    assert it.viewed == ["eye", low_stream("eye")]
    assert flags_of(await it.run(2.0)) == {LOW}
    it.streams = {"high", "low"}
    seen = await it.run(2.0)
    place = next(place for place, (_, flags) in enumerate(seen) if not flags & LOW)
    assert seen[place][1] == KEY
    assert flags_of(seen[place:]) == {0}
    assert it.viewed == ["eye"]


async def test_a_line_that_does_not_bear_the_low_stream_gets_its_keyframes() -> None:
    it = await lowered()
    await it.stall()
    seen = await it.run(3.0)
    assert {flags for _, flags in seen} == {KEY | LOW | SPARSE}


async def test_a_lost_low_stream_is_replaced_by_keyframes_of_the_high_one() -> None:
    it = await lowered()
    it.streams = {"high"}
    await it.run(LOST_S + 1.0)
    seen = await it.run(2.0)
    assert {flags for _, flags in seen} == {KEY | SPARSE}
    assert it.viewed == ["eye", low_stream("eye")]


async def test_the_driving_lock_knows_the_images_of_both_streams() -> None:
    it = await lowered()
    age_s = it.place.images.age_s("eye", SeenImage(it.number, 0.0), it.clock.now())
    assert age_s == pytest.approx(0.0, abs=0.01)


async def test_a_page_that_shows_nothing_costs_nothing() -> None:
    it = await lowered()
    it.fanout.show(it.place, [])
    assert it.viewed == []
    assert await it.run(2.0) == []


async def test_two_cameras_and_an_image_share_a_line() -> None:
    """None waits until another one has nothing more to send."""
    hub, clock = Hub({"a": Signal("a", "video"), "b": Signal("b", "image")}), FakeClock()
    fanout, place = Fanout(hub, clock=clock), Place()
    fanout.show(place, ["a", "b"])
    kinds = []
    with hub.passed_to(fanout.videos.take):
        for number in range(6):
            unit = VideoUnit("avc1.42", number == 0, 640, 480, clock.now(), b"x")
            hub.publish([Sample("a", encode_unit(unit), clock.now())])
            hub.publish([Sample("b", b"\xff\xd8\xff%d" % number, clock.now())])
        for number in range(4):
            message = fanout.next_message(place)
            assert message is not None
            kinds.append(message[0])
            hub.publish([Sample("b", b"\xff\xd8\xffn%d" % number, clock.now())])
    assert kinds == [2, 1, 2, 1]
