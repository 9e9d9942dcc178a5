"""A program that drives and dies, freezes or is interrupted: the robot stops in time, every time.

And a server that ends, comes back, or no longer knows the program: no motion resumes by itself.
"""

import asyncio
import os
import signal
import sys
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, closing, suppress
from pathlib import Path

import pytest

import urc.client
from tests.e2e.open_robots import STOPPED, Cart, carted, served_robot, until
from tests.e2e.ports import free_port
from urc.access.control import AccessControl
from urc.access.grants import parse_grant
from urc.access.store import AccessStore
from urc.client import AccessDenied, CommandFailed, ConnectionLost, MotionEnded, remote_motion
from urc.testing.entry import KEY
from urc.web.serve.access import Access

pytestmark = [pytest.mark.anyio, pytest.mark.alone]

ROOT = Path(__file__).resolve().parents[2]
LEASE_S = 0.25
LATE_S = 0.25
"""Delay of a machine with two cores, beyond the lease."""


@pytest.fixture(autouse=True)
def _own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No latch of this machine's user, and no running server, takes part."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


@asynccontextmanager
async def program_driving(
    opening: str, folder: Path
) -> AsyncIterator[tuple[Cart, asyncio.subprocess.Process]]:
    """Let another process drive a cart; give both."""
    async with AsyncExitStack() as stack:
        cart, file = await stack.enter_async_context(carted(folder, lease="250ms"))
        place = str(file)
        if opening != "here":
            place = await stack.enter_async_context(served_robot(file))
        program = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "tests.e2e.program",
            opening,
            place,
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            assert program.stdout is not None
            assert await program.stdout.readline() == b"driving\n"
            await until(lambda: cart.is_moving)
            await asyncio.sleep(0.3)
            yield cart, program
        finally:
            with suppress(ProcessLookupError):
                program.kill()
            await program.communicate()
            if opening != "here":
                # The robot has no client any more; its guard ends before the server does.
                await until(lambda: not cart.has_line)
                await asyncio.sleep(0.3)


@pytest.mark.parametrize("opening", ["here", "server", "sync"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
async def test_a_program_that_dies_or_freezes_stops_the_robot(
    opening: str, number: signal.Signals, tmp_path: Path
) -> None:
    """Nothing has to be sent: the lease of the motion ends."""
    async with program_driving(opening, tmp_path) as (cart, program):
        sent_s = time.monotonic()
        program.send_signal(number)
        await until(lambda: not cart.is_moving)
        assert cart.stopped_s() - sent_s < LEASE_S + LATE_S
        if number == signal.SIGSTOP:
            count = len(cart.lines)
            await asyncio.sleep(0.5)
            program.send_signal(signal.SIGCONT)
            assert await program.wait() != 0
            assert b"MotionEnded" in (await program.communicate())[1]
            assert set(cart.lines[count:]) <= {STOPPED}, "what it held moves nothing afterwards"


@pytest.mark.parametrize("opening", ["here", "server", "sync"])
async def test_ctrl_c_stops_the_robot(opening: str, tmp_path: Path) -> None:
    """At once, by a release."""
    async with program_driving(opening, tmp_path) as (cart, program):
        sent_s = time.monotonic()
        program.send_signal(signal.SIGINT)
        await until(lambda: not cart.is_moving)
        assert cart.stopped_s() - sent_s < LATE_S
        assert await program.wait() != 0
        assert b"KeyboardInterrupt" in (await program.communicate())[1]


# -- the server


@pytest.mark.usefixtures("calm")
async def test_a_server_that_restarts_resumes_no_motion(tmp_path: Path) -> None:
    """The values come back by themselves; the stick stays without effect."""
    async with carted(tmp_path) as (cart, file), AsyncExitStack() as outer:
        server = AsyncExitStack()
        address = await server.enter_async_context(served_robot(file))
        port = int(address.rpartition(":")[2])
        robot = await outer.enter_async_context(urc.client.open(address, token=KEY))
        lines = robot.log()

        async def drive() -> None:
            async with robot.drive(valid_s=1.0) as stick:
                await stick.hold(30, speed=0.5)

        task = asyncio.create_task(drive())
        await until(lambda: cart.is_moving)
        await server.aclose()
        with pytest.raises(MotionEnded, match=r"lost|withdrawn"):
            await task
        await until(lambda: not cart.is_moving)
        assert not robot.is_connected
        with pytest.raises(CommandFailed) as told:
            await robot.command("ask")
        assert told.value.code == "disconnected"
        with pytest.raises(MotionEnded, match="connection to the server was lost"):
            async with robot.drive():
                pytest.fail("it opened")
        count = len(cart.lines)
        await outer.enter_async_context(served_robot(file, port=port))
        await until(lambda: robot.is_connected)
        await asyncio.sleep(0.5)
        assert [
            line for line in cart.lines[count:] if line.startswith("V") and line != STOPPED
        ] == []
        await until(lambda: cart.has_line)
        cart.say("level 77")
        await robot.wait_for("level", lambda value: value == 77, timeout=10)
        async with robot.drive(valid_s=1.0) as stick:
            stick(speed=0.25)
            await until(lambda: cart.newest("V") == "V 0.25 0")
        async with asyncio.timeout(5):
            texts = [(await anext(lines)).text for _ in range(2)]
        assert any("connection was lost" in text for text in texts)


@pytest.mark.usefixtures("calm")
async def test_a_robot_that_has_said_nothing_is_driven_without_a_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its connection is open: drive() waits for a connection, not for a word of the robot."""
    monkeypatch.setattr(remote_motion, "_CONNECT_S", 3600.0)
    async with (
        carted(tmp_path) as (cart, file),
        served_robot(file) as address,
        urc.client.open(address, token=KEY) as robot,
        asyncio.timeout(30),
        robot.drive(valid_s=1.0) as stick,
    ):
        await stick.hold(0.5, speed=0.5)
        assert cart.newest("V") == "V 0.5 0"


async def test_the_transports_are_known_from_the_start(tmp_path: Path) -> None:
    """A recording makes its topics from them."""
    async with carted(tmp_path) as (_, file), served_robot(file) as address:
        for _ in range(5):
            async with urc.client.open(address, token=KEY) as robot:
                assert list(robot.links) == ["wire"]


async def test_a_wrong_token_is_told_at_once(tmp_path: Path) -> None:
    """And no token at all."""
    async with carted(tmp_path) as (_, file), served_robot(file) as address:
        for token in ("a-wrong-token", ""):
            with pytest.raises(AccessDenied):
                async with urc.client.open(address, token=token):
                    pytest.fail("it opened")


async def test_a_server_that_forgets_the_token_ends_everything(tmp_path: Path) -> None:
    """A stream that can never go on must not wait for ever."""
    async with carted(tmp_path) as (_, file):
        server = AsyncExitStack()
        address = await server.enter_async_context(served_robot(file))
        port = int(address.rpartition(":")[2])
        async with urc.client.open(address, token=KEY) as robot:
            watching = asyncio.create_task(robot.wait_for("level", lambda value: value == 1000))
            await server.aclose()
            other = Access(key="another-start-key", instance="test")
            async with served_robot(file, port=port, access=other):
                with pytest.raises(AccessDenied):
                    await watching
                with pytest.raises(AccessDenied):
                    await robot.command("ask")


REVOKED_S = 0.3
"""Time within which a revocation must stop the robot."""


@pytest.mark.usefixtures("calm")
@pytest.mark.parametrize("ended", ["token", "program", "role"])
async def test_a_right_that_ends_stops_the_robot(ended: str, tmp_path: Path) -> None:
    """A program that lost its role may still watch; without its token it is shut out."""
    with closing(AccessStore(tmp_path / "access")) as store:
        control = AccessControl(store, key=KEY)
        added = store.add("program", "a driver", [parse_grant("drive")], now=control.now())
        sign_in, token = store.open_sign_in(added.id, "token", now=control.now())
        control.load()
        access = Access(control, instance="test")
        async with (
            carted(tmp_path) as (cart, file),
            served_robot(file, access=access) as address,
            urc.client.open(address, token=token) as robot,
        ):

            async def drive() -> None:
                async with robot.drive(valid_s=1.0) as stick:
                    await stick.hold(30, speed=0.5)

            driving = asyncio.create_task(drive())
            await until(lambda: cart.is_moving)
            assert "a driver" in robot.operator
            ended_s = time.monotonic()
            if ended == "token":
                await control.end_sign_in(sign_in.id)
            elif ended == "program":
                store.remove(added.id)
                await control.reload()
            else:
                store.set_grants(added.id, [parse_grant("watch")])
                await control.reload()
            await until(lambda: not cart.is_moving)
            assert cart.stopped_s() - ended_s < REVOKED_S
            with pytest.raises(MotionEnded):
                await driving
            if ended == "role":
                cart.say("level 3")
                await robot.wait_for("level", lambda value: value == 3, timeout=10)
                with pytest.raises((CommandFailed, MotionEnded)):
                    async with robot.drive():
                        pytest.fail("it opened")
            else:
                with pytest.raises(AccessDenied):
                    await robot.wait_for("level", lambda value: value == 1000, timeout=10)


async def test_a_robot_that_is_not_served_is_told(tmp_path: Path) -> None:
    """By the server's words."""
    async with carted(tmp_path) as (_, file), served_robot(file) as address:
        with pytest.raises(ConnectionLost, match="this server has no robot with that name"):
            async with urc.client.open(address, "nix", token=KEY):
                pytest.fail("it opened")


async def test_a_server_that_is_not_there_is_told() -> None:
    """With the address."""
    address = f"http://127.0.0.1:{free_port()}"
    with pytest.raises(ConnectionLost, match=f"cannot reach {address}"):
        async with urc.client.open(address):
            pytest.fail("it opened")


async def test_stop_reaches_a_server_whose_socket_is_silent(tmp_path: Path) -> None:
    """By HTTP, within a second."""
    async with (
        carted(tmp_path) as (cart, file),
        served_robot(file) as address,
        urc.client.open(address, token=KEY) as robot,
    ):
        await until(lambda: cart.has_line)
        cart.say("level 1")
        await robot.wait_for("level")
        robot.motion._socket.send = lambda message: True  # type: ignore[method-assign]
        assert await robot.stop() is True
        await until(lambda: robot.latched_by != "")
        assert STOPPED in cart.lines


@pytest.mark.usefixtures("calm")
async def test_a_program_that_has_the_controls_keeps_them(tmp_path: Path) -> None:
    """The second program is told who drives; its STOP ends the motion of the first."""
    async with (
        carted(tmp_path) as (cart, file),
        served_robot(file) as address,
        urc.client.open(address, token=KEY) as first,
        urc.client.open(address, token=KEY) as second,
    ):

        async def drive() -> None:
            async with first.drive(valid_s=1.0) as stick:
                await stick.hold(30, speed=0.5)

        driving = asyncio.create_task(drive())
        await until(lambda: cart.is_moving)
        with pytest.raises(MotionEnded, match="has the controls"):
            async with second.drive():
                pytest.fail("it opened")
        assert second.operator == first.operator != ""
        assert await second.stop() is True
        with pytest.raises(MotionEnded, match="stopped by"):
            await driving
        assert not cart.is_moving
        await first.reset()
        await until(lambda: second.latched_by == "")
