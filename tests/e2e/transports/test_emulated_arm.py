"""The emulated arm with ros2_control: held and let go, lost while it moves, and sent to goals."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

import urc
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.test_rosbridge_goals import cable, until, value
from urc.client.local import ConnectedRobot
from urc.client.stick import MotionEnded
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session
from urc.runtime.settings import resolve_settings
from urc.simulator.server import serve as serve_robot

pytestmark = pytest.mark.anyio

ROBOT = Path(__file__).resolve().parents[3] / "robots" / "ur-ros2.yaml"
FAR = {"positions": [3.0, -1.57, 1.57, -1.57, -1.57, 0.0], "seconds": 60}
WAIT_S = 60.0


def joints(session: Session) -> tuple[float, ...]:
    found = value(session, "q")
    assert isinstance(found, tuple)
    return found


async def rested(session: Session) -> bool:
    """Return whether no joint moves for a second."""
    await asyncio.sleep(0.5)
    before = joints(session)
    await asyncio.sleep(1.0)
    return joints(session) == pytest.approx(before, abs=1e-6)


async def hold_and_cut(robot: ConnectedRobot, cut: Callable[[], None]) -> None:
    """Hold the stick, and cut the connection while it is held."""
    async with robot.drive("jog") as stick:
        await stick.hold(0.5, x=-0.05)
        cut()
        await stick.hold(WAIT_S, x=-0.05)


async def test_the_tool_moves_while_it_is_held_and_never_after_a_lost_connection() -> None:
    profile = load_profile(ROBOT, built_in_catalog())
    usual, _ = resolve_settings(profile, {})
    async with (
        nothing_left(),
        serve_robot(profile, {**usual, "port": 0}) as listening,
        cable(listening["ros"].port) as (near, cut),
        urc.connect(urc.load(ROBOT), port=near) as robot,
    ):
        session = robot.session
        await until(session, lambda: value(session, "mode") == "goals")
        await session.command("tool_mode", {})
        await until(session, lambda: value(session, "mode") == "jog")
        start = value(session, "tool_x")
        assert isinstance(start, float)
        async with robot.drive("jog") as stick:
            await stick.hold(1.0, x=0.05)
        assert await rested(session)
        moved = value(session, "tool_x")
        assert isinstance(moved, float)
        assert 0.02 < moved - start < 0.08

        with pytest.raises(MotionEnded):
            await hold_and_cut(robot, cut)
        await until(session, lambda: session.hub.links["ros"].state == "live")
        assert await rested(session), "the arm moves without a held stick"


async def test_stop_ends_a_goal_even_after_a_lost_connection() -> None:
    profile = load_profile(ROBOT, built_in_catalog())
    usual, _ = resolve_settings(profile, {})
    async with (
        nothing_left(),
        serve_robot(profile, {**usual, "port": 0}) as listening,
        cable(listening["ros"].port) as (near, cut),
    ):
        settings = {**usual, "host": "127.0.0.1", "port": near}
        async with Session(profile, settings, built_in_catalog().transports) as session:
            await until(session, lambda: value(session, "mode") == "goals")
            await until(session, lambda: value(session, "q") is not None)
            near_goal = [*joints(session)[:5], 0.3]
            await session.command("move", {"positions": near_goal, "seconds": 2})
            assert joints(session) == pytest.approx(near_goal, abs=0.01)

            on_its_way = asyncio.create_task(session.command("move", FAR))
            await until(session, lambda: joints(session)[0] > 0.12)
            cut()
            with pytest.raises(CommandFailed):
                await on_its_way
            await until(session, lambda: session.hub.links["ros"].state == "live")
            assert not await rested(session), "the arm drives on without a connection"
            async with asyncio.timeout(WAIT_S):
                while True:  # as STOP does, until the command has been sent
                    with suppress(CommandFailed):
                        await session.command("cancel", {})
                        break
                    await asyncio.sleep(0.1)
            assert await rested(session)
            assert joints(session)[0] < 2.0

            session.latch("STOP was pressed")
            with pytest.raises(CommandFailed, match="STOP was pressed"):
                await session.command("move", FAR)
            assert await rested(session)
