"""The guard stops the robot whatever becomes of the engine, and whatever becomes of the guard.

The engine, the guard and the robot are processes of their own; all times are the robot's, or
stamped by the same clock.
"""

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from bench.rig.programs import Heard, Program, Robots
from tests.e2e.transports.packets import Loss
from tests.e2e.verdict import judged
from tests.effort import IS_THOROUGH

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.alone,
    pytest.mark.skipif(sys.platform != "linux", reason="the rig is for Linux alone"),
]

LEASE_MS = 250
LATE_MS = 50
"""Required: the first byte of the stop comes within the lease and this."""
OLD_MS = 300
"""Age from which no motion may reach the robot."""
FOLLOWS_S = 0.3
"""How long nothing may follow the stop."""
RESTART_MS = 500
OPEN_MS = 200
"""What connecting over loopback may take on a busy machine, beside the restart."""
STOP = "go 0"
WAIT_S = 15.0
END_S = 3.0
"""Required of the end of a session."""
DEATHS = 10
BATCHES = 20 if IS_THOROUGH else 2
LOOK_NS = 25_000_000
"""How much later it is known that a process was kept from running."""
START = [sys.executable, "-P", "-c", "import urc.guard.__main__"]


class Rig:
    """One robot, and one engine that drives it."""

    def __init__(self, *options: str) -> None:
        self.robots = Robots(["tcp:127.0.0.1:0"])
        script = str(Path(__file__).with_name("guard_engine.py"))
        command = [sys.executable, script, str(self.robots.ports[0]), *options]
        self.engine = Program(command)
        try:
            self.engine.wait_until(
                lambda: "linked live" in self.engine.lines, WAIT_S, "a live line"
            )
        except BaseException:
            self.engine.close()
            self.robots.close()
            raise
        self._watcher = Robots([f"pid:{self.engine.pid}"])
        """Says when the engine or a guard could run, and was not let."""

    def close(self) -> None:
        """End all."""
        self.engine.signal(signal.SIGCONT)
        self.engine.close()
        self.robots.signal(signal.SIGCONT)
        self.robots.close()
        self._watcher.close()

    @property
    def guard(self) -> int:
        """Process id of the newest guard."""
        found = [line for line in self.engine.lines if line.startswith("guard ")]
        return int(found[-1].split()[1])

    def drive(self) -> None:
        """Drive until the robot moves; again if a busy machine has ended the motion."""
        until = time.monotonic() + WAIT_S
        while time.monotonic() < until:
            before, told = time.monotonic_ns(), len(self.engine.lines)
            self.engine.order("drive")
            while time.monotonic() < until and not self._has_stopped(told):
                heard = [one.text for one in self.robots.since(0, before)]
                if len(heard) >= 3 and STOP not in heard[-3:]:
                    return
                time.sleep(0.005)
        raise AssertionError(f"the robot did not move within {WAIT_S:g} s")

    def _has_stopped(self, told: int) -> bool:
        """Return whether the guard has ended the motion since the line number `told`."""
        ends = ("stopped expired", "stopped revoked")
        return any(line.startswith(ends) for line in self.engine.lines[told:])

    def stop_after(self, time_ns: int, within_s: float = WAIT_S) -> Heard:
        """Return the first stop that the robot heard from then on."""

        def found() -> list[Heard]:
            return [one for one in self.robots.since(0, time_ns) if one.text == STOP]

        self.robots.wait_until(lambda: bool(found()), within_s, "a stop")
        return found()[0]

    def ticks(self) -> list[int]:
        """Return when ticks were given."""
        with self.engine.changed:
            return [int(line.split()[1]) for line in self.engine.lines if line.startswith("tick ")]

    def given(self, motion: Heard) -> int:
        """Return when the tick of a frame ``go N`` was given: it was the N-th."""
        return self.ticks()[int(motion.text.split()[1]) - 1]

    def await_another(self, guard: int) -> None:
        """Wait until there is a guard that is not `guard`, and a live line."""

        def is_so() -> bool:
            return self.guard != guard and self.states()[-1] == "live"

        self.engine.wait_until(is_so, WAIT_S, "another guard with a live line")

    def states(self) -> list[str]:
        """Return the states of the line, with what became of the guard between them."""
        words = [line.split() for line in self.engine.lines]
        return [one[-1] for one in words if one[0] in ("linked", "guard")]

    def is_late(self, from_ns: int, until_ns: int) -> float:
        """Return by how many milliseconds the machine itself was late meanwhile."""
        waited_ms = self._watcher.waited_ms(from_ns, until_ns + LOOK_NS)
        return self.robots.latest_ms(from_ns, until_ns) + waited_ms


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.close()


def after_last_motion_ms(rig: Rig, since_ns: int) -> float:
    """Return how long after the last motion the robot heard the stop; nothing else may follow."""
    stop = rig.stop_after(since_ns)
    time.sleep(0.3)
    motion = [one for one in rig.robots.heard[0] if one.text != STOP]
    assert motion[-1].time_ns <= stop.time_ns, "motion after the stop"
    return (stop.time_ns - motion[-1].time_ns) / 1e6


def is_soon(took_ms: float, late_ms: float) -> bool:
    """Return whether another guard has stopped the robot in time.

    A machine on which it takes long until Python has read the guard's modules is given that time.
    """
    allowed_ms = RESTART_MS + OPEN_MS + late_ms
    if took_ms <= allowed_ms:
        return True
    began_ns = time.monotonic_ns()
    subprocess.run(START, check=True, timeout=WAIT_S)
    return took_ms <= allowed_ms + (time.monotonic_ns() - began_ns) / 1e6


class Stop(NamedTuple):
    """One stop by the lease."""

    took_ms: float
    late_ms: float
    """By how much the machine was late meanwhile."""

    @property
    def is_good(self) -> bool:
        """Whether it came in time."""
        return self.took_ms <= LEASE_MS + LATE_MS

    @property
    def is_excused(self) -> bool:
        """Whether the machine was later than the stop."""
        return 0 < self.took_ms - LEASE_MS - LATE_MS <= self.late_ms


def test_frozen_engine_stops_the_robot(rig: Rig) -> None:
    """The guard has the lease: nobody else needs to be awake."""
    stops: list[Stop] = []
    while not judged(stops, 5):
        rig.drive()
        since = time.monotonic_ns()
        os.kill(rig.engine.pid, signal.SIGSTOP)
        try:
            took_ms = after_last_motion_ms(rig, since)
        finally:
            os.kill(rig.engine.pid, signal.SIGCONT)
        stops.append(Stop(took_ms, rig.is_late(since, time.monotonic_ns())))
        rig.engine.wait_until(
            lambda: "stopped expired" in "\n".join(rig.engine.lines), WAIT_S, "news"
        )
        rig.engine.order("rest")


def test_engine_that_a_pattern_holds_up_stops_the_robot(rig: Rig) -> None:
    """Catastrophic backtracking keeps the interpreter from everything else; not from stopping."""
    stops: list[Stop] = []
    while not judged(stops, 2):
        rig.drive()
        since, told = time.monotonic_ns(), len(rig.engine.lines)
        rig.engine.order("backtrack")
        took_ms = after_last_motion_ms(rig, since)
        stops.append(Stop(took_ms, rig.is_late(since, time.monotonic_ns())))
        stop = rig.stop_after(since)
        began, ended = map(int, rig.engine.wait_for("backtracked", WAIT_S, after=told)[1:])
        if not stops[-1].is_excused:
            assert began < stop.time_ns < ended, "the robot was stopped while the engine hung"
        rig.engine.order("rest")


def test_killed_engine_stops_the_robot_and_ends_the_guard(rig: Rig) -> None:
    """Nothing is left of either, and nothing is written after the stop."""
    rig.drive()
    guard, since = rig.guard, time.monotonic_ns()
    os.kill(rig.engine.pid, signal.SIGKILL)
    took_ms = after_last_motion_ms(rig, since)
    assert took_ms <= LEASE_MS + LATE_MS + rig.is_late(since, time.monotonic_ns())
    until = time.monotonic() + WAIT_S
    while is_alive(guard):
        assert time.monotonic() < until, "the guard lives on"
        time.sleep(0.02)


@pytest.mark.parametrize("batch", range(BATCHES))
def test_killed_guard_is_replaced_and_stops_first(rig: Rig, batch: int) -> None:
    """The first thing that the robot hears of a new guard is the stop; motion needs a new start."""
    files = None
    for number in range(DEATHS):
        rig.drive()
        guard, since = rig.guard, time.monotonic_ns()
        os.kill(guard, signal.SIGKILL)
        rig.robots.wait_until(lambda since=since: bool(opened(rig, since)), WAIT_S, "a new line")  # type: ignore[misc]
        stop = rig.stop_after(opened(rig, since)[0])
        rig.engine.order("rest")
        assert rig.robots.since(0, opened(rig, since)[0])[0] == stop
        took_ms = (stop.time_ns - since) / 1e6
        late_ms = rig.is_late(since, time.monotonic_ns())
        assert is_soon(took_ms, late_ms), f"death {number} of batch {batch}: {took_ms:.0f} ms"
        rig.await_another(guard)
        told = len(rig.engine.lines)
        rig.engine.order("files")
        now = rig.engine.wait_for("files", after=told)
        files = files or now
        assert now == files, "descriptors are left behind"


def opened(rig: Rig, since_ns: int) -> list[int]:
    """Return when the robot's line was opened since then."""
    return [at for at, is_open in rig.robots.visits[0] if is_open and at > since_ns]


def test_robot_that_stops_reading_is_reached_afresh(rig: Rig) -> None:
    """What it did not take within 250 ms it never gets; the stop is the first of the next line."""
    rig.drive()
    rig.engine.order("release")
    rig.stop_after(0)
    rig.robots.signal(signal.SIGSTOP)
    told = len(rig.engine.lines)
    rig.engine.order("big")
    rig.engine.wait_until(
        lambda: any(line.startswith("linked lost") for line in rig.engine.lines[told:]),
        WAIT_S,
        "a reset",
    )
    rig.engine.order("rest")
    time.sleep(0.5)
    again = time.monotonic_ns()
    rig.robots.signal(signal.SIGCONT)
    rig.stop_after(again)
    assert {one.text[:20] for one in rig.robots.since(0, again)} == {STOP}


@pytest.mark.needs("iptables")
@pytest.mark.parametrize("cut_s", [0.3, 0.6, 2.0])
async def test_cut_link_delivers_nothing_old(rig: Rig, cut_s: float) -> None:
    """The stop comes as soon as the robot can be reached, and no old motion or later one."""
    rig.drive()
    loss = Loss(rig.robots.ports[0])
    await loss.begin()
    cut = time.monotonic_ns()
    await asyncio.sleep(cut_s)
    rig.engine.order("rest")
    await loss.end()
    healed = time.monotonic_ns()
    stop = rig.stop_after(cut)
    await asyncio.sleep(FOLLOWS_S)
    late_ms = rig.is_late(healed - OLD_MS * 1_000_000, stop.time_ns)
    motion = [one for one in rig.robots.since(0, healed) if one.text != STOP]
    ages_ms = [(one.time_ns - rig.given(one)) / 1e6 for one in motion]
    assert max(ages_ms, default=0.0) <= OLD_MS + late_ms, "old motion came through"
    assert all(one.time_ns < stop.time_ns for one in motion), "motion followed the stop"
    assert (stop.time_ns - healed) / 1e6 <= 100 + late_ms


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_ended_guard_stops_the_robot(rig: Rig, number: signal.Signals) -> None:
    """Asked to end it stops at once; killed, the one after it does."""
    rig.drive()
    since = time.monotonic_ns()
    os.kill(rig.guard, number)
    took_ms = after_last_motion_ms(rig, since)
    assert is_soon(took_ms, rig.is_late(since, time.monotonic_ns()))


def test_interrupt_of_the_terminal_does_not_reach_the_guard(rig: Rig) -> None:
    """It is for the engine to say what is to be done."""
    rig.drive()
    guard = rig.guard
    assert os.getpgid(guard) != os.getpgid(rig.engine.pid)
    os.kill(guard, signal.SIGINT)
    rig.drive()
    assert rig.guard == guard


def test_end_of_the_session_stops_the_robot_first(rig: Rig) -> None:
    """The stop is written before lines are closed, and all is over within 3 s."""
    rig.drive()
    guard = rig.guard
    rig.engine.order("end")
    ending = int(rig.engine.wait_for("ending")[1])
    ended = int(rig.engine.wait_for("ended")[1])
    assert (ended - ending) / 1e9 < END_S
    stop = rig.stop_after(ending - 1_000_000_000)
    rig.robots.wait_until(lambda: not rig.robots.visits[0][-1][1], WAIT_S, "a closed line")
    assert stop.time_ns <= rig.robots.visits[0][-1][0]
    assert rig.robots.heard[0][-1].text == STOP
    assert not is_alive(guard)


def test_stop_is_written_whether_it_moves_or_not(rig: Rig) -> None:
    """It says that the robot's line has taken it."""
    since = time.monotonic_ns()
    rig.engine.order("stop")
    rig.stop_after(since)
    assert rig.engine.wait_for("stopped")[1] == "stopped"


def test_commands_go_beside_the_motion(rig: Rig) -> None:
    """What is not held takes the same line."""
    rig.drive()
    rig.engine.order("hello")
    rig.robots.wait_until(
        lambda: any(one.text == "hello" for one in rig.robots.heard[0]), WAIT_S, "hello"
    )


def test_letting_go_stops_at_once(rig: Rig) -> None:
    """Not only when the lease has run out."""
    rig.drive()
    since = time.monotonic_ns()
    rig.engine.order("release")
    rig.stop_after(since)
    assert rig.engine.wait_for("stopped")[1] == "released"


def test_motion_without_a_guard_stops_all_the_same() -> None:
    """``--no-guard``: the same machines in the engine's own process."""
    rig = Rig("here")
    try:
        rig.drive()
        since = time.monotonic_ns()
        rig.engine.order("release")
        rig.stop_after(since)
        assert not [line for line in rig.engine.lines if line.startswith("guard")]
    finally:
        rig.close()


def test_guard_runs_nothing_out_of_documents(rig: Rig) -> None:
    """No template, pattern or parser is even loaded there."""
    maps = Path(f"/proc/{rig.guard}/maps").read_text("utf-8")
    assert "_msgspec" in maps or "msgspec" in maps  # what is loaded can be seen here
    for library in ("_re2", "markupsafe", "_yaml"):
        assert library not in maps


def is_alive(pid: int) -> bool:
    """Return whether a process runs; one that is dead and not yet buried does not."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text("utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return False
