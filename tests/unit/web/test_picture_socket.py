"""The socket for images: joined with a key, in confirmed parts, and gone with its page."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.unit.web.test_client import FakeLine
from urc.model.values import Sample, Signal
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.feed.client_socket import SocketPeer
from urc.web.feed.picture_line import CONFIRM, LAST
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import BrowserClient
from urc.web.picture_socket import CLOSE_NO_PAGE, CLOSE_NOT_TAKEN, KEY_WITHIN_S, PictureSocket
from urc.wire.picture import read_picture

pytestmark = pytest.mark.anyio

JPEG = b"\xff\xd8\xff"


class Reader:
    """A page's end of a socket for images."""

    def __init__(self, service: RobotService) -> None:
        self.line = FakeLine()
        self.received = 0
        self._taken = 0
        self._message = b""
        socket = PictureSocket(self.line, service.picture_pages, service.clock, self.line)
        self.task = asyncio.create_task(socket.serve())

    def read(self) -> list[bytes]:
        """Return the images that have arrived, and confirm what the server asks for."""
        images = []
        while self._taken < len(self.line.frames):
            part = self.line.frames[self._taken]
            self._taken += 1
            self.received += len(part)
            self._message += part[1:]
            if part[0] & LAST:
                message = read_picture(self._message)
                assert message is not None
                images.append(message.data)
                self._message = b""
            if part[0] & CONFIRM:
                assert self.line.sink(str(self.received).encode())
        return images

    @property
    def is_asked(self) -> bool:
        """Whether a part that has arrived must be confirmed."""
        return any(part[0] & CONFIRM for part in self.line.frames[self._taken :])


class Stage:
    """A page that shows the image `cam`."""

    def __init__(self, service: RobotService, robot: FakeRobot, clock: FakeClock) -> None:
        self.service, self.robot, self.clock = service, robot, clock
        self.line = FakeLine()
        self.client = BrowserClient(self.line, service, self.line, SocketPeer())
        self.task = asyncio.create_task(self.client.serve())

    @property
    def key(self) -> str:
        return str(self.line.of_type("hello")[0]["pictures"])

    async def show(self, **more: Any) -> None:
        self.line.say({"t": "show", "signals": ["cam"], **more})
        await settle()

    async def join(self) -> Reader:
        reader = Reader(self.service)
        reader.line.say({"t": "pictures", "key": self.key})
        await settle()
        return reader

    async def takes(self, image: bytes) -> None:
        """Let the camera take an image."""
        self.robot.hub.publish([Sample("cam", JPEG + image, self.clock.now())])
        await self.clock.advance(0.02)
        await settle()


@asynccontextmanager
async def stage() -> AsyncIterator[Stage]:
    clock = FakeClock()
    profile = dashboard_profile(signals={"cam": Signal("cam", "image")}, uses=[])
    robot = FakeRobot(profile, clock)
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=clock)
    running = asyncio.create_task(service.run())
    made = Stage(service, robot, clock)
    await settle()
    try:
        yield made
    finally:
        made.line.leave()
        await settle()
        running.cancel()
        made.task.cancel()
        await settle()


async def test_images_come_over_the_socket_for_images_only() -> None:
    async with stage() as it:
        await it.show(apart=True)
        await it.takes(b"early")
        assert it.line.frames == [], "the main socket never carries images of such a page"
        reader = await it.join()
        assert reader.read() == [JPEG + b"early"]
        await it.takes(b"next")
        assert reader.read() == [JPEG + b"next"]
        assert it.line.frames == []


async def test_a_program_without_the_socket_gets_images_over_its_only_one() -> None:
    async with stage() as it:
        await it.show()
        await it.takes(b"one")
        assert len(it.line.frames) == 1


async def test_nothing_more_is_sent_than_the_page_confirms_and_the_newest_image_wins() -> None:
    async with stage() as it:
        await it.show(apart=True)
        reader = await it.join()
        await it.takes(b"x" * 50_000)
        sent = sum(map(len, reader.line.frames))
        assert reader.is_asked
        assert sent < 10_000
        for number in range(5):
            await it.takes(b"%d" % number)
        assert sum(map(len, reader.line.frames)) == sent
        images: list[bytes] = []
        for _ in range(100):
            images += reader.read()
        assert images == [JPEG + b"x" * 50_000, JPEG + b"4"]


async def test_a_full_socket_is_used_again_as_soon_as_it_is_free() -> None:
    async with stage() as it:
        await it.show(apart=True)
        reader = await it.join()
        reader.line.free.clear()
        await it.takes(b"one")
        assert reader.line.frames == []
        reader.line.free.set()
        reader.line.freed()
        assert reader.read() == [JPEG + b"one"]


async def test_a_new_socket_gets_the_image_again() -> None:
    async with stage() as it:
        await it.show(apart=True)
        first = await it.join()
        await it.takes(b"one")
        second = await it.join()
        assert first.line.was_aborted
        assert second.read() == [JPEG + b"one"]
        first.line.leave()
        await settle()
        await it.takes(b"two")
        assert second.read() == [JPEG + b"two"], "the end of the first one changes nothing"


async def test_the_socket_ends_with_its_page() -> None:
    async with stage() as it:
        await it.show(apart=True)
        reader, key = await it.join(), it.key
        it.line.leave()
        await settle()
        assert reader.line.was_aborted
        late = Reader(it.service)
        late.line.say({"t": "pictures", "key": key})
        await settle()
        assert late.line.closed == (CLOSE_NO_PAGE, "no open page has this key")


@pytest.mark.parametrize("said", ["{", '{"t":"pictures","key":"guess"}', '{"t":"spare","key":"x"}'])
async def test_a_socket_without_a_key_is_closed(said: str) -> None:
    async with stage() as it:
        reader = Reader(it.service)
        reader.line.say(said)
        await settle()
        assert reader.line.closed == (CLOSE_NO_PAGE, "no open page has this key")


async def test_a_socket_that_says_nothing_is_closed() -> None:
    async with stage() as it:
        reader = Reader(it.service)
        await settle()
        await it.clock.advance(KEY_WITHIN_S)
        await settle()
        assert reader.line.closed == (CLOSE_NO_PAGE, "no open page has this key")


@pytest.mark.parametrize("said", ["1", "-1", "1e3", "9" * 40, '{"t":"stop"}'])
async def test_only_true_confirmations_are_taken(said: str) -> None:
    async with stage() as it:
        await it.show(apart=True)
        reader = await it.join()
        await it.takes(b"x" * 50_000)
        reader.line.say(said)
        await settle()
        assert reader.line.closed == (CLOSE_NOT_TAKEN, "only confirmations may use this socket")
