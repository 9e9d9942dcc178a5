"""A line passes from the guard to the engine, at first and after a rescue."""

import asyncio

import pytest

from tests.unit.guard.lines import STOP, TERMS, Bench, CountedWire, GatedWire, Prompter, Rig
from urc.guard import guarded_connection, messages
from urc.guard.send_queue import SendQueue
from urc.model.payload import Count, Numbered, Payload
from urc.testing.clock import FakeClock, settle
from urc.transports.connect_race import HURRY

pytestmark = pytest.mark.anyio

NUMBERED = TERMS._replace(stops=(Numbered(b"0 stop", Count({}, {"n": 0})),))


async def test_line_without_news_says_nothing(benches: list[Bench]) -> None:
    benches.append(bench := Bench(CountedWire()))
    bench.tell(messages.ArmControl("wire", "drive", TERMS), messages.ReleaseControl("drive"))
    assert bench.heard() == []
    await bench.open()
    bench.tell(messages.ReleaseControl("drive"))
    assert bench.heard() == []


async def test_stop_overtakes_a_poll_that_waits_behind_motion(benches: list[Bench]) -> None:
    benches.append(bench := Bench(robot := GatedWire()))
    await bench.drive()
    bench.tell(messages.SendBytes("wire", 1, 1, b"poll"))
    await settle()
    bench.tell(messages.StopMotion([("wire", "drive", TERMS)]))
    await settle()
    robot.let_through(3)
    await settle()
    assert robot.written == [b"go 1", STOP, b"poll"]


async def test_engine_is_told_which_numbers_the_stop_of_a_rescue_has_used(
    benches: list[Bench],
) -> None:
    benches.append(bench := Bench(CountedWire()))
    bench.tell(messages.RecoverStop("wire", "drive", NUMBERED))
    await bench.clock.advance(0.1)
    assert bench.robot.written == [b"0 stop"]
    bench.heard()
    bench.tell(messages.OpenLine("wire", 1, 1.0))
    assert bench.heard() == [messages.LineOpened("wire", 1, "wire", {"n": 0})]


async def test_rescued_line_of_a_new_guard_is_closed_when_unused(
    benches: list[Bench],
) -> None:
    benches.append(bench := Bench(CountedWire()))
    bench.tell(messages.RecoverStop("wire", "drive", TERMS))
    await bench.clock.advance(0.1)
    assert bench.robot.is_open
    await bench.clock.advance(10.0)
    assert not bench.robot.is_open


async def test_engine_that_waits_for_a_rescue_without_an_answer_is_told_so(
    benches: list[Bench],
) -> None:
    benches.append(bench := Bench(robot := CountedWire()))

    async def never(timeout_s: float) -> None:
        await asyncio.Event().wait()

    robot.open = never  # type: ignore[method-assign]
    bench.tell(messages.RecoverStop("wire", "drive", TERMS))
    await settle()
    bench.tell(messages.OpenLine("wire", 1, 0.1))
    await bench.clock.advance(0.2)
    assert bench.heard() == [messages.OpenFailed("wire", 1, "no answer from wire")]


async def test_transport_that_ignores_its_time_is_given_up(
    benches: list[Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        guarded_connection, "_GRACE_S", 0.0
    )  # of real time, and it is waited for in full
    benches.append(bench := Bench(robot := CountedWire()))

    async def never(timeout_s: float) -> None:
        await asyncio.Event().wait()

    robot.open = never  # type: ignore[method-assign]
    bench.tell(messages.OpenLine("wire", 1, 0.01))
    async with asyncio.timeout(5.0):
        while not bench.said:
            await settle()
    assert bench.heard() == [messages.OpenFailed("wire", 1, "no answer from wire within 0.01 s")]


async def test_tries_of_a_rescue_overlap_and_those_of_the_engine_do_not(rig: Rig) -> None:
    every_s: list[float | None] = []
    whole = rig.robot.open

    async def noting(timeout_s: float) -> None:
        hurry = HURRY.get()
        every_s.append(hurry and hurry.every_s)
        await whole(timeout_s)

    rig.robot.open = noting  # type: ignore[method-assign]
    await rig.drive()
    rig.robot.cut()
    await rig.clock.advance(0.1)
    assert every_s == [None, 0.07]


async def test_way_that_has_become_long_is_given_its_time(rig: Rig) -> None:
    """After five slow connections, a quick one before them counts no more."""
    patience: list[float] = []
    whole = rig.robot.open

    async def late(timeout_s: float) -> None:
        patience.append(timeout_s)
        await rig.clock.sleep(0.1)
        await whole(timeout_s)

    await rig.transport.open(1.0)
    rig.robot.open = late  # type: ignore[method-assign]
    for _ in range(5):
        await rig.transport.close()
        opening = asyncio.ensure_future(rig.transport.open(1.0))
        await rig.clock.advance(0.1)
        await opening
    rig.guard.arm("drive", TERMS)
    rig.tick(b"go")
    await settle()
    rig.robot.cut()
    await rig.clock.advance(0.2)
    assert patience[-1] == pytest.approx(0.4)


class Eager(Prompter):
    """More arrives on it right after each read."""

    def __init__(self) -> None:
        super().__init__()
        self.taken: list[bool] = []

    async def receive(self) -> Payload:
        found = await super().receive()
        asyncio.get_running_loop().call_soon(self.arrive)
        return found

    def arrive(self) -> None:
        assert self.sink is not None
        self.taken.append(self.sink(b"newest"))


async def test_new_arrivals_wait_behind_unread_ones(benches: list[Bench]) -> None:
    """Neither between two reads, nor right after the engine has taken a rescued line over."""
    benches.append(bench := Bench(robot := Eager()))
    bench.tell(messages.RecoverStop("wire", "drive", TERMS))
    robot.let_through(1)
    await bench.clock.advance(0.1)
    robot.arriving.put_nowait(b"first")
    robot.arriving.put_nowait(b"second")
    bench.heard()
    bench.tell(messages.OpenLine("wire", 1, 1.0))
    robot.arrive()
    await settle()
    assert robot.taken[:2] == [False, False]
    received = [said.data for said in bench.heard() if isinstance(said, messages.BytesReceived)]
    assert received[:2] == [b"first", b"second"]


async def test_frames_may_be_refused_more_than_once(benches: list[Bench]) -> None:
    """Each time all that is under way is made again, and only that is taken."""
    benches.append(bench := Bench(CountedWire()))
    await bench.open()
    used, free = Count({}, {"n": 0}), Count({"n": 0}, {"n": 1})
    bench.tell(messages.SendBytes("wire", 1, 1, b"0 poll", used))
    bench.tell(messages.SendBytes("wire", 1, 2, b"0 ping", used))
    bench.tell(messages.SendBytes("wire", 1, 2, b"0 ping", used, 1))
    bench.tell(messages.SendBytes("wire", 1, 2, b"1 late", free, 1))
    bench.tell(messages.SendBytes("wire", 1, 2, b"1 ping", free, 2))
    assert bench.robot.written == [b"0 poll", b"1 ping"]


async def test_next_frame_of_a_lane_has_its_own_time() -> None:
    queue = SendQueue[int](robot := GatedWire(), clock := FakeClock(), lambda tag, fault: None)
    queue.push(lambda: b"first", 1)
    queue.push(lambda: b"second", 2)
    assert queue.busy_since_s == clock.now()
    await clock.advance(1.0)
    robot.let_through(1)
    await settle()
    assert queue.busy_since_s == clock.now()
    robot.let_through(1)
    await settle()
    assert queue.busy_since_s is None
    queue.end()


class Tried(CountedWire):
    """Refuses after the first connection, and keeps when it was tried, and with which patience."""

    def __init__(self, clock: FakeClock, *, is_hurried: bool) -> None:
        super().__init__()
        self.clock = clock
        self.is_hurried = is_hurried
        self.tries: list[tuple[float, float]] = []

    async def open(self, timeout_s: float) -> None:
        hurry = HURRY.get()
        if hurry is not None:
            hurry.is_used = self.is_hurried
            self.tries.append((self.clock.now(), timeout_s))
        await super().open(timeout_s)


@pytest.mark.parametrize(
    ("is_dear", "is_hurried", "every_s", "patience"),
    [
        (False, False, 0.05, [0.07, 0.0875, 0.109375]),
        (False, True, 0.05, [0.07, 2.0, 2.0]),
        (True, True, 0.25, [0.07, 6.0, 6.0]),
    ],
)
async def test_rescue_is_tried_at_a_pace_and_with_patience(
    is_dear: bool, is_hurried: bool, every_s: float, patience: list[float]
) -> None:
    """More of it with each try; all of it where tries overlap."""
    robot = Tried(FakeClock(), is_hurried=is_hurried)
    rig = Rig(robot, is_strict=is_dear)
    robot.clock = rig.clock
    await rig.drive()
    robot.refusal = "nothing listens"
    robot.cut()
    await rig.clock.advance(1.0)
    times = [at for at, _ in robot.tries[:3]]
    assert times[1] - times[0] == pytest.approx(every_s)
    assert times[2] - times[1] == pytest.approx(every_s)
    assert [one for _, one in robot.tries[:3]] == pytest.approx(patience)
    robot.refusal = ""
    await rig.clock.advance(1.0)
    assert robot.written[-1] == STOP
