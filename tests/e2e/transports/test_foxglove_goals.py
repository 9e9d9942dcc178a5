"""Goals over the server of the Foxglove SDK: routes, STOP, and goals that outlive a connection."""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import urc
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from tests.e2e.transports.peers.foxglove_action import (
    ABORTED,
    REJECTED,
    UNKNOWN,
    RouteAction,
)
from tests.e2e.transports.test_rosbridge_goals import cable
from urc.client import CommandFailed
from urc.client.local import ConnectedRobot

pytestmark = pytest.mark.anyio

ROBOT = Path(__file__).resolve().parents[3] / "robots" / "generic-ros2.yaml"
WAIT_S = 30.0
ROUTE = {"xs": [1.5, 2.0], "ys": [-2.0, 0.5], "yaws": [0.0, math.pi / 2]}
ALL = "0" * 32


@pytest.fixture
def rover() -> Iterator[FoxgloveRobot]:
    robot = FoxgloveRobot()
    yield robot
    robot.close()


@asynccontextmanager
async def acting(
    rover: FoxgloveRobot, *, is_flat: bool = True
) -> AsyncIterator[tuple[RouteAction, ConnectedRobot]]:
    action = RouteAction(rover, is_flat=is_flat)
    try:
        async with connected(rover.port) as robot:
            yield action, robot
    finally:
        action.end_all()


@asynccontextmanager
async def connected(port: int) -> AsyncIterator[ConnectedRobot]:
    async with urc.connect(urc.load(ROBOT), port=port, bridge="foxglove", navigation=True) as robot:
        await until(lambda: robot.session.hub.links["ros"].is_ready)
        yield robot


async def until(is_so: Callable[[], Any], repeat: Callable[[], Any] = lambda: None) -> None:
    async with asyncio.timeout(WAIT_S):
        while not is_so():
            repeat()
            await asyncio.sleep(0.05)


async def started(action: RouteAction, robot: ConnectedRobot) -> "asyncio.Task[Any]":
    """Send a route; return once the robot follows it."""
    count = len(action.goals)
    task = asyncio.create_task(robot.command("follow", **ROUTE))
    await until(lambda: len(action.goals) > count or task.done())
    assert not task.done(), await asyncio.gather(task, return_exceptions=True)
    return task


@pytest.mark.parametrize("is_flat", [True, False])
async def test_a_route_its_progress_and_its_result(rover: FoxgloveRobot, is_flat: bool) -> None:
    async with acting(rover, is_flat=is_flat) as (action, robot):
        following = await started(action, robot)
        (goal,) = action.goals.values()
        places = [(one.pose.position.x, one.pose.position.y) for one in goal.request.poses]
        assert places == [(1.5, -2.0), (2.0, 0.5)]
        assert [one.header.frame_id for one in goal.request.poses] == ["map", "map"]
        turn = goal.request.poses[1].pose.orientation
        assert (turn.z, turn.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
        assert goal.request.number_of_loops == 0

        def waypoint() -> object:
            found = robot.latest("waypoint")
            return None if found is None else found.value

        await until(lambda: waypoint() == 1, lambda: action.publish_feedback(1))
        assert not following.done()
        action.finish(*action.running)
        await following


async def test_a_route_that_fails_says_why(rover: FoxgloveRobot) -> None:
    async with acting(rover) as (action, robot):
        following = await started(action, robot)
        action.finish(*action.running, status=ABORTED)
        with pytest.raises(CommandFailed, match="the action was aborted"):
            await following
        action.missed = [1]
        following = await started(action, robot)
        action.finish(*action.running)
        with pytest.raises(CommandFailed, match="not reached: 1 waypoints"):
            await following
        action.accepts = False
        with pytest.raises(CommandFailed, match="the action was rejected"):
            await robot.command("follow", **ROUTE)
        # Nothing is left to cancel; all goals of the action are cancelled, as always.
        await robot.command("stop_route")
        await until(lambda: action.cancels)
        assert action.cancels == [(ALL, UNKNOWN)]


async def test_stop_cancels_the_route_and_those_of_other_programs(rover: FoxgloveRobot) -> None:
    async with acting(rover) as (action, robot):
        following = await started(action, robot)
        async with connected(rover.port) as other:
            foreign = await started(action, other)
            await robot.command("stop_route")
            for one in (following, foreign):
                with pytest.raises(CommandFailed, match="the action was cancelled"):
                    await one
            assert action.running == []


@pytest.mark.parametrize("in_outage", [False, True])
async def test_stop_ends_a_route_that_outlived_its_connection(
    rover: FoxgloveRobot, in_outage: bool
) -> None:
    action = RouteAction(rover)
    try:
        async with cable(rover.port) as (near, cut), connected(near) as robot:
            following = await started(action, robot)
            cut()
            with pytest.raises(CommandFailed):
                await following
            links = robot.session.hub.links
            if not in_outage:
                await until(lambda: links["ros"].is_ready)
                await asyncio.sleep(0.5)
                assert action.running, "a reconnection alone must not end the route"
            async with asyncio.timeout(WAIT_S):
                while True:  # as STOP does, until the command has been sent
                    with suppress(CommandFailed):
                        await robot.command("stop_route")
                        break
                    await asyncio.sleep(0.1)
            await until(lambda: not action.running)
    finally:
        action.end_all()


async def test_a_lost_cancellation_is_sent_again_on_the_next_connection(
    rover: FoxgloveRobot,
) -> None:
    """The connection freezes, accepts the cancellation, and then breaks."""
    action = RouteAction(rover)
    lost = asyncio.Event()
    try:
        async with cable(rover.port, lost) as (near, cut), connected(near) as robot:
            following = await started(action, robot)
            (goal,) = action.running
            await asyncio.sleep(0.3)
            lost.set()
            await robot.command("stop_route")
            await asyncio.sleep(0.3)
            assert action.cancels == []
            lost.clear()
            cut()
            with pytest.raises(CommandFailed):
                await following
            await until(lambda: len(action.cancels) == 2)
            assert {one for one, _ in action.cancels} == {ALL, goal}
            assert action.running == []
    finally:
        action.end_all()


@pytest.mark.parametrize("is_reopened", [False, True])
async def test_a_goal_that_a_frozen_bridge_delivers_after_stop_is_ended(
    rover: FoxgloveRobot, is_reopened: bool
) -> None:
    """The goal and the cancellation wait in the frozen connection, which may then break."""
    action = RouteAction(rover)
    flows = asyncio.Event()
    flows.set()
    try:
        async with cable(rover.port, flows=flows) as (near, cut), connected(near) as robot:
            first = await started(action, robot)  # the types of the action are known from now on
            action.finish(*action.running)
            await first
            flows.clear()
            following = asyncio.create_task(robot.command("follow", **ROUTE))
            await asyncio.sleep(0.5)
            await robot.command("stop_route")
            await asyncio.sleep(0.5)
            assert (len(action.goals), action.cancels) == (1, [])
            if is_reopened:
                cut()
            flows.set()
            with pytest.raises(CommandFailed):
                await following
            await asyncio.sleep(2.5)
            assert action.running == []
    finally:
        action.end_all()


async def test_stop_ends_goals_of_an_action_that_appears_long_after_it(
    rover: FoxgloveRobot,
) -> None:
    """STOP comes first. The bridge finds the action seconds later; another program drives."""
    async with connected(rover.port) as robot:
        await robot.command("stop_route")
        await asyncio.sleep(2.5)
        action = RouteAction(rover)
        try:
            await until(lambda: action.cancels)
            assert action.cancels == [(ALL, UNKNOWN)]
            await asyncio.sleep(1.5)
            assert len(action.cancels) == 1, "an answered cancellation is not repeated"
        finally:
            action.end_all()


async def test_a_refused_cancellation_is_repeated_until_the_robot_ends_the_route(
    rover: FoxgloveRobot,
) -> None:
    async with acting(rover) as (action, robot):
        following = await started(action, robot)
        action.refuses = True
        since = robot.session.goals.number
        await robot.command("stop_route")
        await until(lambda: len(action.cancels) >= 4)
        assert {code for _, code in action.cancels} == {REJECTED}
        assert action.running
        assert robot.session.goals.answer("ros", "/follow_waypoints", since) == "owed"
        action.refuses = False
        with pytest.raises(CommandFailed, match="the action was cancelled"):
            await following
        answer = partial(robot.session.goals.answer, "ros", "/follow_waypoints", since)
        await until(lambda: answer() == "answered")


async def test_stop_is_unconfirmed_while_a_goal_of_another_program_goes_on(
    rover: FoxgloveRobot,
) -> None:
    """The robot answers the cancellation with success, but it follows the goal."""
    async with acting(rover) as (action, robot), connected(rover.port) as other:
        foreign = await started(action, other)
        action.hides = True
        since = robot.session.goals.number
        await robot.command("stop_route")
        answer = partial(robot.session.goals.answer, "ros", "/follow_waypoints", since)
        await until(lambda: len(action.cancels) >= 2)
        assert action.running
        assert answer() == "owed"
        action.finish(*action.running, status=ABORTED)
        await until(lambda: answer() == "answered")
        with pytest.raises(CommandFailed, match="the action was aborted"):
            await foreign


async def test_a_goal_whose_call_fails_is_not_refused(rover: FoxgloveRobot) -> None:
    """The robot follows the goal, but the bridge reports a failure of the call."""
    async with acting(rover) as (action, robot):
        action.breaks = True
        with pytest.raises(CommandFailed) as caught:
            await robot.command("follow", **ROUTE)
        assert caught.value.code == "timed-out"
        assert action.running
        await robot.command("stop_route")
        await until(lambda: not action.running)


async def test_a_bridge_without_hidden_services_is_named(rover: FoxgloveRobot) -> None:
    async with connected(rover.port) as robot:
        with pytest.raises(CommandFailed, match="start it with include_hidden: true"):
            await robot.command("follow", **ROUTE)
        await robot.command("stop_route")  # STOP must not fail for it


async def test_an_action_that_does_not_exist_is_named(rover: FoxgloveRobot) -> None:
    async with acting(rover) as (_, robot):
        await until(lambda: rover.port)
        with pytest.raises(CommandFailed, match="there is no action /navigate_to_pose"):
            await robot.command("navigate", to_x=1.0, to_y=1.0)


async def test_no_route_starts_while_stop_is_latched(rover: FoxgloveRobot) -> None:
    async with acting(rover) as (action, robot):
        robot.session.latch("STOP was pressed")
        with pytest.raises(CommandFailed, match="STOP was pressed"):
            await robot.command("follow", **ROUTE)
        robot.session.latch("")
        following = await started(action, robot)
        action.finish(*action.running)
        await following
        assert len(action.goals) == 1
