"""The driving lock between a page and its controls: reports, lies, notices, and the audit log."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.unit.runtime.desks import DRIVER, held
from tests.unit.web.test_controls import Scene, scene
from urc.model.exchange import Sight
from urc.model.values import Sample, Signal
from urc.motion.driving_lock import SeenImage, SentImages
from urc.runtime.hub import Hub
from urc.runtime.image_interlock import NO_IMAGE, OLD_IMAGE
from urc.testing.clock import FakeClock
from urc.video import VideoUnit, encode_unit
from urc.web.drive.control_service import OperatorSession
from urc.web.feed.fanout import Fanout
from urc.web.wire import drive as wire
from urc.wire.picture import PICTURE_HEADER, VIDEO_HEADER

pytestmark = pytest.mark.anyio

_DRIVE = held("drive")
assert _DRIVE.hold is not None
SEEING = DRIVER._replace(
    commands={
        **DRIVER.commands,
        "drive": _DRIVE._replace(hold=_DRIVE.hold._replace(sight=Sight("front", 0.75, 0.25))),
    }
)


@asynccontextmanager
async def desk() -> AsyncIterator[tuple[Scene, OperatorSession]]:
    """Attach a robot that needs an image; a page has its controls, and image 7 of now."""
    async with scene(driver=SEEING) as it:
        ann = it.add_page()
        ann.images = SentImages(it.controls.images.signals)
        it.say(ann, "take")
        ann.images.sent("front", 7, it.clock.now(), it.clock.now())
        yield it, ann


async def test_a_tick_that_names_an_image_moves_by_its_age() -> None:
    async with desk() as (it, ann):
        it.tick(ann, 0.8, sees=(7, 0))
        assert it.backend.texts[-1] == "drive speed=0.8"
        for step in range(10):
            await it.clock.advance(0.05)
            it.tick(ann, 0.8, sees=(7, 50 * step))
        speed = float(it.backend.texts[-1].removeprefix("drive speed="))
        assert speed == pytest.approx(0.4)


async def test_a_page_that_goes_on_naming_an_old_image_stops_and_is_told_why() -> None:
    async with desk() as (it, ann):
        for step in range(16):
            it.tick(ann, 0.8, sees=(7, 50 * step))
            await it.clock.advance(0.05)
        assert it.backend.texts[-1] == "drive stop"
        told = it.read(ann)
        assert {message["message"] for message in told if message["t"] == "refused"} == {OLD_IMAGE}
        ended = [entry.outcome for entry in it.audit if entry.what == "stopped"]
        assert ended == [OLD_IMAGE]


async def test_the_guard_stops_at_the_age_before_the_lease_would_end() -> None:
    """No further tick comes; the lease would end after 300 ms, and the image after 150."""
    async with desk() as (it, ann):
        await it.clock.advance(0.6)
        it.tick(ann, 0.8, sees=(7, 500))
        await it.clock.advance(0.2)
        assert it.backend.texts[-1] == "drive stop"
        (stop_s,) = (at_s for at_s, text in it.backend.written if text == "drive stop")
        assert stop_s == pytest.approx(it.clock.now() - 0.05)
        (told,) = (message for message in it.read(ann) if message["t"] in ("refused", "stopped"))
        assert (told["t"], told["message"]) == ("refused", OLD_IMAGE)


@pytest.mark.parametrize("lie", [None, (8, 0), (6, 0), (7, 5000), (7, -1)])
async def test_a_page_that_cannot_see_does_not_move(lie: tuple[int, int] | None) -> None:
    """It names none, one that it did not get, or one that it showed before it got it."""
    async with desk() as (it, ann):
        it.tick(ann, 0.8, sees=lie)
        assert it.backend.texts == []
        (told,) = (message for message in it.read(ann) if message["t"] == "refused")
        assert (told["command"], told["message"]) == ("drive", NO_IMAGE)


async def test_what_another_page_got_does_not_count() -> None:
    async with desk() as (it, ann):
        bob = it.add_page("192.168.1.7")
        bob.images = SentImages(it.controls.images.signals)
        it.say(ann, "leave")
        it.say(bob, "take")
        it.tick(bob, 0.8, sees=(7, 0))
        assert it.backend.texts == []


async def test_other_commands_move_without_any_image() -> None:
    async with desk() as (it, ann):
        it.tick(ann, 0.5, "lift")
        assert it.backend.texts == ["lift speed=0.5"]


async def test_an_override_is_told_to_the_pages_and_stands_in_the_audit_log() -> None:
    async with desk() as (it, ann):
        it.controls.handle(ann, wire.Drive("override", 5.0))
        (lease,) = it.read(ann)
        assert lease["override"] == 5000
        it.tick(ann, 0.8)
        assert it.backend.texts == ["drive speed=0.8"]
        (entry,) = (entry for entry in it.audit if entry.what == "override")
        assert (entry.client, entry.outcome) == ("s1", "may drive without an image for 5 s")


async def test_an_override_that_is_refused_does_not_stand_in_the_audit_log_as_one() -> None:
    async with desk() as (it, _):
        bob = it.add_page("192.168.1.7")
        it.controls.handle(bob, wire.Drive("override", 5.0))
        (told,) = (message for message in it.read(bob) if message["t"] == "refused")
        assert told["message"] == "screen 1 has the controls"
        assert [entry.what for entry in it.audit if entry.who == bob.client.name] == ["refused"]


def test_a_tick_without_an_image_is_the_same_message_as_ever() -> None:
    tick = wire.decode_tick(b'{"t":"tick","command":"drive","epoch":1,"number":2,"echo":3}')
    assert tick.sees is None
    seeing = b'{"t":"tick","command":"drive","epoch":1,"number":2,"echo":3,"sees":[7,40]}'
    assert wire.decode_tick(seeing).sees == (7, 40)


@pytest.mark.parametrize("sees", ["7", "[7]", "[7,40,1]", '["7",40]', "[7.5,40]", "{}"])
def test_a_report_of_another_shape_is_no_tick(sees: str) -> None:
    text = f'{{"t":"tick","command":"drive","epoch":1,"number":2,"echo":3,"sees":{sees}}}'
    with pytest.raises(wire.NO_TICK):
        wire.decode_tick(text.encode())


class Seen:
    """A page that gets a JPEG camera and a video, and the record of what it got."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.hub = Hub({"front": Signal("front", "image"), "film": Signal("film", "video")})
        self.fanout = Fanout(self.hub, clock=self.clock)
        self.place = self.fanout.join(lambda: None)
        self.place.images = self.images = SentImages(frozenset({"front", "film"}))

    def arrives(self, *, late_s: float = 0.0) -> None:
        """Let an image of each camera arrive, and flush."""
        now_s = self.clock.now()
        unit = encode_unit(VideoUnit("avc1.42", True, 64, 48, now_s - late_s, b"K"))
        samples = [Sample("front", b"jpeg", now_s - late_s), Sample("film", unit, now_s)]
        self.hub.publish(samples)
        self.fanout.videos.take(samples)

    def number(self) -> int:
        """Return the number in the next message to the page."""
        frame = self.fanout.next_picture(self.place)
        assert frame is not None
        message = frame[2:]
        layout = VIDEO_HEADER if message[0] == 2 else PICTURE_HEADER
        return int(layout.unpack_from(message)[5])


@pytest.mark.parametrize("name", ["front", "film"])
async def test_what_a_page_gets_is_remembered_with_its_age(name: str) -> None:
    """An image, and an access unit: by the number that its message says, and by no other."""
    seen = Seen()
    seen.fanout.show(seen.place, [name])
    seen.arrives(late_s=0.2)
    assert seen.images.age_s(name, SeenImage(1, 0.0), seen.clock.now()) == float("inf"), (
        "not sent yet"
    )
    number = seen.number()
    await seen.clock.advance(0.1)
    assert seen.images.age_s(name, SeenImage(number, 0.0), seen.clock.now()) == pytest.approx(0.3)
    assert seen.images.age_s(name, SeenImage(number + 1, 0.0), seen.clock.now()) == float("inf")


def test_units_do_not_count_any_more_when_a_page_gets_images_in_their_place() -> None:
    seen = Seen()
    seen.fanout.show(seen.place, ["film"])
    seen.arrives()
    number = seen.number()
    seen.fanout.show(seen.place, ["film", "front"])
    assert seen.images.age_s("film", SeenImage(number, 0.0), seen.clock.now()) == 0
    seen.fanout.stills.show = lambda page, names: None  # type: ignore[method-assign]
    seen.fanout.show(seen.place, ["film"], stills=["film"])
    assert seen.images.age_s("film", SeenImage(number, 0.0), seen.clock.now()) == float("inf")
