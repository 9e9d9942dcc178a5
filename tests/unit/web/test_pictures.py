"""Images to those who show them: the newest, encoded once, and nothing that waits."""

import asyncio
import json
import struct

import pytest

from tests.unit.web.test_client import FakeLine
from tests.unit.web.test_fanout import values_in
from urc.images import media_type
from urc.model.interface import WidgetUse
from urc.model.values import Sample, Signal
from urc.runtime.hub import Hub
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.feed.fanout import Fanout, Place
from urc.web.feed.image_cache import SHARED_FOR_S, ImageCache, ImageSubscription
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import BrowserClient
from urc.web.show.demos import colour_bars
from urc.web.wire import messages as wire
from urc.web.wire.picture import as_frame, encode_picture
from urc.wire.client_messages import ImageSelection

pytestmark = pytest.mark.anyio

USE = WidgetUse("cam", "camera", {"image": "cam"})
JPEG = b"\xff\xd8\xff\xe0 and so on"


def robot() -> tuple[Hub, ImageCache, FakeClock]:
    """Return a hub with two cameras and a number, and its shelf."""
    clock = FakeClock()
    hub = Hub(
        {"a": Signal("a"), "left": Signal("left", "image"), "right": Signal("right", "image")}
    )
    return hub, ImageCache(hub, clock), clock


def looking_at(*names: str) -> ImageSubscription:
    """Return a client that shows these."""
    subscription = ImageSubscription()
    subscription.show(names)
    return subscription


def header(index: int, age_ms: int, now_ms: int) -> bytes:
    """Return what the message of a picture begins with."""
    return encode_picture(index, JPEG, 2**32 + 7, age_ms, now_ms)[: -len(JPEG)]


def test_a_picture_says_its_signal_age_time_and_type() -> None:
    """The header is the one that the page reads."""
    message = header(513, 40, 1234)
    kind, length, index, age_ms, now_ms, number = struct.unpack(">BBHIdI", message[:20])
    assert (kind, index, age_ms, now_ms, number) == (1, 513, 40, 1234, 7)
    assert message[20 : 20 + length] == b"image/jpeg"
    assert len(message) == 20 + length
    assert struct.unpack(">I", header(0, -5, 0)[4:8]) == (0,)
    assert struct.unpack(">I", header(0, 1 << 40, 0)[4:8]) == (2**32 - 1,)


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (JPEG, "image/jpeg"),
        (colour_bars(2, 2), "image/png"),
        (b"GIF89a", "image/gif"),
        (b"RIFF\0\0\0\0WEBPVP8 ", "image/webp"),
        (b"\0\0\0\x1cftypavif", "image/avif"),
        (b"RIFF\0\0\0\0WAVE", "application/octet-stream"),
        (b"<svg onload=alert(1)>", "application/octet-stream"),
        (b"", "application/octet-stream"),
    ],
)
def test_a_type_is_told_by_how_the_bytes_begin(data: bytes, kind: str) -> None:
    """Never by what a robot says, and never one that can run."""
    assert media_type(data) == kind


@pytest.mark.parametrize("size", [0, 125, 126, 65535, 65536])
def test_a_frame_has_the_length_that_the_protocol_wants(size: int) -> None:
    """RFC 6455, 5.2: seven bits, two bytes, or eight; final, binary, not masked."""
    frame = as_frame(b"x" * size)
    assert frame[0] == 0x82
    if size < 126:
        assert (frame[1], len(frame)) == (size, size + 2)
    elif size < 1 << 16:
        assert (frame[1], int.from_bytes(frame[2:4]), len(frame)) == (126, size, size + 4)
    else:
        assert (frame[1], int.from_bytes(frame[2:10]), len(frame)) == (127, size, size + 10)


def test_who_was_away_gets_the_newest_and_no_other() -> None:
    """Three came, one is sent; then there is nothing until the next."""
    hub, cache, clock = robot()
    subscription = looking_at("left")
    for data in (b"one", b"two", b"three"):
        hub.publish([Sample("left", data, clock.now())])
    made = cache.next_image(subscription)
    assert made is not None
    assert made.frame.endswith(b"three")
    assert cache.next_image(subscription) is None
    hub.publish(
        [Sample("left", b"three", clock.now())]
    )  # the same bytes are news: they are younger
    assert cache.next_image(subscription) is not None


async def test_an_image_is_encoded_once_for_all_who_take_it_soon() -> None:
    """Later ones get its age of then."""
    hub, cache, clock = robot()
    hub.publish([Sample("left", JPEG, clock.now())])
    one, two = cache.next_image(looking_at("left")), cache.next_image(looking_at("left"))
    assert one is not None
    assert one is two
    await clock.advance(SHARED_FOR_S + 0.01)
    three = cache.next_image(looking_at("left"))
    assert three is not None
    assert three.number == one.number
    assert three.frame != one.frame


def test_two_cameras_take_turns_however_fast_one_is() -> None:
    """A client that can take one image at a time gets both."""
    hub, cache, clock = robot()
    subscription = looking_at("left", "right")
    order = []
    for _ in range(4):
        hub.publish([Sample("left", b"L", clock.now()), Sample("right", b"R", clock.now())])
        made = cache.next_image(subscription)
        assert made is not None
        order.append(made.sample.signal)
    assert order == ["left", "right", "left", "right"]


def test_nobody_gets_what_is_no_image_or_is_not_there() -> None:
    """Names come from a page: any text may be among them."""
    hub, cache, clock = robot()
    hub.publish([Sample("a", 1.0, clock.now()), Sample("right", None, clock.now())])
    assert cache.next_image(looking_at("a", "left", "right", "__proto__", "")) is None


def test_a_camera_that_is_shown_again_is_sent_again() -> None:
    """The page may have thrown its image away meanwhile."""
    hub, cache, clock = robot()
    hub.publish([Sample("left", JPEG, clock.now())])
    subscription = looking_at("left")
    assert cache.next_image(subscription) is not None
    subscription.show(())
    assert cache.next_image(subscription) is None
    subscription.show(("left",))
    assert cache.next_image(subscription) is not None


def test_images_are_no_part_of_the_frames_of_values() -> None:
    """Only that there is none any more is told to all."""
    clock = FakeClock()
    hub = Hub({"a": Signal("a"), "left": Signal("left", "image")})
    fanout = Fanout(hub, clock=clock)
    place = Place()
    hub.publish([Sample("a", 1.0, clock.now()), Sample("left", JPEG, clock.now())])
    fanout.flush()
    (frame,) = values_in(fanout.frames_for(place))
    assert frame["i"] == [0]
    hub.publish([Sample("left", None, clock.now())])
    fanout.flush()
    (frame,) = values_in(fanout.frames_for(place))
    assert (frame["i"], frame["v"]) == ([1], [None])


async def test_a_slow_line_drops_images_and_costs_nobody_else_any() -> None:
    """One client takes nothing: it gets the newest when it can, the other gets them all."""
    clock = FakeClock()
    profile = dashboard_profile(signals={"cam": Signal("cam", "image")}, uses=[USE])
    robot = FakeRobot(profile, clock)
    service = RobotService(Robot(profile, {}, robot.open), clock=clock)
    running = asyncio.create_task(service.run())
    quick, slow = FakeLine(), FakeLine()
    tasks = [
        asyncio.create_task(BrowserClient(line, service, line).serve()) for line in (quick, slow)
    ]
    try:
        await settle()
        for line in (quick, slow):
            line.say({"t": "show", "signals": ["cam"]})
        await settle()
        slow.free.clear()
        for number in range(20):
            robot.set_reading("cam", b"image %d." % number)
            await clock.advance(0.05)
        got = [frame[frame.rindex(b"image ") :] for frame in quick.frames]
        assert got == [b"image %d." % number for number in range(20)]
        before = len(slow.frames)
        slow.free.set()
        await settle()
        assert len(slow.frames) - before == 1
        assert slow.frames[-1].endswith(b"image 19.")
        # Shown no more: nothing comes, and the values go on.
        quick.say({"t": "show", "signals": []})
        await settle()
        robot.set_reading("cam", b"image 20.")
        await clock.advance(0.05)
        assert len(quick.frames) == 20
    finally:
        for line in (quick, slow):
            line.leave()
        await settle()
        for task in (running, *tasks):
            task.cancel()
        await settle()


def test_a_page_may_ask_for_so_many_images_and_no_more() -> None:
    """What it says is bounded, like all that comes from outside."""
    names = [f"s{number}" for number in range(64)]
    assert wire.decode(json.dumps({"t": "show", "signals": names})) == ImageSelection(tuple(names))
    for bad in ([*names, "one more"], ["x" * 257], "left", [1]):
        with pytest.raises(wire.BadMessage):
            wire.decode(json.dumps({"t": "show", "signals": bad}))
