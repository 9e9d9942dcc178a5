"""What happens in the guard's process: lines made by name, what it is told, and its end."""

import asyncio
import gc
import logging
import os
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable, Collection
from io import BytesIO
from typing import Any, ClassVar

import pytest
from msgspec.structs import replace

from tests.unit.guard.lines import STOP, TERMS, CountedWire
from urc.guard import __main__ as program
from urc.guard import messages
from urc.guard.pipe import Pipe
from urc.guard.real_time_priority import RealTimePriority
from urc.guard.server import GuardServer
from urc.testing.clock import FakeClock, settle
from urc.transports.base import GoalRecord, TopicSubscription, TransportSetup

pytestmark = pytest.mark.anyio

BOUND_S = 10.0


class Robots:
    """Makes lines as a table of transports would, and keeps them."""

    made: ClassVar[list[tuple[TransportSetup, CountedWire]]] = []

    @staticmethod
    def make(setup: TransportSetup) -> CountedWire:
        robot = CountedWire()
        Robots.made.append((setup, robot))
        return robot


FACTORY = f"{__name__}:Robots.make"
MAKE = messages.MakeTransport("wire", FACTORY, {"port": 1}, [], "", 0.22, False)
INNER = messages.MakeTransport(
    "inner", FACTORY, {"path": "x"}, [("odom", {"qos": 1})], "wire", 1.0, True
)


@pytest.fixture(autouse=True)
def robots() -> list[tuple[TransportSetup, CountedWire]]:
    Robots.made.clear()
    return Robots.made


def test_line_is_made_by_name_and_carried_by_another(
    robots: list[tuple[TransportSetup, CountedWire]],
) -> None:
    host = GuardServer(lambda said: 0, FakeClock())
    host.handle(MAKE)
    host.handle(INNER)
    (outer, carrier), (setup, _) = robots
    assert outer == TransportSetup("wire", {"port": 1}, (), None)
    assert setup == TransportSetup(
        "inner", {"path": "x"}, (TopicSubscription("odom", {"qos": 1}),), carrier
    )


async def test_what_nobody_armed_is_nobodys() -> None:
    """Of a guard before this one; nothing is written, and nothing breaks."""
    said: list[messages.FromGuard] = []
    host = GuardServer(lambda one: said.append(one) or 0, FakeClock())  # type: ignore[func-returns-value]
    host.handle(MAKE)
    for one in (
        messages.RenewLease("drive", 1, b"go", 1000.0),
        messages.ReleaseControl("drive"),
        messages.ReplaceStop("drive", b"stop 2"),
    ):
        host.handle(one)
    host.settle()
    assert Robots.made[0][1].written == []
    assert said == []


class GoalWire(CountedWire):
    """A line whose goals drive the robot on after the end of the process."""

    kept = GoalRecord()

    def keep_goals(self, record: GoalRecord, changed: Callable[[GoalRecord], None]) -> None:
        self.kept, self.changed = record, changed

    def end_cancellations(self, actions: Collection[str]) -> None:
        self.kept = self.kept._replace(owed=(), dropped=tuple(actions))

    @staticmethod
    def make(setup: TransportSetup) -> "GoalWire":
        robot = GoalWire()
        Robots.made.append((setup, robot))
        return robot


def test_goals_are_handed_to_the_guard_and_their_changes_reported() -> None:
    said: list[messages.FromGuard] = []
    host = GuardServer(lambda one: said.append(one) or 0, FakeClock())  # type: ignore[func-returns-value]
    before = GoalRecord((("a1", "/dock", True),), ("/dock",))
    host.handle(replace(MAKE, factory=f"{__name__}:GoalWire.make", goals=before))
    ((_, robot),) = Robots.made
    assert isinstance(robot, GoalWire)
    assert robot.kept == before
    assert said == []
    after = GoalRecord((("a1", "/dock", True), ("b2", "/dock", False)))
    robot.changed(after)
    assert said == [messages.GoalsChanged("wire", after)]
    host.handle(messages.EndCancellations("wire", ("/dock",)))
    assert (robot.kept.owed, robot.kept.dropped) == ((), ("/dock",))


async def test_nothing_is_taken_at_the_end() -> None:
    """A tick that comes after the last stop would move the robot for ever."""
    clock = FakeClock()
    host = GuardServer(lambda said: 0, clock)
    host.handle(MAKE)
    robot = Robots.made[0][1]
    host.handle(messages.OpenLine("wire", 1, 1.0))
    await clock.advance(0)
    host.handle(messages.ArmControl("wire", "drive", TERMS))
    host.handle(messages.RenewLease("drive", 1, b"go", clock.now()))
    host.settle()
    finishing = asyncio.ensure_future(host.finish())
    await clock.advance(0)
    host.handle(messages.ArmControl("wire", "drive", TERMS))
    host.handle(messages.RenewLease("drive", 2, b"go on", clock.now()))
    host.settle()
    await clock.advance(3.0)
    await finishing
    assert robot.written == [b"go", STOP]


# -- the process


class Server:
    """The other end of the pipe."""

    def __init__(self, line: socket.socket) -> None:
        self.heard: list[messages.FromGuard] = []
        self._changed = asyncio.Event()
        self.pipe = Pipe(
            line,
            messages.encoder(),
            messages.decoder_of_server(),
            take=self._take,
            settle=lambda: None,
            gone=self._changed.set,
        )

    def _take(self, said: messages.FromGuard) -> None:
        self.heard.append(said)
        self._changed.set()

    async def hears(self, kind: type, count: int = 1) -> list[Any]:
        """Return all of a kind that it was told, once there are so many."""
        async with asyncio.timeout(BOUND_S):
            while True:
                found = [one for one in self.heard if isinstance(one, kind)]
                if len(found) >= count:
                    return found
                self._changed.clear()
                await self._changed.wait()


class Ran:
    """A guard's process within this one."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        self.looks = 0
        self.begun: list[str] = []
        self.ended: list[int] = []
        self.task = asyncio.ensure_future(program._guard(theirs, self))  # type: ignore[arg-type]
        self.server = Server(ours)

    def request(self) -> str:
        self.begun.append("precedence")
        return ""

    def retry(self) -> None:
        self.begun.append("beat")
        self.looks += 1

    async def over(self) -> None:
        async with asyncio.timeout(BOUND_S):
            await self.task


@pytest.fixture
async def ran(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Ran]:
    made = Ran()
    monkeypatch.setattr(program.os, "_exit", made.ended.append)
    monkeypatch.setattr(program.logging, "shutdown", lambda: None)
    monkeypatch.setattr(program, "BEAT_S", 0.01)
    yield made
    await ended(made)


async def ended(ran: Ran) -> None:
    """End the guard by its pipe."""
    ran.server.pipe.end()
    await ran.over()
    ran.server.pipe.close()
    for name in (signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().remove_signal_handler(name)


async def test_guard_beats_and_looks_at_its_precedence(ran: Ran) -> None:
    began_s = asyncio.get_running_loop().time()
    beats = await ran.server.hears(messages.Heartbeat, 5)
    assert asyncio.get_running_loop().time() - began_s >= 3 * program.BEAT_S
    assert beats[0].late_s < 1.0
    assert all(-0.001 <= heartbeat.late_s < BOUND_S for heartbeat in beats)
    assert ran.looks >= 5


async def test_guard_loads_its_transports_before_it_asks_for_precedence_and_beats(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Loading takes longer than the precedence allows, and the first beat says that it is over."""
    begun: list[str] = []
    monkeypatch.setattr(GuardServer, "_make", lambda self, made: begun.append("load"))
    monkeypatch.setattr(program.os, "_exit", lambda code: None)
    monkeypatch.setattr(program.logging, "shutdown", lambda: None)
    ran = Ran()
    ran.begun = begun
    ran.server.pipe.post(MAKE)
    ran.server.pipe.post(MAKE)
    await ran.server.hears(messages.Heartbeat)
    assert begun[:4] == ["load", "load", "precedence", "beat"]
    await ended(ran)


async def drive(ran: Ran) -> CountedWire:
    """Open a line and move the robot, for a second."""
    post = ran.server.pipe.post
    post(MAKE)
    post(messages.OpenLine("wire", 1, 1.0))
    await ran.server.hears(messages.LineOpened)
    post(messages.ArmControl("wire", "drive", TERMS._replace(lease_s=1.0)))
    post(messages.RenewLease("drive", 1, b"go", asyncio.get_running_loop().time()))
    robot = Robots.made[0][1]
    async with asyncio.timeout(BOUND_S):
        while not robot.written:
            await settle()
    assert robot.written == [b"go"]
    return robot


async def test_lease_runs_out_by_this_machines_time(ran: Ran) -> None:
    robot = await drive(ran)
    (stopped,) = await ran.server.hears(messages.StopWritten)
    assert stopped == messages.StopWritten("drive", "expired", 1)
    assert robot.written == [b"go", STOP]


async def test_end_of_the_pipe_stops_what_moves(ran: Ran) -> None:
    """The server is gone, however that came."""
    robot = await drive(ran)
    ran.server.pipe.end()
    await ran.over()
    assert robot.written == [b"go", STOP]
    assert not robot.is_open
    assert ran.ended == [0]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
async def test_signal_stops_what_moves(ran: Ran, number: signal.Signals) -> None:
    robot = await drive(ran)
    os.kill(os.getpid(), number)
    await ran.over()
    assert robot.written == [b"go", STOP]
    assert ran.ended == [0]


async def test_end_does_not_wait_for_a_line_that_does_not_close(
    ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever started the guard would kill it otherwise."""
    monkeypatch.setattr(program, "FINISH_S", 0.0)
    monkeypatch.setattr(program, "_GRACE_S", 0.01)
    await drive(ran)

    async def never(self: GuardServer) -> None:
        await asyncio.Event().wait()

    monkeypatch.setattr(GuardServer, "finish", never)
    ran.server.pipe.end()
    await ran.over()
    assert ran.ended == [0]


async def test_lines_have_their_time_to_close(ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    """And a little more than that."""
    monkeypatch.setattr(program, "FINISH_S", BOUND_S)
    monkeypatch.setattr(program, "_GRACE_S", BOUND_S)
    await drive(ran)
    closed: list[bool] = []

    async def slow(self: GuardServer) -> None:
        await settle()
        closed.append(True)

    monkeypatch.setattr(GuardServer, "finish", slow)
    ran.server.pipe.end()
    await ran.over()
    assert closed == [True]


def test_pipe_is_inherited() -> None:
    ours, theirs = socket.socketpair()
    with ours, program._line(str(theirs.detach())) as line:
        line.sendall(b"here")
        assert ours.recv(10) == b"here"


def test_guard_says_its_word_at_the_door(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", type("Input", (), {"buffer": BytesIO(b"the word")})())
    with (
        socket.create_server(("127.0.0.1", 0)) as door,
        program._line(f"door:{door.getsockname()[1]}") as line,
    ):
        visitor, _ = door.accept()
        with visitor:
            assert visitor.recv(20) == b"the word"
        assert line.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_process_is_prepared_before_it_guards(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C is for the server; what is loaded stays."""
    ours, theirs = socket.socketpair()
    done: list[object] = []
    monkeypatch.setattr(sys, "argv", ["guard", str(theirs.detach()), "a door of ours"])
    monkeypatch.setattr(type(program.OWN_DOORS), "learn", lambda self, told: done.extend(told))
    monkeypatch.setattr(signal, "signal", lambda *told: done.append(told))
    monkeypatch.setattr(logging, "basicConfig", lambda **told: done.append(told["level"]))
    monkeypatch.setattr(gc, "freeze", lambda: done.append("freeze"))

    async def guard(line: socket.socket, priority: RealTimePriority) -> None:
        line.sendall(b"here")
        line.close()
        done.append(type(priority))

    monkeypatch.setattr(program, "_guard", guard)
    monkeypatch.setattr(program, "run", lambda work: [*work.__await__()])
    program.main()
    with ours:
        assert ours.recv(10) == b"here"
    assert done == [
        (signal.SIGINT, signal.SIG_IGN), logging.WARNING,
        "a door of ours", "freeze", RealTimePriority,
    ]  # fmt: skip


def test_alarm_that_is_late_rings_at_once() -> None:
    """By the loop's own alarms, which count from now."""
    rings: list[float] = []

    class Loop:
        def call_later(self, delay_s: float, action: object) -> None:
            rings.append(delay_s)

    clock = program._Clock(Loop())  # type: ignore[arg-type]
    clock.call_at(clock.now() - 5.0, rings.clear)
    clock.call_at(clock.now() + 5.0, rings.clear)
    assert rings == [0.0, pytest.approx(5.0, abs=0.5)]
