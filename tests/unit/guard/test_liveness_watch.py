"""A counterpart that stands still while its system goes on taking what is written."""

import asyncio

import pytest

from tests.unit.guard.lines import STOP, TERMS, CountedWire, Rig
from urc.guard.guarded_connection import WINDOW_BYTES
from urc.guard.liveness_watch import LivenessWatch
from urc.model.payload import Envelope
from urc.motion.liveness import ASKED_EVERY_S, SILENCE_S
from urc.testing.clock import FakeClock, settle
from urc.transports.base import PeerClosed, Transport

pytestmark = pytest.mark.anyio


class ProbedWire(CountedWire):
    """One whose program at the other end can be asked for a sign of life."""

    def __init__(self) -> None:
        super().__init__()
        self.lives = asyncio.Event()
        self.lives.set()
        self.probes = 0
        self.is_broken = False
        self.bug: Exception | None = None

    async def open(self, timeout_s: float) -> None:
        if not self.lives.is_set():
            self.opens += 1
            await self.lives.wait()
        await super().open(timeout_s)

    async def probe(self) -> None:
        self.probes += 1
        if self.is_broken:
            raise PeerClosed("the connection broke")
        if self.bug is not None:
            raise self.bug
        await self.lives.wait()


class UnprobedCountingWire(CountedWire):
    """One that counts what arrives, because it also delivers envelopes of its own."""

    count = 0

    def arrivals(self) -> int:
        return self.count


class CountingWire(UnprobedCountingWire, ProbedWire):
    """The same, and its program can be asked for a sign of life."""


async def held(rig: Rig, seconds: float) -> None:
    """Go on ticking, as a hand does that notices nothing."""
    for at in range(round(seconds / 0.05)):
        await rig.clock.advance(0.05)
        rig.tick(b"go on %d" % at)


@pytest.fixture
def robot() -> ProbedWire:
    return ProbedWire()


@pytest.fixture
def rig(robot: ProbedWire, rigs: list[Rig]) -> Rig:
    rigs.append(Rig(robot, stalled_s=1.0, is_strict=True))
    return rigs[-1]


async def test_counterpart_that_stands_still_ends_the_motion_and_hears_the_stop_first(
    robot: ProbedWire, rig: Rig
) -> None:
    await rig.drive()
    await held(rig, 2.0)
    assert robot.aborts == 0
    robot.lives.clear()
    before = len(robot.written)
    frozen_s = rig.clock.now()
    while not robot.aborts:
        await rig.clock.advance(0.01)
        rig.tick(b"go old")
    assert rig.clock.now() - frozen_s <= SILENCE_S
    written = len(robot.written)
    await held(rig, 4.0)
    assert robot.written[written:] == [], "nothing is written to what does not listen"
    robot.lives.set()
    await rig.clock.advance(0.2)
    assert robot.written[written:] == [STOP]
    await held(rig, 1.0)
    assert robot.written[written:] == [STOP], "a hand that holds on moves nothing"
    assert written - before <= 60


async def test_nobody_is_asked_at_rest(robot: ProbedWire, rig: Rig) -> None:
    await rig.transport.open(1.0)
    await rig.clock.advance(5.0)
    assert robot.probes == 0
    rig.guard.arm("drive", TERMS)
    rig.tick(b"go")
    await rig.clock.advance(0.1)
    assert robot.probes
    rig.guard.release("drive")
    await rig.clock.advance(0.2)
    probes = robot.probes
    robot.lives.clear()
    await rig.clock.advance(60.0)
    assert robot.probes == probes
    assert robot.aborts == 0
    robot.lives.set()


async def test_whatever_arrives_is_a_sign_of_life(robot: ProbedWire, rig: Rig) -> None:
    """An answer to the question may be late behind a big picture."""
    await rig.drive()
    await held(rig, 0.2)
    robot.lives.clear()
    for _ in range(40):
        robot.arriving.put_nowait(b"odometry")
        await held(rig, 0.05)
        await rig.transport.receive()
    assert robot.aborts == 0
    robot.lives.set()


@pytest.mark.parametrize("is_asked", [True, False])
async def test_deliveries_that_did_not_just_arrive_are_no_sign_of_life(
    rigs: list[Rig], is_asked: bool
) -> None:
    """Held-back messages, and answers that the transport makes, go on while the robot is frozen."""
    robot = CountingWire() if is_asked else UnprobedCountingWire()
    limit_s = SILENCE_S if is_asked else 2.0
    rigs.append(rig := Rig(robot, stalled_s=1.0, is_strict=True, silent_s=2.0))
    await rig.drive()
    await held(rig, 0.2)
    robot.count += 1
    if isinstance(robot, CountingWire):
        robot.lives.clear()
    frozen_s = rig.clock.now()
    while not robot.aborts:
        robot.arriving.put_nowait(Envelope("message", {"topic": "/odom"}, b"late"))
        await held(rig, 0.05)
        await rig.transport.receive()
        assert rig.clock.now() - frozen_s <= limit_s + ASKED_EVERY_S
    if isinstance(robot, CountingWire):
        robot.lives.set()


async def test_arrivals_that_are_not_delivered_are_a_sign_of_life(rigs: list[Rig]) -> None:
    """A throttle holds them back, or the engine is slow."""
    robot = CountingWire()
    rigs.append(rig := Rig(robot, stalled_s=1.0, is_strict=True))
    await rig.drive()
    await held(rig, 0.2)
    robot.lives.clear()
    for _ in range(40):
        robot.count += 1
        await held(rig, 0.05)
    assert robot.aborts == 0
    robot.lives.set()


async def test_credit_of_the_engine_is_no_sign_of_life_of_a_counted_robot(
    rigs: list[Rig],
) -> None:
    """The engine works off what has arrived before the freeze."""
    robot = CountingWire()
    rigs.append(rig := Rig(robot, stalled_s=1.0, is_strict=True))
    await rig.drive()
    robot.lives.clear()
    frozen_s = rig.clock.now()
    while not robot.aborts:
        for _ in range(2):
            robot.arriving.put_nowait(Envelope("message", {"topic": "/map"}, bytes(WINDOW_BYTES)))
        await held(rig, 0.05)
        await rig.transport.receive()
        assert rig.clock.now() - frozen_s <= SILENCE_S + ASKED_EVERY_S
    robot.lives.set()


async def test_question_that_cannot_be_asked_is_no_answer(robot: ProbedWire, rig: Rig) -> None:
    await rig.drive()
    robot.is_broken = True
    await held(rig, 0.6)
    assert robot.aborts == 1


async def test_line_that_cannot_be_asked_is_reset_when_its_robot_is_silent_for_too_long(
    rigs: list[Rig],
) -> None:
    robot = CountedWire()
    rigs.append(rig := Rig(robot, silent_s=2.0))
    await rig.drive()
    await held(rig, 1.5)
    robot.arriving.put_nowait(b"odometry")
    await held(rig, 1.9)
    assert robot.aborts == 0
    await held(rig, 0.2)
    assert robot.aborts == 1
    assert robot.written[-1] == STOP


# -- the watch alone


class Watched:
    """A watch over a line with constant motion; keeps its messages."""

    def __init__(self, robot: Transport, silent_s: float | None = None) -> None:
        self.clock = FakeClock()
        self.said: list[str] = []
        self.watch = LivenessWatch(
            robot,
            self.clock,
            silent_s=silent_s,
            is_moving=lambda: True,
            failed=self.said.append,
        )

    def begin(self) -> None:
        self.watch.begin()
        self.watch.start()


async def test_closed_line_is_not_asked(robot: ProbedWire) -> None:
    it = Watched(robot)
    it.watch.start()
    await settle()
    assert robot.probes == 0
    it.begin()
    await settle()
    it.watch.end()
    it.watch.start()
    await it.clock.advance(1.0)
    assert robot.probes == 1
    assert it.said == []


async def test_line_that_was_opened_again_is_watched_again(robot: ProbedWire) -> None:
    it = Watched(robot)
    it.begin()
    await it.clock.advance(0.02)
    it.watch.end()
    it.begin()
    robot.lives.clear()
    await it.clock.advance(SILENCE_S + ASKED_EVERY_S)
    assert len(it.said) == 1
    it.watch.end()


async def test_ticks_do_not_make_questions_more_frequent(robot: ProbedWire) -> None:
    it = Watched(robot)
    it.begin()
    for _ in range(5):
        await it.clock.advance(ASKED_EVERY_S / 8)
        it.watch.start()
    assert robot.probes == 1
    it.watch.end()


@pytest.mark.parametrize(
    ("is_asked", "silent_s", "told"),
    [(True, None, "500 ms"), (True, 2.0, "500 ms"), (False, 2.0, "2000 ms")],
)
async def test_reason_names_the_length_of_the_silence(
    robot: ProbedWire, is_asked: bool, silent_s: float | None, told: str
) -> None:
    robot.lives.clear()
    it = Watched(robot if is_asked else CountedWire(), silent_s)
    it.begin()
    await it.clock.advance(2.1)
    assert it.said == [f"the remote program has sent no data for {told} during motion"]
    it.watch.end()


async def test_bug_in_a_question_is_logged_and_is_no_answer(
    robot: ProbedWire, caplog: pytest.LogCaptureFixture
) -> None:
    robot.bug = RuntimeError("no such handle")
    it = Watched(robot)
    it.begin()
    await it.clock.advance(SILENCE_S + ASKED_EVERY_S)
    assert len(it.said) == 1
    assert "no such handle" in caplog.text
