"""Commands of pages that take long: their time limit, and what all pages are told of motion."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.unit.web.test_client import FakeLine
from tests.unit.web.test_consent import Screens
from urc.model.driver import Argument, Command, Reply
from urc.model.payload import Envelope, ReadSpec, WriteSpec
from urc.model.role import Role
from urc.model.sequence import WaitStep
from urc.model.values import Reading
from urc.protocol.events import Replied
from urc.runtime.command_failed import CommandFailed
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.transports.base import GoalRecord
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import BrowserClient

pytestmark = pytest.mark.anyio

LONG = Reply(ReadSpec("regex", {"pattern": "done"}), timeout_s=60)
COMMANDS = {
    "beep": Command("beep", "wire", WriteSpec("text")),
    "route": Command(
        "route",
        "wire",
        WriteSpec("text"),
        {"xs": Argument("xs", "array"), "word": Argument("word", "string")},
        moves=True,
        reply=LONG,
    ),
    "end": Command(
        "end",
        "wire",
        WriteSpec("envelope", {"verb": "cancel", "attributes": {"action": "/follow"}}),
        stops=True,
    ),
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
        return [check for check in self.late if check is not None][-1]()


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

        def limit(self) -> str:
            return ""

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
        roles = [operator.client.role for operator in service.controls.operators]
        assert roles == ["drive"] * 3, "the engine asks, so nothing may happen meanwhile"
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


class Rover(Slow):
    """A ROS robot: each route ends as the test says, and the end of the route is a cancellation."""

    def __init__(self) -> None:
        super().__init__()
        self.payloads = {
            "route": Envelope("goal", {"action": "/follow"}, {}),
            "end": Envelope("cancel", {"action": "/follow"}),
        }
        self.ways: list[asyncio.Future[None]] = []

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        """Reply to a route at its end, and to anything else at once."""
        reply = await FakeRobot.command(self, name, arguments, **more)
        if name == "route":
            self.ways.append(asyncio.get_running_loop().create_future())
            await self.ways[-1]
        return reply


@asynccontextmanager
async def driven() -> AsyncIterator[tuple[Rover, RobotService, Screens]]:
    robot = Rover()
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=robot.fake)
    running = asyncio.create_task(service.run())
    screens = Screens(service, robot, robot.fake)
    try:
        yield robot, service, screens
    finally:
        await screens.end()
        running.cancel()
        await settle()


async def goals(robot: Slow, line: FakeLine) -> list[dict[str, Any]]:
    """Return the goals that a page knows."""
    await settle()
    await robot.fake.advance(1)  # to the next flush
    told: list[dict[str, Any]] = [{}, *line.of_type("progress")][-1].get("goals", [])
    return told


ROUTE = {"t": "run", "id": 2, "command": "route", "arguments": {"xs": [1, 2], "word": "private"}}


async def test_a_page_that_is_opened_later_gets_the_running_route_with_its_sender_and_points() -> (
    None
):
    async with driven() as (robot, _, screens):
        first = await screens.come()
        assert await goals(robot, first) == []
        first.say(ROUTE)
        await settle()
        await robot.fake.advance(5)
        later = await screens.come()
        (goal,) = await goals(robot, later)
        you = first.of_type("lease")[-1]["you"]
        assert (goal["command"], goal["by"], goal["page"]) == ("route", "screen 1", you)
        assert goal["places"] == {"xs": [1, 2]}
        assert 5000 <= goal["since"] <= 7000
        assert not goal.get("lost")
        robot.ways[0].set_result(None)
        assert await goals(robot, later) == await goals(robot, first) == []


async def test_a_route_outlives_a_reload_of_its_page_until_its_reply() -> None:
    async with driven() as (robot, _, screens):
        first, other = await screens.come(), await screens.come()
        first.say(ROUTE)
        await settle()
        first.leave()
        assert len(await goals(robot, other)) == 1
        again = await screens.come()
        assert len(await goals(robot, again)) == 1
        robot.ways[0].set_exception(CommandFailed("refused", "the action was cancelled"))
        assert await goals(robot, again) == []


@pytest.mark.parametrize("end", ["cancel", "stop"])
async def test_a_route_with_an_unknown_outcome_stays_until_another_page_ends_it(end: str) -> None:
    async with driven() as (robot, service, screens):
        first, other = await screens.come(), await screens.come()
        first.say(ROUTE)
        await settle()
        robot.ways[0].set_exception(CommandFailed("disconnected", "the connection is lost"))
        (goal,) = await goals(robot, other)
        assert goal["lost"]
        assert other.of_type("progress")[-1]["moving"] == ["route"], "Escape is STOP"
        if end == "cancel":
            other.say({"t": "run", "id": 7, "command": "end"})
        else:
            other.say({"t": "stop"})
        await settle()
        robot.goals.changed("wire", GoalRecord((), ("/follow",)))
        assert len(await goals(robot, other)) == 1, "the robot has not answered"
        robot.goals.changed("wire", GoalRecord())
        await robot.fake.advance(1)
        assert end == "cancel" or service.controls.controller.is_certain
        assert await goals(robot, other) == []


async def test_a_cancellation_that_a_newer_goal_ends_does_not_end_a_lost_route() -> None:
    async with driven() as (robot, _, screens):
        line = await screens.come()
        line.say(ROUTE)
        await settle()
        robot.ways[0].set_exception(CommandFailed("disconnected", "the connection is lost"))
        line.say({"t": "run", "id": 7, "command": "end"})
        await settle()
        robot.goals.changed("wire", GoalRecord(owed=("/follow",)))
        await robot.fake.advance(1)
        robot.goals.changed("wire", GoalRecord(dropped=("/follow",)))
        await robot.fake.advance(1)
        assert [one["lost"] for one in await goals(robot, line)] == [True]


async def test_a_session_without_pages_follows_a_route_to_its_end() -> None:
    async with driven() as (robot, service, screens):
        first = await screens.come()
        first.say(ROUTE)
        await settle()
        first.leave()
        await settle()
        await robot.fake.advance(100)
        assert robot.is_open
        (goal,) = await goals(robot, await screens.come())
        assert not goal.get("lost")
        await screens.end()
        await robot.fake.advance(100)
        robot.ways[0].set_result(None)
        await robot.fake.advance(10)
        assert not robot.is_open
        assert service.is_at_rest
        assert await goals(robot, await screens.come()) == []


async def test_a_lost_route_outlives_its_session_until_a_person_dismisses_it() -> None:
    """A page that is opened later must see it, and a newer goal does not hide it."""
    async with driven() as (robot, service, screens):
        first = await screens.come()
        first.say(ROUTE)
        await settle()
        robot.ways[0].set_exception(CommandFailed("disconnected", "the connection is lost"))
        await settle()
        first.leave()
        await settle()
        await robot.fake.advance(100)
        assert not robot.is_open
        assert not service.is_at_rest
        later, watcher = await screens.come(), await screens.come("watch")
        (goal,) = await goals(robot, later)
        assert goal["lost"]
        later.say({**ROUTE, "id": 3})
        assert [one.get("lost", False) for one in await goals(robot, later)] == [True, False]
        watcher.say({"t": "dismiss", "goal": goal["number"]})
        assert len(await goals(robot, later)) == 2
        later.say({"t": "dismiss", "goal": goal["number"]})
        assert [one.get("lost", False) for one in await goals(robot, later)] == [False]
        robot.ways[1].set_result(None)


async def test_a_route_whose_session_must_end_is_lost() -> None:
    """The robot's document has changed, for example. The next session gets no reply."""
    async with driven() as (robot, service, screens):
        first = await screens.come()
        first.say(ROUTE)
        await settle()
        service.replace(Robot(robot.profile, {}, robot.open))
        await settle()
        assert robot.ways[0].cancelled()
        (goal,) = await goals(robot, await screens.come())
        assert goal["lost"]


class Tourist(Slow):
    """A ROS robot with a sequence that sends two goals and then loses its connection."""

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        """Report the goals of the sequence, as the engine does."""
        on_goal = more.pop("on_goal")
        await FakeRobot.command(self, name, arguments, **more)
        if on_goal is not None:
            for action, is_over in (("/undock", False), ("/undock", True), ("/follow", False)):
                on_goal(action, is_over)
        await self.done.wait()
        raise CommandFailed("disconnected", "the connection is lost")


async def test_a_sequence_whose_connection_is_lost_stays_with_its_goal() -> None:
    robot = Tourist()
    tour = Command(
        "tour", "wire", WriteSpec("text"), steps=(WaitStep(1),), moves=True, title="Tour"
    )
    profile = dashboard_profile(commands={**COMMANDS, "tour": tour})
    robot.profile = profile
    service = RobotService(Robot(profile, {}, robot.open), clock=robot.fake)
    running = asyncio.create_task(service.run())
    screens = Screens(service, robot, robot.fake)
    line = await screens.come()
    line.say({"t": "run", "id": 2, "command": "tour"})
    await settle()
    robot.done.set()
    (goal,) = await goals(robot, line)
    assert (goal["command"], goal["title"], goal["lost"]) == ("tour", "Tour", True)
    (kept,) = robot.hub.goals
    assert kept.actions == ("/follow",)
    await screens.end()
    running.cancel()
    await settle()


async def test_two_operators_one_drives_and_the_other_may_stop_and_cancel() -> None:
    """A new goal needs that nobody else has the controls; an end of a goal does not."""
    async with driven() as (robot, service, screens):
        first, second = await screens.come(), await screens.come()
        watcher = await screens.come("watch")
        first.say({"t": "drive", "verb": "take"})
        first.say(ROUTE)
        second.say({**ROUTE, "id": 3})
        watcher.say({"t": "run", "id": 4, "command": "end"})
        await settle()
        assert [one["message"] for one in second.of_type("reply")] == ["screen 1 has the controls"]
        assert [one["message"] for one in watcher.of_type("reply")] == ["this page only watches"]
        assert len(robot.ways) == 1
        second.say({"t": "run", "id": 5, "command": "end"})
        await settle()
        assert [one["ok"] for one in second.of_type("reply")] == [False, True]
        assert [name for name, _ in robot.commands] == ["route", "end"]
        second.say({"t": "stop"})
        await settle()
        assert service.controls.controller.lease.state.latched_by == "screen 2"
        assert [name for name, _ in robot.commands][-1] == "end"
        first.say({**ROUTE, "id": 6})
        await settle()
        assert "Stopped by screen 2" in first.of_type("reply")[-1]["message"]
        assert len(robot.ways) == 1
