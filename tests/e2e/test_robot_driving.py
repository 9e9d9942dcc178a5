"""Driving by a program: the same dialogues in this process and by a server.

Every test runs against both openings of a robot, and measures when the robot stops.
"""

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import get_args

import pytest

from tests.e2e.open_robots import LIFT, STOPPED, Cart, Opening, opened, until
from urc.client import CommandFailed, MotionEnded
from urc.client.robot import RobotInterface
from urc.client.stick import VALID_S
from urc.problems import UrcError

pytestmark = [pytest.mark.anyio, pytest.mark.alone]

LATE_S = 0.25
"""How much later than promised a robot may stop on a busy machine with two cores."""


@pytest.fixture(autouse=True)
def _own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No latch of this machine's user, and no running server, takes part."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


@pytest.fixture(params=get_args(Opening))
async def pair(
    request: pytest.FixtureRequest, tmp_path: Path
) -> AsyncIterator[tuple[Cart, RobotInterface]]:
    """Return a cart, and the robot of a program."""
    async with opened(request.param, tmp_path) as both:
        yield both


Pair = tuple[Cart, RobotInterface]


@pytest.mark.usefixtures("calm")
async def test_the_stick_moves_the_robot_and_leaving_stops_it(pair: Pair) -> None:
    """At once, and the controls are free again."""
    cart, robot = pair
    async with robot.drive(valid_s=1.0) as stick:
        assert robot.operator
        stick(speed=0.5)
        await until(lambda: cart.newest("V") == "V 0.5 0")
        stick(speed=0.25, turn=-1)
        await until(lambda: cart.newest("V") == "V 0.25 -1")
        left_s = time.monotonic()
    await until(lambda: cart.newest("V") == STOPPED)
    assert cart.stopped_s() - left_s < LATE_S
    await until(lambda: robot.operator == "")


@pytest.mark.usefixtures("calm")
async def test_new_input_is_not_held_back(pair: Pair) -> None:
    """A change leaves at once, not with the next tick of unchanged input."""
    cart, robot = pair
    late_s = []
    async with robot.drive(valid_s=1.0) as stick:
        for number in range(1, 11):
            stick(speed=number / 20)
            set_s = time.monotonic()
            await until(lambda: cart.newest("V") == f"V {number / 20:g} 0")  # noqa: B023
            late_s.append(cart.heard[-1][0] - set_s)
    # The robot's own rate limit is 50 ms.
    assert sorted(late_s)[len(late_s) // 2] < 0.075


@pytest.mark.usefixtures("calm")
async def test_a_hold_renews_the_input_while_it_is_awaited(pair: Pair) -> None:
    """No gap, and no stop before the time is over."""
    cart, robot = pair
    async with robot.drive(valid_s=1.0) as stick:
        await stick.hold(0.8, speed=0.5)
    frames = [(at, line) for at, line in cart.heard if line.startswith("V")]
    moves = [at for at, line in frames if line == "V 0.5 0"]
    assert moves[-1] - moves[0] > 0.6
    lines = [line for _, line in frames]
    assert set(lines[: lines.index(STOPPED)]) == {"V 0.5 0"}
    assert set(lines[lines.index(STOPPED) :]) == {STOPPED}


async def test_a_program_that_renews_nothing_stops_the_robot(pair: Pair) -> None:
    """And hears of it at its next word to the stick."""
    cart, robot = pair
    with pytest.raises(MotionEnded, match="the stick was not called for 250 ms"):  # noqa: PT012 - the end of the context raises
        async with robot.drive() as stick:
            stick(speed=0.5)
            set_s = time.monotonic()
            await until(lambda: cart.is_moving)
            await until(lambda: not cart.is_moving)
            assert VALID_S - 0.06 < cart.stopped_s() - set_s < VALID_S + LATE_S
            count = len(cart.lines)
            stick(speed=0.5)
    assert "V 0.5 0" not in cart.lines[count:], "what it says afterwards moves nothing"


async def test_an_early_end_that_nobody_noticed_is_raised_at_the_end(pair: Pair) -> None:
    """The program must not believe that the robot drove on."""
    _, robot = pair
    with pytest.raises(MotionEnded, match="the stick was not called"):  # noqa: PT012 - the end of the context raises
        async with robot.drive(valid_s=0.05) as stick:
            stick(speed=0.5)
            await asyncio.sleep(0.3)


@pytest.mark.usefixtures("calm")
async def test_an_error_in_the_block_stops_the_robot(pair: Pair) -> None:
    """The error passes unchanged."""
    cart, robot = pair
    with pytest.raises(ZeroDivisionError):  # noqa: PT012 - the end of the context raises
        async with robot.drive(valid_s=1.0) as stick:
            stick(speed=0.5)
            await until(lambda: cart.is_moving)
            raised_s = time.monotonic()
            raise ZeroDivisionError
    await until(lambda: not cart.is_moving)
    assert cart.stopped_s() - raised_s < LATE_S


@pytest.mark.usefixtures("calm")
async def test_a_cancelled_task_stops_the_robot(pair: Pair) -> None:
    """However long it wanted to drive."""
    cart, robot = pair

    async def drive() -> None:
        async with robot.drive(valid_s=1.0) as stick:
            await stick.hold(60, speed=0.5)

    driving = asyncio.create_task(drive())
    await until(lambda: cart.is_moving)
    cancelled_s = time.monotonic()
    driving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await driving
    await until(lambda: not cart.is_moving)
    assert cart.stopped_s() - cancelled_s < LATE_S


async def test_a_blocked_loop_stops_the_robot_and_ends_the_motion(pair: Pair) -> None:
    """Ticks are sampled input: none can leave while the program does something else."""
    _, robot = pair
    with pytest.raises(MotionEnded, match=r"was blocked for|no call"):  # noqa: PT012 - the end of the context raises
        async with robot.drive(valid_s=1.0) as stick:
            await stick.hold(0.2, speed=0.5)
            time.sleep(0.6)  # noqa: ASYNC251 - the fault
            await stick.hold(0.5, speed=0.5)


@pytest.mark.usefixtures("calm")
async def test_a_released_stick_moves_again(pair: Pair) -> None:
    """Its own release is no fault; the controls stay with the program."""
    cart, robot = pair
    async with robot.drive(valid_s=1.0) as stick:
        stick(speed=0.5)
        await until(lambda: cart.is_moving)
        stick.release()
        await until(lambda: not cart.is_moving)
        await asyncio.sleep(0.3)
        assert robot.operator
        stick(speed=0.25)
        await until(lambda: cart.newest("V") == "V 0.25 0")
    await until(lambda: not cart.is_moving)


async def test_a_block_without_input_moves_nothing(pair: Pair) -> None:
    """Not even by default values."""
    cart, robot = pair
    async with robot.drive():
        await asyncio.sleep(0.3)
    assert [line for line in cart.lines if line.startswith("V") and line != STOPPED] == []


async def test_wrong_arguments_end_the_motion(pair: Pair) -> None:
    """The message names the argument."""
    _, robot = pair
    with pytest.raises(MotionEnded, match="speed: 7"):
        async with robot.drive() as stick:
            await stick.hold(0.5, speed=7)


@pytest.mark.parametrize("valid_s", [0.01, 5.0])
async def test_validity_has_a_range(pair: Pair, valid_s: float) -> None:
    """Nothing may drive on for seconds by one word."""
    _, robot = pair
    with pytest.raises(UrcError, match=r"valid_s: expected 0.05 to 1 seconds"):
        async with robot.drive(valid_s=valid_s):
            pytest.fail("it opened")


async def test_an_unknown_control_is_refused(pair: Pair) -> None:
    """With the names that there are."""
    _, robot = pair
    with pytest.raises(UrcError, match="'ask' is not a held command; expected one of: drive"):
        async with robot.drive("ask"):
            pytest.fail("it opened")


async def test_a_second_stick_of_the_same_command_is_refused(pair: Pair) -> None:
    """One hand on one stick."""
    _, robot = pair
    async with robot.drive():
        with pytest.raises(UrcError, match="'drive' already has a stick"):
            async with robot.drive():
                pytest.fail("it opened")


@pytest.mark.usefixtures("calm")
@pytest.mark.parametrize("opening", get_args(Opening))
async def test_two_sticks_share_the_controls(opening: Opening, tmp_path: Path) -> None:
    """One of them may end without the other; the name is needed."""
    async with opened(opening, tmp_path, LIFT) as (cart, robot):
        with pytest.raises(UrcError, match="several held commands; name one of: drive, lift"):
            async with robot.drive():
                pytest.fail("it opened")
        async with robot.drive("drive", valid_s=1.0) as stick:
            stick(speed=0.5)
            async with robot.drive("lift", valid_s=1.0) as lever:
                for _ in range(6):
                    stick(speed=0.5)
                    lever(rate=1)
                    await asyncio.sleep(0.05)
                await until(lambda: cart.newest("L") == "L 1")
            for _ in range(6):
                stick(speed=0.5)
                await asyncio.sleep(0.05)
            assert cart.newest("L") == "L 0"
            assert cart.newest("V") == "V 0.5 0"
        await until(lambda: not cart.is_moving)


# -- STOP


@pytest.mark.usefixtures("calm")
async def test_stop_ends_the_motion_and_latches(pair: Pair) -> None:
    """Whoever holds the stick; nothing moves before a reset."""
    cart, robot = pair
    with pytest.raises(MotionEnded, match="stopped by"):  # noqa: PT012 - the end of the context raises
        async with robot.drive(valid_s=1.0) as stick:
            stick(speed=0.5)
            await until(lambda: cart.is_moving)
            pressed_s = time.monotonic()
            assert await robot.stop() is True
            assert cart.stopped_s() - pressed_s < LATE_S
            await stick.hold(0.5, speed=0.5)
    assert robot.latched_by
    with pytest.raises(MotionEnded, match="Stopped by"):
        async with robot.drive():
            pytest.fail("it opened")
    with pytest.raises(CommandFailed, match="Stopped by"):
        await robot.command("fold")
    assert "fold" not in cart.lines
    await robot.reset()
    assert robot.latched_by == ""
    await robot.command("fold")
    async with robot.drive(valid_s=1.0) as stick:
        stick(speed=0.5)
        await until(lambda: cart.is_moving)


async def test_a_reset_without_a_stop_does_nothing(pair: Pair) -> None:
    """It is no error to be ready."""
    _, robot = pair
    await robot.reset()
    assert robot.latched_by == ""


async def test_a_cut_line_ends_the_motion(pair: Pair) -> None:
    """The robot gets its stop first when it is back, and the stick stays without effect."""
    cart, robot = pair
    with pytest.raises(MotionEnded):  # noqa: PT012 - the end of the context raises
        async with robot.drive() as stick:
            stick(speed=0.5)
            await until(lambda: cart.is_moving)
            count = len(cart.lines)
            cart.cut()
            await stick.hold(3, speed=0.5)
    await until(lambda: len(cart.lines) > count and cart.newest("V") == STOPPED)
    later = [line for line in cart.lines[count:] if line.startswith("V")]
    assert later[-1] == STOPPED
