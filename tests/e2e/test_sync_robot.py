"""The synchronous face of both openings, in a thread of its own, as a script uses it."""

import threading
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import get_args

import pytest

from tests.e2e.open_robots import STOPPED, Cart, Opening, carted, served_robot
from urc.client import AccessDenied, CommandFailed, MotionEnded, sync
from urc.client.loop_thread import LoopThread
from urc.client.robot import RobotInterface
from urc.client.sync import SyncRobot
from urc.problems import UrcError
from urc.testing.entry import KEY

pytestmark = pytest.mark.alone

WAIT_S = 30.0
LATE_S = 0.25
WRONG = "a-wrong-token"
Pair = tuple[Cart, SyncRobot]


@pytest.fixture(autouse=True)
def _own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No latch of this machine's user, and no running server, takes part."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


@asynccontextmanager
async def place(opening: str, folder: Path) -> AsyncIterator[tuple[Cart, str]]:
    """Run a cart, and a server if the opening needs one; give the cart and its place."""
    async with carted(folder) as (cart, file):
        if opening == "here":
            yield cart, str(file)
        else:
            async with served_robot(file) as address:
                yield cart, address


@pytest.fixture(params=get_args(Opening))
def pair(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Pair]:
    """Return a cart, and the robot of a program without ``async``."""
    robots = LoopThread(WAIT_S)
    try:
        with robots.entered(lambda: place(request.param, tmp_path)) as (cart, where):
            opening = (
                sync.connect(where) if request.param == "here" else sync.open(where, token=KEY)
            )
            with opening as robot:
                until(lambda: cart.has_line)
                said(robots, cart, "note hello")
                robot.wait_for("note", timeout=WAIT_S)
                cart.say = lambda *lines: said(robots, cart, *lines)  # type: ignore[method-assign]
                yield cart, robot
    finally:
        robots.close()


def said(robots: LoopThread, cart: Cart, *lines: str) -> None:
    """Let the cart say something, in its own thread."""
    robots.loop.call_soon_threadsafe(Cart.say, cart, *lines)


def until(is_true: object) -> None:
    """Wait for something on the robot's side."""
    ends_s = time.monotonic() + WAIT_S
    while not is_true():  # type: ignore[operator]
        assert time.monotonic() < ends_s, "it did not come true"
        time.sleep(0.005)


def test_the_face_has_the_whole_interface() -> None:
    """What the interface has and the face lacks, a script would miss."""
    names = {name for name in vars(RobotInterface) if not name.startswith("_")}
    assert names <= set(dir(SyncRobot))


def test_readings_and_commands(pair: Pair) -> None:
    """Plain calls, with the values of the robot."""
    cart, robot = pair
    assert (robot.name, robot.controls, robot.state("wire")) == ("cart", ("drive",), "live")
    assert robot.latest("level") is None
    cart.say("level 4")
    assert robot.wait_for("level", timeout=10).value == 4
    assert robot.command("ask") == {"level": 7}
    with pytest.raises(CommandFailed) as told:
        robot.command("nix")
    assert told.value.code == "unknown-command"
    assert list(robot.links) == ["wire"]
    with pytest.raises(UrcError, match="unknown signal 'nix'"):
        robot.latest("nix")


def test_a_stream_ends_with_its_loop(pair: Pair) -> None:
    """And a silent robot does not hold up the script for ever."""
    cart, robot = pair
    cart.say("level 1")
    seen = []
    for sample in robot.watch("level", timeout=10):
        seen.append(sample.value)
        cart.say(f"level {sample.value + 1}")
        if len(seen) == 5:
            break
    assert seen == [1, 2, 3, 4, 5]
    with pytest.raises(TimeoutError):
        list(robot.watch("odometer", timeout=0.1))
    with pytest.raises(TimeoutError):
        robot.wait_for("odometer", timeout=0.1)
    assert robot.command("ask") == {"level": 7}, "a time-out spoils nothing"


def test_a_failed_expectation_leaves_no_stream_behind(pair: Pair) -> None:
    """A stream that was begun and dropped does not stop the closing."""
    _, robot = pair
    watching = robot.watch("note", timeout=10)
    next(watching)
    del watching


@pytest.mark.usefixtures("calm")
def test_the_stick_moves_the_robot_and_leaving_stops_it(pair: Pair) -> None:
    """As in the asynchronous face."""
    cart, robot = pair
    with robot.drive(valid_s=1.0) as stick:
        stick.hold(0.4, speed=0.5)
        assert cart.newest("V") == "V 0.5 0"
        left_s = time.monotonic()
    until(lambda: cart.newest("V") == STOPPED)
    assert cart.stopped_s() - left_s < LATE_S


def test_a_script_that_hangs_stops_the_robot(pair: Pair) -> None:
    """The loop of the client runs on, and must not drive on for the script."""
    cart, robot = pair
    with (  # noqa: PT012 - the end of the block raises
        pytest.raises(MotionEnded, match="the stick was not called"),
        robot.drive() as stick,
    ):
        stick(speed=0.5)
        set_s = time.monotonic()
        time.sleep(1.0)
        assert cart.newest("V") == STOPPED
        assert cart.stopped_s() - set_s < 0.25 + LATE_S
        stick(speed=0.5)


@pytest.mark.usefixtures("calm")
def test_an_error_in_the_block_stops_the_robot(pair: Pair) -> None:
    """It passes unchanged."""
    cart, robot = pair
    with (  # noqa: PT012 - the block raises
        pytest.raises(ZeroDivisionError),
        robot.drive(valid_s=1.0) as stick,
    ):
        stick.hold(0.2, speed=0.5)
        raised_s = time.monotonic()
        raise ZeroDivisionError
    until(lambda: not cart.is_moving)
    assert cart.stopped_s() - raised_s < LATE_S


@pytest.mark.usefixtures("calm")
def test_a_released_stick_moves_again(pair: Pair) -> None:
    """From any thread."""
    cart, robot = pair
    with robot.drive(valid_s=1.0) as stick:
        stick.hold(0.1, speed=0.5)
        stick.release()
        until(lambda: not cart.is_moving)
        driving = threading.Thread(target=stick.hold, args=(0.4,), kwargs={"speed": 0.25})
        driving.start()
        until(lambda: cart.newest("V") == "V 0.25 0")
        driving.join()


@pytest.mark.usefixtures("calm")
def test_stop_and_reset(pair: Pair) -> None:
    """Nothing moves in between."""
    _, robot = pair
    assert robot.stop() is True
    assert robot.latched_by
    with pytest.raises(MotionEnded, match="Stopped by"), robot.drive():
        pytest.fail("it opened")
    robot.reset()
    assert robot.latched_by == ""
    with robot.drive(valid_s=1.0) as stick:
        stick.hold(0.2, speed=0.5)


def test_a_failure_to_open_leaves_no_thread_behind(tmp_path: Path) -> None:
    """A script may try again and again."""
    robots = LoopThread(WAIT_S)
    before = threading.active_count()
    with robots.entered(lambda: place("server", tmp_path)) as (_, address):
        for _ in range(3):
            with pytest.raises(AccessDenied), sync.open(address, token=WRONG):
                pytest.fail("it opened")
    robots.close()
    until(lambda: threading.active_count() <= before)
