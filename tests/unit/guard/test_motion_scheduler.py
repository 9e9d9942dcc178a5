"""Held commands of one line: numbers, doubts, other lines than those that take all at once."""

import asyncio

import pytest

from tests.unit.guard.lines import (
    STOP,
    TERMS,
    Bench,
    CountedWire,
    GatedWire,
    Prompter,
    Wire,
)
from urc.guard import messages
from urc.model.payload import Count, Envelope, Payload
from urc.testing.clock import settle
from urc.transports.base import TransportError

pytestmark = pytest.mark.anyio

TURN = TERMS._replace(stop=b"halt")


@pytest.fixture
async def bench(benches: list[Bench]) -> Bench:
    benches.append(Bench(CountedWire()))
    return benches[-1]


def rests(bench: Bench) -> bool:
    """Return whether nothing is due any more: idle costs nothing."""
    return not [alarm for _, _, alarm in bench.clock._due if alarm.action is not None]


async def test_stop_tells_the_newest_tick_that_it_ended(bench: Bench) -> None:
    """Whoever ticks knows by that whether a newer one was under way."""
    await bench.drive()
    bench.tick(b"go 7", number=7)
    bench.tell(messages.ReleaseControl("drive"))
    assert bench.heard() == [messages.StopWritten("drive", "released", 7)]
    bench.tell(messages.StopMotion([("wire", "turn", TURN)]))
    assert bench.heard() == [messages.StopWritten("turn", "stopped", 0)]


async def test_stop_of_a_line_that_waits_tells_the_number_too(benches: list[Bench]) -> None:
    robot = GatedWire()
    benches.append(bench := Bench(robot))
    await bench.drive()
    bench.tick(b"go 2", number=2)
    bench.tell(messages.ReleaseControl("drive"))
    robot.let_through(1)
    await settle()
    assert bench.heard() == []
    robot.let_through(1)
    await settle()
    assert robot.written == [b"go 1", STOP]
    assert bench.heard() == [messages.StopWritten("drive", "released", 2)]


async def test_owed_stop_is_told_by_its_name(bench: Bench) -> None:
    bench.tell(
        messages.RecoverStop("wire", "drive", TERMS), messages.RecoverStop("wire", "turn", TURN)
    )
    await bench.clock.advance(0.1)
    assert bench.robot.written == [STOP, b"halt"]
    assert bench.heard() == [
        messages.StopWritten("drive", "revoked", 0), messages.StopWritten("turn", "revoked", 0),
    ]  # fmt: skip


async def test_tick_as_old_as_its_lease_is_too_old(bench: Bench) -> None:
    await bench.open()
    bench.tell(messages.ArmControl("wire", "drive", TERMS._replace(lease_s=0.5)))
    bench.tell(messages.RenewLease("drive", 1, b"old", bench.clock.now() - 0.5))
    await bench.clock.advance(1.0)
    assert bench.robot.written == []


async def test_tick_of_a_time_to_come_holds_no_longer_than_a_lease(bench: Bench) -> None:
    await bench.open()
    bench.tell(messages.ArmControl("wire", "drive", TERMS))
    bench.tell(messages.RenewLease("drive", 1, b"go", bench.clock.now() + 60.0))
    await bench.clock.advance(0.251)
    assert bench.robot.written == [b"go", STOP]


async def test_armed_anew_it_still_owes_its_stop(bench: Bench) -> None:
    """The new terms hold, the debt does too: nothing moves before it is paid."""
    await bench.drive()
    bench.robot.refusal = "nothing listens"
    bench.robot.cut()
    await bench.clock.advance(0.1)
    bench.tell(messages.ArmControl("wire", "drive", TERMS._replace(stop=b"stop 2")))
    bench.tick(b"go 2", number=2)
    bench.robot.refusal = ""
    await bench.clock.advance(0.1)
    assert bench.robot.written == [b"go 1", b"stop 2"]


async def test_armed_anew_it_keeps_its_rate(bench: Bench) -> None:
    """A gesture a moment after the last one writes no faster than the line may."""
    await bench.drive(TERMS._replace(period_s=0.1))
    bench.tell(messages.ReleaseControl("drive"))
    bench.tell(messages.ArmControl("wire", "drive", TERMS._replace(period_s=0.1)))
    for number in range(2, 9):
        bench.tick(b"go on", number=number)
        await bench.clock.advance(0.01)
    assert bench.robot.written == [b"go 1", STOP, b"go on"], "one of tolerance"


async def test_closed_line_is_not_written_to(bench: Bench) -> None:
    """Not by a tick, a stop, or an alarm that was set before."""
    await bench.drive()
    bench.tell(messages.ReleaseControl("drive"))
    await bench.clock.advance(0.1)
    bench.robot.cut()
    await settle()
    bench.tell(messages.ArmControl("wire", "drive", TERMS))
    bench.tick(b"go 2", number=2)
    bench.tell(messages.StopMotion([("wire", "turn", TURN)]))
    await bench.clock.advance(1.0)
    assert bench.robot.written == [b"go 1", STOP]
    assert bench.robot.opens == 1


@pytest.mark.parametrize("is_strict", [False, True])
async def test_nothing_is_due_at_rest(benches: list[Bench], is_strict: bool) -> None:
    for robot in (CountedWire(), Prompter(), Wire()):
        benches.append(bench := Bench(robot, is_strict=is_strict))
        await bench.drive()
        assert not rests(bench), "the lease is to end"
        bench.tell(messages.ReleaseControl("drive"))
        await bench.clock.advance(1.0)
        assert robot.written == [b"go 1", STOP]
        assert rests(bench), type(robot)


async def test_newest_waits_where_sending_waits(benches: list[Bench]) -> None:
    """Behind the one that is on its way there is never a second one."""
    robot = GatedWire()
    benches.append(bench := Bench(robot))
    await bench.drive()
    for number in range(2, 9):
        bench.tick(f"go {number}".encode(), number=number)
        await bench.clock.advance(0.02)
    robot.let_through(1)
    await settle()
    robot.let_through(1)
    await settle()
    assert robot.written == [b"go 1", b"go 8"]


async def test_dear_line_that_tells_nothing_of_its_bytes_moves(benches: list[Bench]) -> None:
    benches.append(bench := Bench(Wire(), is_strict=True))
    await bench.drive()
    bench.tick(b"go 2", number=2)
    await bench.clock.advance(0.1)
    assert bench.robot.written == [b"go 1", b"go 2"]


async def test_motion_that_did_not_leave_is_reset_with_its_line(bench: Bench) -> None:
    """Else the kernel would send it after the cut; ticks that wait make it no less doubtful."""
    robot = bench.robot
    assert isinstance(robot, CountedWire)
    await bench.drive()
    robot.is_stuck = True
    for number in range(2, 11):
        bench.tick(b"go on", number=number)
        await bench.clock.advance(0.02)
    assert robot.aborts == 0
    robot.cut()
    await settle()
    assert robot.aborts == 1


async def test_line_that_broke_while_all_had_left_is_closed_and_not_reset(bench: Bench) -> None:
    """What the robot has still to read of it, it may."""
    robot = bench.robot
    assert isinstance(robot, CountedWire)
    await bench.open()
    robot.cut()
    await settle()
    assert (robot.aborts, robot.is_open) == (0, False)


async def test_stop_does_not_overtake_a_message_that_is_on_its_way(
    benches: list[Bench],
) -> None:
    """Motion as a message and a stop as bytes: in the order in which they were said."""
    robot = Prompter()
    benches.append(bench := Bench(robot))
    await bench.open()
    go: Payload = Envelope("publish", {"topic": "/v"}, {"x": 1})
    bench.tell(messages.ArmControl("wire", "drive", TERMS))
    bench.tick(go)
    bench.tell(messages.ReleaseControl("drive"))
    assert robot.written == []
    robot.let_through(2)
    await settle()
    assert robot.written == [go, STOP]


class FailingOnce(Wire):
    """One that refuses the first stop, and stays open."""

    def __init__(self) -> None:
        super().__init__()
        self.has_failed = False

    async def send(self, data: Payload) -> None:
        if data == STOP and not self.has_failed:
            self.has_failed = True
            raise TransportError("no room")
        await super().send(data)


async def test_stop_that_a_line_refused_is_written_after_a_reset(benches: list[Bench]) -> None:
    robot = FailingOnce()
    benches.append(bench := Bench(robot))
    await bench.drive()
    bench.tell(messages.ReleaseControl("drive"))
    await bench.clock.advance(0.1)
    assert robot.written == [b"go 1", STOP]
    assert robot.opens == 2
    assert bench.heard() == [
        messages.LineLost("wire", 1, "no room"), messages.StopWritten("drive", "revoked", 1),
    ]  # fmt: skip


async def test_stalled_line_says_for_how_long(benches: list[Bench]) -> None:
    benches.append(bench := Bench(GatedWire(), stalled_s=1.0, is_strict=True))
    await bench.drive(TERMS._replace(lease_s=1.0))
    await bench.clock.advance(0.99)
    assert bench.heard() == []
    await bench.clock.advance(0.05)
    assert bench.heard()[0] == messages.LineLost(
        "wire", 1, "the robot has accepted no data for 1000 ms while moving"
    )


async def test_second_line_is_tried_at_its_own_pace(benches: list[Bench]) -> None:
    """Where opening is dear, four times a second; elsewhere twenty times."""
    for is_strict, attempts in ((True, 4), (False, 20)):
        benches.append(bench := Bench(Wire(), is_strict=is_strict))
        await bench.drive()
        bench.robot.refusal = "nothing listens"
        bench.robot.cut()
        await bench.clock.advance(1.0)
        assert bench.robot.opens - 1 == pytest.approx(attempts, abs=1)
        bench.robot.refusal = ""
        await bench.clock.advance(0.3)
        assert bench.robot.written == [b"go 1", STOP]


async def test_two_debts_of_one_line_are_one_rescue(bench: Bench) -> None:
    bench.robot.refusal = "nothing listens"
    bench.tell(messages.RecoverStop("wire", "drive", TERMS))
    await bench.clock.advance(0.12)
    opens = bench.robot.opens
    bench.tell(messages.RecoverStop("wire", "turn", TURN))
    await bench.clock.advance(0.12)
    assert bench.robot.opens - opens <= 3
    bench.robot.refusal = ""
    await bench.clock.advance(0.1)
    assert bench.robot.written == [STOP, b"halt"]
    bench.tell(messages.RecoverStop("wire", "turn", TURN))
    await bench.clock.advance(0.1)
    assert bench.robot.is_open, "a line that is open is not opened again"


async def test_rescued_line_is_handed_over(bench: Bench) -> None:
    """The engine gets it when it asks, and what it sends counts from then on."""
    await bench.drive()
    bench.robot.cut("cable pulled")
    await bench.clock.advance(0.1)
    assert bench.heard() == [
        messages.LineLost("wire", 1, "cable pulled"), messages.StopWritten("drive", "revoked", 1),
    ]  # fmt: skip
    await bench.open(2)
    bench.tell(messages.SendBytes("wire", 2, 1, b"hello"))
    await settle()
    assert bench.robot.written[-1] == b"hello"


async def test_tick_that_finds_its_number_used_up_is_told_of_once(bench: Bench) -> None:
    """What was told is made again elsewhere; nothing of it stays here."""
    await bench.drive()
    bench.heard()
    bench.tell(messages.SendBytes("wire", 1, 1, b"0 ping", Count({}, {"n": 0})))
    bench.heard()
    bench.tell(messages.RenewLease("drive", 2, b"0 go", bench.clock.now(), Count({}, {"n": 0})))
    assert bench.heard() == [messages.CountersAdvanced("wire", 1, 1, {"n": 0}, [("drive", 2)])]
    bench.tell(messages.SendBytes("wire", 1, 2, b"1 ping", Count({"n": 0}, {"n": 1})))
    told = [said for said in bench.heard() if isinstance(said, messages.CountersAdvanced)]
    assert told == [messages.CountersAdvanced("wire", 1, 2, {"n": 1}, [])]
    assert bench.robot.written == [b"go 1", b"0 ping", b"1 ping"]


async def test_motion_whose_number_is_used_up_before_its_turn_is_not_sent(
    benches: list[Bench],
) -> None:
    """It comes just when the line is free again, and a poll that waited goes first."""
    robot = GatedWire()
    benches.append(bench := Bench(robot))
    await bench.drive()
    bench.tell(messages.SendBytes("wire", 1, 1, b"0 poll", Count({}, {"n": 0})))
    await settle()
    tick = messages.RenewLease("drive", 2, b"0 go", bench.clock.now(), Count({}, {"n": 0}))
    robot.let_through(1)
    asyncio.get_running_loop().call_soon(bench.tell, tick)
    await settle()
    robot.let_through(5)
    await settle()
    assert robot.written == [b"go 1", b"0 poll"]
    stale = [
        one
        for said in bench.heard()
        if isinstance(said, messages.CountersAdvanced)
        for one in said.stale
    ]
    assert stale == [("drive", 2)]


async def test_motion_that_waits_for_a_clear_line_does_not_leave_with_a_used_up_number(
    bench: Bench,
) -> None:
    """A poll takes its number just when the line is clear again. That is told once."""
    robot = bench.robot
    assert isinstance(robot, CountedWire)
    robot.is_stuck = True
    await bench.drive()
    await bench.clock.advance(0.16)
    count = Count({}, {"n": 0})
    bench.tell(messages.RenewLease("drive", 2, b"0 go", bench.clock.now(), count))
    assert robot.written == [b"go 1"]
    robot.is_stuck, robot.stuck_bytes = False, 0
    bench.tell(messages.SendBytes("wire", 1, 1, b"0 poll", count))
    await bench.clock.advance(0.1)
    assert robot.written == [b"go 1", b"0 poll"]
    told = [said for said in bench.heard() if isinstance(said, messages.CountersAdvanced)]
    assert told == [messages.CountersAdvanced("wire", 1, 1, {"n": 0}, [("drive", 2)])]


async def test_the_end_of_a_lease_does_not_wait_for_the_next_look_at_unsent_bytes(
    benches: list[Bench],
) -> None:
    """The looks grow to 20 ms apart while bytes are unsent; the stop comes at its own time."""
    benches.append(bench := Bench(CountedWire(), stalled_s=1.0))
    bench.robot.is_stuck = True
    await bench.drive(TERMS._replace(lease_s=0.25))
    await bench.clock.advance(0.249)
    assert STOP not in bench.robot.written
    await bench.clock.advance(0.002)
    assert bench.robot.written[-1] == STOP


async def test_lease_ends_when_the_image_of_the_operator_is_too_old(bench: Bench) -> None:
    """Before the lease would end by itself, and without any word of the engine."""
    await bench.drive()
    now = bench.clock.now()
    bench.tell(messages.RenewLease("drive", 2, b"go 2", now, until_s=now + 0.1))
    await bench.clock.advance(0.09)
    assert bench.heard() == []
    await bench.clock.advance(0.02)
    assert bench.heard() == [messages.StopWritten("drive", "expired", 2)]
    assert bench.robot.written[-1] == STOP


async def test_tick_of_an_image_that_is_too_old_meanwhile_ends_the_motion(bench: Bench) -> None:
    """It was held up on its way; the lease of an earlier tick does not go on either."""
    await bench.drive()
    now = bench.clock.now()
    bench.tell(messages.RenewLease("drive", 2, b"go 2", now - 0.05, until_s=now))
    assert bench.heard() == [messages.StopWritten("drive", "expired", 2)]
    bench.tell(messages.RenewLease("drive", 3, b"go 3", now))
    assert bench.robot.written == [b"go 1", STOP], "it takes a new gesture"


async def test_such_a_tick_moves_no_control_at_rest(bench: Bench) -> None:
    await bench.drive()
    bench.tell(messages.ReleaseControl("drive"))
    count = len(bench.robot.written)
    now = bench.clock.now()
    bench.tell(messages.RenewLease("drive", 2, b"go 2", now, until_s=now))
    assert bench.robot.written[count:] == []
