"""Commands of pages that take long: their time limit, and what all pages are told of motion."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.unit.web.test_client import FakeLine
from tests.unit.web.test_consent import Screens
from urc.model.driver import Command, Reply
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.role import Role
from urc.model.values import Reading
from urc.protocol.events import Replied
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import BrowserClient

pytestmark = pytest.mark.anyio

LONG = Reply(ReadSpec("regex", {"pattern": "done"}), timeout_s=60)
COMMANDS = {
    "beep": Command("beep", "wire", WriteSpec("text")),
    "route": Command("route", "wire", WriteSpec("text"), moves=True, reply=LONG),
}


class Slow(FakeRobot):
    """Its commands take as long as the test says."""

    def __init__(self) -> None:
        self.fake = FakeClock()
        super().__init__(dashboard_profile(commands=COMMANDS), self.fake)
        self.done = asyncio.Event()

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        """Reply once the test says so."""
        reply = await super().command(name, arguments, **more)
        await self.done.wait()
        return reply


@asynccontextmanager
async def looked_at() -> AsyncIterator[tuple[Slow, FakeLine, FakeLine]]:
    """Serve a slow robot on two screens."""
    robot = Slow()
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=robot.fake)
    running = asyncio.create_task(service.run())
    screens = Screens(service, robot, robot.fake)
    try:
        yield robot, await screens.come(), await screens.come()
    finally:
        await screens.end()
        running.cancel()
        await settle()


async def test_a_page_waits_for_as_long_as_the_driver_declares(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A route of Nav2 takes longer than the usual limit, and has not failed then."""
    monkeypatch.setattr("urc.web.drive.command_runner.COMMAND_TIMEOUT_S", 0.05)
    async with looked_at() as (robot, line, _):
        line.say({"t": "run", "id": 2, "command": "route"})
        await asyncio.sleep(0.3)
        assert line.of_type("reply") == []
        robot.done.set()
        await settle()
        assert [one["ok"] for one in line.of_type("reply")] == [True]


async def test_every_page_is_told_of_a_command_that_moves_the_robot_until_its_reply() -> None:
    async with looked_at() as (robot, line, other):
        line.say({"t": "run", "id": 1, "command": "beep"})
        line.say({"t": "run", "id": 2, "command": "route"})
        await settle()
        assert other.of_type("progress")[-1]["moving"] == ["route"]
        robot.done.set()
        await settle()
        await robot.fake.advance(1)  # to the next flush
        assert other.of_type("progress")[-1]["moving"] == []


class Queueing(Slow):
    """Its commands wait in a queue until the test lets them go, as in the engine."""

    def __init__(self) -> None:
        super().__init__()
        self.late: list[Callable[[], str] | None] = []

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        """Keep the check that the engine makes before it sends the command."""
        self.late.append(more.get("unless"))
        return await super().command(name, arguments, **more)

    def why_not(self) -> str:
        """Return what the engine's check now says of the last command."""
        check = self.late[-1]
        assert check is not None
        return check()


@asynccontextmanager
async def queued() -> AsyncIterator[tuple[Queueing, RobotService, FakeLine, FakeLine]]:
    """Serve a robot on two screens; the first has sent a route, which waits in the queue."""
    robot = Queueing()
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=robot.fake)
    running = asyncio.create_task(service.run())
    screens = Screens(service, robot, robot.fake)
    first, second = await screens.come(), await screens.come()
    first.say({"t": "run", "id": 2, "command": "route"})
    await settle()
    try:
        yield robot, service, first, second
    finally:
        await screens.end()
        running.cancel()
        await settle()


async def test_motion_that_waits_is_not_started_once_another_screen_has_the_controls() -> None:
    async with queued() as (robot, _, _, second):
        assert robot.why_not() == ""
        second.say({"t": "drive", "verb": "take"})
        await settle()
        assert robot.why_not() == "screen 2 has the controls"


async def test_motion_that_waits_is_not_started_after_a_stop_even_after_its_reset() -> None:
    async with queued() as (robot, _, _, second):
        second.say({"t": "stop"})
        await settle()
        assert robot.why_not() == "Stopped by screen 2. Reset to drive again."
        second.say({"t": "drive", "verb": "reset"})
        await settle()
        assert robot.why_not() == "STOP was pressed meanwhile: send it again"


async def test_motion_that_waits_is_not_started_once_its_sender_may_only_watch() -> None:
    class Rights:
        now: Role = "drive"

        def role(self) -> Role:
            return self.now

        def may_give(self, command: str) -> bool:
            return True

    rights = Rights()
    async with queued() as (robot, service, _, _):
        line = FakeLine()
        peer = SocketPeer(rights=rights)
        serving = asyncio.create_task(BrowserClient(line, service, line, peer).serve())
        await settle()
        line.say({"t": "run", "id": 3, "command": "route"})
        await settle()
        assert robot.why_not() == ""
        rights.now = "watch"
        assert robot.why_not() == "this page only watches"
        line.leave()
        await settle()
        await serving


async def test_motion_that_waits_is_not_started_once_its_page_is_closed() -> None:
    async with queued() as (robot, _, first, _):
        first.leave()
        await settle()
        assert "no longer waits for its reply" in robot.why_not()


async def test_a_command_that_does_not_move_the_robot_is_not_checked_again() -> None:
    """A command that ends motion must never be held back."""
    async with queued() as (robot, _, first, _):
        first.say({"t": "run", "id": 4, "command": "beep"})
        await settle()
        assert robot.late[-1] is None
