"""Links over real sockets: robots that die, come back, misbehave, or were written by others."""

import asyncio
import contextlib
import os
import socket
import sys
import tracemalloc
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest

from tests.e2e.hostile import HOSTILE, closes, drips, good, robot_on
from tests.e2e.ports import free_port
from urc.model.driver import Backoff, Timeouts
from urc.model.profile import Profile
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session
from urc.simulator.server import serve
from urc.testing.profile import line_profile
from urc.transports.base import ConnectFailed, PeerClosed
from urc.transports.tcp import READ_AHEAD_BYTES, TcpTransport

pytestmark = pytest.mark.anyio

MEMORY_LIMIT = 4 * 1024 * 1024
"""Bytes that one hostile robot may make Python allocate, at most, at any time."""
QUICK = Timeouts(connect_s=2.0, reply_s=0.2)
"""For robots that do not answer."""
PATIENT = Timeouts(connect_s=10.0, reply_s=10.0)
"""For those that do, whatever holds this machine up."""
QUICKLY = Backoff(initial_s=0.05, max_s=0.2)
WAIT_S = 20.0


def quick_profile(
    *, is_per_request: bool = False, every_s: float | None = 0.1, timeouts: Timeouts = PATIENT
) -> Profile:
    return line_profile(
        is_per_request=is_per_request, every_s=every_s, timeouts=timeouts, backoff=QUICKLY
    )


@asynccontextmanager
async def connected(profile: Profile, port: int) -> AsyncIterator[Session]:
    settings = {"host": "127.0.0.1", "port": port}
    async with Session(profile, settings, built_in_catalog().transports) as session:
        yield session


async def until(session: Session, is_so: Callable[[], bool]) -> None:
    """Wait for the hub to be as told; fail when it does not get there."""
    with session.hub.subscribe() as subscription:
        async with asyncio.timeout(WAIT_S):
            while not is_so():
                subscription.changes()
                await subscription.changed()


async def answer(session: Session) -> object:
    """Return what the robot answers, which a busy machine may hold up for longer than it has."""
    async with asyncio.timeout(WAIT_S):
        while True:
            with contextlib.suppress(CommandFailed):
                return (await session.command("ask")).values
            await asyncio.sleep(0.05)


def has_failed(session: Session) -> bool:
    """Return whether anything went wrong on the line."""
    link = session.hub.links["wire"]
    return link.faults + link.attempts > 0


def state_of(session: Session) -> str:
    return session.hub.links["wire"].state


def open_files() -> int:
    return len(os.listdir("/proc/self/fd")) if sys.platform == "linux" else 0


@pytest.mark.parametrize("is_per_request", [False, True])
async def test_killed_robot_that_comes_back_is_read_again(is_per_request: bool) -> None:
    """Nobody does anything, many times over, and no socket is left behind."""
    async with robot_on(good) as robot:
        profile = quick_profile(is_per_request=is_per_request)
        async with connected(profile, robot.port) as session:
            await until(session, lambda: state_of(session) == "live")
            before = open_files()
            for _ in range(5):
                await robot.kill()
                await until(session, lambda: state_of(session) == "lost")
                assert "127.0.0.1" in session.hub.links["wire"].address
                await robot.start()
                await until(session, lambda: state_of(session) == "live")
            assert open_files() <= before + 1


@pytest.mark.parametrize("is_per_request", [False, True])
@pytest.mark.parametrize("name", HOSTILE)
async def test_hostile_robot_costs_bounded_memory_and_is_survived(
    name: str, is_per_request: bool
) -> None:
    """It is counted and shown; the loop stays alive, and the good robot after it is read."""
    profile = quick_profile(is_per_request=is_per_request, timeouts=QUICK)
    async with robot_on(HOSTILE[name]) as robot, connected(profile, robot.port) as session:
        tracemalloc.start()
        try:
            for _ in range(20):  # the loop turns all the while
                await asyncio.sleep(0.05)
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert state_of(session) != "live"
        await until(session, lambda: has_failed(session))
        assert peak < MEMORY_LIMIT
        assert len(session.hub.notes) < 60
        robot.behave = good
        await robot.kill()
        await robot.start()
        await until(session, lambda: state_of(session) == "live")
        assert await answer(session) == {"battery": 42}


async def test_hostile_robot_does_not_hold_up_a_good_one() -> None:
    """Two sessions in one loop: the flood of one leaves the other its turns."""
    profile = quick_profile()
    async with (
        robot_on(HOSTILE["tiny_frames"]) as bad,
        robot_on(good) as fine,
        connected(profile, bad.port) as flooded,
        connected(profile, fine.port) as calm,
    ):
        await until(calm, lambda: state_of(calm) == "live")
        await until(flooded, lambda: flooded.hub.links["wire"].faults > 100_000)
        for _ in range(10):
            assert (await calm.command("ask")).values == {"battery": 42}


async def test_robot_that_drips_is_understood() -> None:
    """A frame is a frame, in however many pieces it comes."""
    async with robot_on(drips) as robot, connected(quick_profile(), robot.port) as session:
        await until(session, lambda: session.hub.latest("battery") is not None)
        reading = session.hub.latest("battery")
        assert reading is not None
        assert reading.value == 77


async def test_robot_that_closes_at_once_is_called_ever_less() -> None:
    """Attempts are counted one by one, and told once."""
    async with robot_on(closes) as robot, connected(quick_profile(), robot.port) as session:
        await until(session, lambda: session.hub.links["wire"].attempts >= 5)
        assert session.hub.links["wire"].detail == "the robot closed the connection"
        assert len(session.hub.notes) < 5


async def test_command_to_a_dead_robot_fails_with_a_reason() -> None:
    """The operator reads why, within the time-outs."""
    async with robot_on(good) as robot:
        port = robot.port
    profile = quick_profile(is_per_request=True, every_s=None)
    async with connected(profile, port) as session:
        with pytest.raises(CommandFailed) as failed:
            await session.command("ask")
    assert failed.value.code == "disconnected"
    assert str(failed.value) == f"nothing listens on 127.0.0.1:{port} (connection refused)"


@pytest.mark.parametrize("is_per_request", [False, True])
async def test_emulated_robot_answers_a_session(is_per_request: bool) -> None:
    """Both ends out of one declaration: the number is the time's."""
    profile = quick_profile(is_per_request=is_per_request)
    settings = {"host": "127.0.0.1", "port": 0}
    async with (
        serve(profile, settings, now=lambda: 1_700_000_045.5) as listening,
        connected(profile, listening["wire"].port) as session,
    ):
        assert (await session.command("ask")).values == {"battery": 45}


@pytest.mark.needs("socat")
async def test_program_of_others_is_read_though_it_never_closes() -> None:
    """socat takes a connection, reads a line, answers a number, and keeps the line open."""
    port = free_port()
    process = await asyncio.create_subprocess_exec(
        "socat",
        f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork",
        "SYSTEM:read line; echo 42; sleep 60",
        start_new_session=True,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        async with connected(quick_profile(is_per_request=True), port) as session:
            await until(session, lambda: state_of(session) == "live")
            first = session.hub.latest("battery")
            await until(session, lambda: session.hub.latest("battery") != first)
            second = session.hub.latest("battery")
            assert first is not None
            assert second is not None
            assert (first.value, second.value) == (42, 42)
            assert session.hub.links["wire"].faults == 0
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, 15)
        await process.wait()


# -- the tcp transport by itself


async def test_flood_is_not_read_further_than_the_buffer() -> None:
    """While nobody takes it, the rest stays in the robot's own kernel."""
    sent = 0

    async def flood(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal sent
        while True:
            writer.write(b"x" * 65536)
            await writer.drain()
            sent += 65536

    async with robot_on(flood) as robot:
        line = TcpTransport("127.0.0.1", robot.port)
        await line.open(20.0)
        before, same = 0, 0
        while same < 5:  # until both kernels are full: nothing goes in several turns of the loop
            same = same + 1 if sent == before > 0 else 0
            before = sent
            await asyncio.sleep(0.05)
        data = await line.receive()
        assert len(data) == READ_AHEAD_BYTES
        await line.close()


async def test_send_waits_for_a_robot_that_does_not_read() -> None:
    """More than the kernel takes is waited for, and closing ends the wait."""
    async with robot_on(HOSTILE["deaf"]) as robot:
        line = TcpTransport("127.0.0.1", robot.port)
        await line.open(20.0)

        async def send_much() -> None:
            for _ in range(1000):
                await line.send(b"x" * 65536)

        sending = asyncio.create_task(send_much())
        await asyncio.sleep(0.3)
        assert not sending.done()
        await line.close()
        with pytest.raises(PeerClosed, match="the connection is closed"):
            await sending


async def test_bytes_before_the_end_are_received_before_the_end() -> None:
    """A robot that answers and closes has answered."""

    async def answers_and_closes(
        reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        writer.write(b"42\n")

    async with robot_on(answers_and_closes) as robot:
        line = TcpTransport("127.0.0.1", robot.port)
        await line.open(20.0)
        await asyncio.sleep(0.1)
        assert await line.receive() == b"42\n"
        for _ in range(2):
            with pytest.raises(PeerClosed, match=r"^the robot closed the connection$"):
                await line.receive()
        with pytest.raises(PeerClosed):
            await line.send(b"more")
        await line.close()
        await line.close()


async def test_failures_to_connect_are_one_line_each() -> None:
    """Whatever the system calls it, a person reads what to look at."""
    async with robot_on(good) as robot:
        port = robot.port
    cases = [
        ("127.0.0.1", f"nothing listens on 127.0.0.1:{port} (connection refused)"),
        ("no-such-host.invalid", "no such host 'no-such-host.invalid'"),
        ("x" * 70 + ".local", f"no such host {'x' * 70 + '.local'!r}"),
    ]
    for host, message in cases:
        with pytest.raises(ConnectFailed) as told:
            await TcpTransport(host, port).open(WAIT_S)
        assert str(told.value) == message


async def test_every_address_of_a_name_is_tried() -> None:
    """A name may lead to an IPv6 address first, where the robot does not listen."""
    async with robot_on(good) as robot:
        line = TcpTransport("localhost", robot.port)
        await line.open(20.0)
        await line.send(b"?\n")
        assert await line.receive() == b"42\n"
        await line.close()


async def test_robot_that_does_not_answer_the_call_is_given_up() -> None:
    """A full queue of a listener swallows further calls, as a firewall would."""
    with socket.socket() as listener, contextlib.ExitStack() as callers:
        listener.bind(("127.0.0.1", 0))
        listener.listen(0)
        port = listener.getsockname()[1]
        for _ in range(4):
            caller = callers.enter_context(socket.socket())
            caller.setblocking(False)
            caller.connect_ex(("127.0.0.1", port))
        await asyncio.sleep(0.05)
        line = TcpTransport("127.0.0.1", port)
        before = open_files()
        with pytest.raises(ConnectFailed) as told:
            await line.open(0.3)
        assert str(told.value) == f"no answer from 127.0.0.1:{port} within 0.3 s"
        opening = asyncio.create_task(line.open(60))
        await asyncio.sleep(0.05)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        assert open_files() == before


# -- the emulated robot's own door


async def converse(port: int, data: bytes, *, within_s: float = WAIT_S) -> bytes:
    """Say `data` and return all that is answered until the robot closes, or `within_s`."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    answer = b""
    with contextlib.suppress(TimeoutError, ConnectionError):
        writer.write(data)
        async with asyncio.timeout(within_s):
            while piece := await reader.read(4096):
                answer += piece
    writer.close()
    with contextlib.suppress(ConnectionError):
        await writer.wait_closed()
    return answer


async def test_emulated_robot_survives_its_clients() -> None:
    """Garbage, an endless line, and more half-open connections than it has places."""
    profile = quick_profile(is_per_request=True)
    settings = {"host": "127.0.0.1", "port": 0}
    async with serve(profile, settings, now=lambda: 7.0) as listening:
        host, port = listening["wire"].host, listening["wire"].port
        assert host == "127.0.0.1"
        ask = b"Give me the battery %\n"
        assert await converse(port, bytes(range(256)) * 100, within_s=0.5) == b""
        assert await converse(port, b"x" * 1_000_000, within_s=0.5) == b""
        assert await converse(port, ask + ask) == b"7\n"
        crowd = [await asyncio.open_connection("127.0.0.1", port) for _ in range(100)]
        assert await converse(port, ask) == b"7\n"
        async with asyncio.timeout(WAIT_S):
            with contextlib.suppress(ConnectionError):
                assert await crowd[0][0].read() == b""  # silent for longest: it had to go
            crowd[-1][1].write(ask)
            assert await crowd[-1][0].read() == b"7\n"
        for _, writer in crowd:
            writer.close()


@pytest.mark.needs("netcat")
async def test_netcat_reads_the_emulated_robot() -> None:
    """A client that is not URC gets the thesis's answer: seconds modulo 100."""
    profile = quick_profile(is_per_request=True)
    settings = {"host": "127.0.0.1", "port": 0}
    async with serve(profile, settings, now=lambda: 1_700_000_045.9) as listening:
        netcat = await asyncio.create_subprocess_exec(
            "nc",
            "127.0.0.1",
            str(listening["wire"].port),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
        )
        async with asyncio.timeout(WAIT_S):
            answer, _ = await netcat.communicate(b"Give me the battery %\n")
        assert answer == b"45\n"


async def test_port_in_use_is_one_line() -> None:
    """The person who starts it twice reads which port and why."""
    profile = quick_profile()
    async with robot_on(good) as robot:
        with pytest.raises(UrcError) as told:
            async with serve(profile, {"host": "127.0.0.1", "port": robot.port}):
                pytest.fail("it listens twice")
    expected = f"transports.wire: cannot listen on 127.0.0.1:{robot.port} (address already in use)"
    assert str(told.value) == expected
