"""How a guard is started, let in, waited for and ended."""

import asyncio
import os
import socket
import subprocess
import sys
from typing import Any

import pytest

from urc.guard import process
from urc.guard.process import TOKEN_BYTES, GuardAcceptor, launch, reap

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.skipif(sys.platform == "win32", reason="pipes are inherited on POSIX alone"),
]

BOUND_S = 10.0


class Started:
    """A program that was started, or was to be."""

    def __init__(self) -> None:
        self.command: list[str] = []
        self.options: dict[str, Any] = {}
        self.inherited: tuple[int, int] = (0, 0)
        self.fault: OSError | None = None
        reader, writer = os.pipe()
        self.told = os.fdopen(reader, "rb")
        self.stdin = os.fdopen(writer, "wb")

    def popen(self, command: list[str], **options: Any) -> "Started":
        self.command, self.options = command, options
        if self.fault is not None:
            raise self.fault
        for number in options.get("pass_fds", ()):
            copy = socket.socket(fileno=os.dup(number))
            copy.sendall(b"here")
            copy.close()
        return self


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Any:
    made = Started()
    monkeypatch.setattr(subprocess, "Popen", made.popen)
    yield made
    made.told.close()
    made.stdin.close()


def test_guard_inherits_its_end_of_the_pipe(started: Started) -> None:
    """And nothing else: no terminal, no signal of the server's group, no folder to import from."""
    child, ours = launch(is_inherited=True)
    with ours:
        assert isinstance(ours, socket.socket)
        assert ours.recv(10) == b"here"
        assert ours.recv(10) == b"", "our copy of its end is closed"
    (number,) = started.options["pass_fds"]
    assert child is started  # type: ignore[comparison-overlap]
    assert started.command == [sys.executable, "-P", "-m", "urc.guard", str(number)]
    assert started.options["stdin"] == subprocess.DEVNULL
    assert started.options["process_group"] == 0


def test_guard_is_told_the_word_where_nobody_can_read_it(started: Started) -> None:
    child, door = launch(is_inherited=False)
    assert child is started  # type: ignore[comparison-overlap]
    assert isinstance(door, GuardAcceptor)
    place = f"door:{door.port}"
    assert started.command == [sys.executable, "-P", "-m", "urc.guard", place]
    assert started.options["stdin"] == subprocess.PIPE
    assert started.told.read() == door.token
    assert len(door.token) == TOKEN_BYTES
    door.close()


@pytest.mark.parametrize("is_inherited", [True, False])
def test_guard_that_cannot_be_started_leaves_nothing_open(
    started: Started, is_inherited: bool
) -> None:
    started.fault = OSError("no more processes")
    with pytest.raises(OSError, match="no more processes"):
        launch(is_inherited=is_inherited)


async def test_door_lets_the_guard_in_and_nobody_after_it() -> None:
    door = GuardAcceptor()
    admitted = asyncio.ensure_future(door.admitted())
    with socket.create_connection(("127.0.0.1", door.port)) as guard:
        guard.sendall(door.token[:7])
        await asyncio.sleep(0)
        guard.sendall(door.token[7:] + b"hello")
        async with asyncio.timeout(BOUND_S):
            line = await admitted
            assert await asyncio.get_running_loop().sock_recv(line, 10) == b"hello"
        assert line.getpeername() == guard.getsockname()
        assert line.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        line.close()
    assert door._listener.fileno() == -1
    door.close()


def test_doors_of_two_robots_are_apart() -> None:
    first, second = GuardAcceptor(), GuardAcceptor()
    assert first.port != second.port
    assert first.token != second.token
    for door in (first, second):
        door.close()


@pytest.mark.parametrize("word", [b"", b"guess", b"0" * TOKEN_BYTES, b"0" * (TOKEN_BYTES + 9)])
async def test_door_turns_a_stranger_away(word: bytes) -> None:
    door = GuardAcceptor()
    admitted = asyncio.ensure_future(door.admitted())
    with socket.create_connection(("127.0.0.1", door.port)) as stranger:
        stranger.sendall(word)
        stranger.shutdown(socket.SHUT_WR)
        stranger.setblocking(False)
        async with asyncio.timeout(BOUND_S):
            try:
                said = await asyncio.get_running_loop().sock_recv(stranger, 1)
            except ConnectionResetError:
                said = b""
    assert said == b""
    assert not admitted.done()
    with socket.create_connection(("127.0.0.1", door.port)) as guard:
        guard.sendall(door.token)
        async with asyncio.timeout(BOUND_S):
            (await admitted).close()


async def test_stranger_who_says_nothing_keeps_the_guard_out_for_a_moment_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(process, "_SAY_S", 0.01)
    door = GuardAcceptor()
    admitted = asyncio.ensure_future(door.admitted())
    with (
        socket.create_connection(("127.0.0.1", door.port)),
        socket.create_connection(("127.0.0.1", door.port)) as guard,
    ):
        guard.sendall(door.token)
        async with asyncio.timeout(BOUND_S):
            line = await admitted
        assert line.getpeername() == guard.getsockname()
        line.close()


async def test_door_is_closed_when_nobody_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "_ADMIT_S", 0.01)
    door = GuardAcceptor()
    with pytest.raises(TimeoutError):
        await door.admitted()
    assert door._listener.fileno() == -1


class Ending:
    """A process that is there for so many looks."""

    def __init__(self, looks: int, *, ends_by_itself: bool = True) -> None:
        self.looks = looks
        self.ends_by_itself = ends_by_itself
        self.is_killed = False

    def poll(self) -> int | None:
        self.looks -= self.ends_by_itself or self.is_killed
        return 0 if self.looks <= 0 else None

    def kill(self) -> None:
        self.is_killed = True


@pytest.fixture
def naps(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    taken: list[float] = []
    sleep = asyncio.sleep

    async def nap(seconds: float) -> None:
        taken.append(seconds)
        await sleep(0)

    monkeypatch.setattr(process.asyncio, "sleep", nap)
    return taken


async def test_guard_that_ends_by_itself_is_waited_for(naps: list[float]) -> None:
    ending = Ending(50)
    await reap(ending)  # type: ignore[arg-type]
    assert (ending.is_killed, len(naps)) == (False, 49)


async def test_guard_that_does_not_end_in_a_second_is_killed(naps: list[float]) -> None:
    ending = Ending(3, ends_by_itself=False)
    await reap(ending)  # type: ignore[arg-type]
    assert ending.is_killed
    assert sum(naps) == pytest.approx(1.0, abs=0.1)
