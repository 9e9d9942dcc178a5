"""Commands of pages that take long: their time limit, and what all pages are told of motion."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.unit.web.test_client import FakeLine
from tests.unit.web.test_consent import Screens
from urc.model.driver import Command, Reply
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.values import Reading
from urc.protocol.events import Replied
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.fleet.robots import Robot, RobotService

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
