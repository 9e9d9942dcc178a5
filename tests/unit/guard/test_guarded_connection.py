"""A line in the guard: motion where it is clear, and stops before anything else."""

import asyncio

import pytest

from tests.unit.guard.lines import STOP, TERMS, CountedWire, GatedWire, Rig, Wire
from urc.guard import messages, proxy
from urc.guard.local_channel import LocalChannel
from urc.model.payload import Count, CountedFrame, Envelope, Numbered
from urc.testing.clock import settle
from urc.transports.base import ConnectFailed

pytestmark = pytest.mark.anyio


async def test_tick_is_written_at_once(rig: Rig) -> None:
    await rig.transport.open(1.0)
    rig.guard.arm("drive", TERMS)
    rig.tick(b"go")
    assert rig.robot.written == [b"go"]


async def test_lease_that_runs_out_stops(rig: Rig) -> None:
    await rig.drive()
    await rig.clock.advance(0.249)
    assert rig.robot.written == [b"go 1"]
    await rig.clock.advance(0.01)
    assert rig.robot.written == [b"go 1", STOP]
    assert await rig.stops() == [("drive", "expired")]
    rig.tick(b"go 2")
    await rig.clock.advance(60.0)
    assert rig.robot.written == [b"go 1", STOP], "idle is silent, and nothing goes on by itself"


async def test_release_stops_and_may_go_on(rig: Rig) -> None:
    await rig.drive()
    rig.guard.release("drive")
    await rig.clock.advance(0.1)
    rig.tick(b"go 2")
    await settle()
    assert rig.robot.written == [b"go 1", STOP, b"go 2"]
    assert await rig.stops() == [("drive", "released")]


async def test_tick_that_waited_too_long_renews_nothing(rig: Rig) -> None:
    """A guard that was frozen finds old ticks in the pipe; each is as old as it is."""
    await rig.drive()
    await rig.clock.advance(0.24)
    rig.guard.channel.post(messages.RenewLease("drive", 9, b"old", rig.clock.now() - 0.3))
    await rig.clock.advance(0.02)
    assert rig.robot.written == [b"go 1", STOP]


async def test_tick_that_waited_too_long_leaves_a_running_motion_alone(rig: Rig) -> None:
    """The old tick neither renews nor ends it."""
    await rig.drive()
    await rig.clock.advance(0.1)
    rig.tick(b"go 2")
    rig.guard.channel.post(messages.RenewLease("drive", 9, b"old", rig.clock.now() - 0.3))
    await rig.clock.advance(0.1)
    rig.tick(b"go 3")
    await rig.clock.advance(0.1)
    assert rig.robot.written == [b"go 1", b"go 2", b"go 3"]


async def test_tick_that_waited_too_long_writes_nothing_to_a_robot_at_rest(rig: Rig) -> None:
    await rig.transport.open(1.0)
    rig.guard.arm("drive", TERMS)
    rig.guard.channel.post(messages.RenewLease("drive", 1, b"old", rig.clock.now() - 0.3))
    await rig.clock.advance(1.0)
    assert rig.robot.written == [], "neither motion nor a stop"
    rig.tick(b"go")
    await settle()
    assert rig.robot.written == [b"go"], "nor does it disarm the control"


async def test_stop_is_the_newest_that_was_made(rig: Rig) -> None:
    """Where it carries a number, the one before may count no more. It arms nothing."""
    rig.guard.renew("drive", b"nobody")
    await rig.drive()
    rig.guard.renew("drive", b"stop 2")
    await rig.clock.advance(0.3)
    assert rig.robot.written == [b"go 1", b"stop 2"]
    rig.guard.renew("drive", b"stop 3")
    rig.tick(b"go 2")
    await rig.clock.advance(0.1)
    assert rig.robot.written == [b"go 1", b"stop 2"]
    rig.guard.stop({"drive": b"stop 4"})
    assert rig.robot.written == [b"go 1", b"stop 2", b"stop 4"]


async def test_owed_stop_is_the_newest_too(rig: Rig) -> None:
    await rig.drive()
    rig.guard.renew("drive", b"stop 2")
    rig.robot.cut()
    await rig.clock.advance(0.1)
    assert rig.robot.written == [b"go 1", b"stop 2"]


async def test_stop_that_still_waits_when_the_line_is_cut_is_owed(rigs: list[Rig]) -> None:
    """The motion before it got through; that says nothing about the stop."""
    robot = GatedWire()
    rigs.append(rig := Rig(robot))
    await rig.drive()
    rig.guard.release("drive")
    robot.let_through()
    await settle()
    assert robot.written == [b"go 1"]
    robot.cut()
    await rig.clock.advance(0.1)
    robot.let_through(10)
    await rig.clock.advance(0.1)
    assert robot.written == [b"go 1", STOP]
    assert await rig.stops() == [("drive", "revoked")]


async def test_cut_line_is_opened_by_the_guard_itself(rig: Rig) -> None:
    """And is kept for the engine, which gets it at its next attempt."""
    await rig.drive()
    rig.robot.refusal = "nothing listens"
    assert isinstance(rig.robot, CountedWire)
    rig.robot.cut()
    await rig.clock.advance(1.0)
    assert rig.robot.opens > 10
    assert rig.robot.written == [b"go 1"]
    rig.robot.refusal = ""
    await rig.clock.advance(0.1)
    assert rig.robot.written == [b"go 1", STOP]
    opens = rig.robot.opens
    await rig.transport.open(1.0)
    assert rig.robot.opens == opens
    await rig.transport.send(b"hello")
    assert rig.robot.written == [b"go 1", STOP, b"hello"]


async def test_cuts_have_no_end(rig: Rig) -> None:
    """A thousandth cut is as the first."""
    await rig.drive()
    for number in range(300):
        rig.robot.cut()
        await rig.clock.advance(0.1)
        assert rig.robot.written[-1] == STOP
        await rig.transport.open(1.0)
        rig.guard.arm("drive", TERMS)
        rig.tick(b"go on")
        await settle()
        assert rig.robot.written[-1] == b"go on"
        assert rig.robot.opens == number + 2


async def test_engine_waits_for_a_rescue_as_for_any_robot(rig: Rig) -> None:
    await rig.drive()
    rig.robot.refusal = "nothing listens"
    rig.robot.cut()
    await rig.clock.advance(0.1)
    opening = asyncio.ensure_future(rig.transport.open(0.5))
    await rig.clock.advance(0.4)
    assert not opening.done()
    await rig.clock.advance(0.2)
    with pytest.raises(ConnectFailed, match="nothing listens"):
        await opening
    opening = asyncio.ensure_future(rig.transport.open(0.5))
    await rig.clock.advance(0.2)
    rig.robot.refusal = ""
    await rig.clock.advance(0.1)
    await opening
    assert rig.robot.written == [b"go 1", STOP]


async def test_rescued_line_that_nobody_wants_is_closed(rig: Rig) -> None:
    await rig.drive()
    rig.robot.cut()
    await rig.clock.advance(0.1)
    assert rig.robot.is_open
    await rig.clock.advance(10.0)
    assert not rig.robot.is_open


async def test_rescue_has_an_end(rig: Rig) -> None:
    """A robot that is gone for good is left to the engine; the stop stays owed."""
    await rig.drive()
    rig.robot.refusal = "nothing listens"
    rig.robot.cut()
    await rig.clock.advance(100.0)
    opens = rig.robot.opens
    await rig.clock.advance(100.0)
    assert rig.robot.opens == opens
    rig.robot.refusal = ""
    await rig.transport.open(1.0)
    assert rig.robot.written == [b"go 1", STOP]


async def test_line_that_was_at_rest_is_left_to_the_engine(rig: Rig) -> None:
    await rig.drive()
    rig.guard.release("drive")
    await rig.clock.advance(0.1)
    rig.robot.cut()
    await rig.clock.advance(5.0)
    assert rig.robot.opens == 1


async def test_stop_on_a_closed_line_is_the_first_thing_on_it(rig: Rig) -> None:
    rig.guard.stop({"drive": STOP})
    await rig.clock.advance(1.0)
    assert rig.robot.opens == 0, "nothing moved: nobody is in a hurry"
    await rig.transport.open(1.0)
    assert rig.robot.written == [STOP]
    assert await rig.stops() == [("drive", "revoked")]


async def test_stop_needs_no_motion(rig: Rig) -> None:
    await rig.transport.open(1.0)
    rig.guard.stop({"drive": STOP, "turn": b"halt"})
    assert rig.robot.written == [STOP, b"halt"]
    assert await rig.stops() == [("drive", "stopped"), ("turn", "stopped")]


async def test_stop_is_repeated_where_it_may_be_lost(rig: Rig) -> None:
    await rig.drive(TERMS._replace(is_lossy=True))
    rig.guard.release("drive")
    await rig.clock.advance(5.0)
    assert rig.robot.written == [b"go 1"] + [STOP] * 11
    assert await rig.stops() == [("drive", "released")]


async def test_closing_stops_before(rig: Rig) -> None:
    await rig.drive()
    await rig.transport.close()
    await rig.clock.advance(5.0)
    assert rig.robot.written == [b"go 1", STOP]
    assert not rig.robot.is_open
    assert rig.robot.opens == 1


async def test_stop_that_did_not_get_through_is_owed_after_closing(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proxy, "_CLOSE_S", 0.02)  # of real time, and it is waited for in full
    robot = rig.robot
    assert isinstance(robot, CountedWire)
    await rig.drive()
    robot.is_stuck = True
    closing = asyncio.ensure_future(rig.transport.close())
    while not closing.done():
        await rig.clock.advance(1.0)
    robot.is_stuck = False
    robot.stuck_bytes = 0
    await rig.clock.advance(0.3)
    assert robot.opens == 2
    assert robot.written == [b"go 1", STOP, STOP]


async def test_stuck_line_is_reset_when_it_is_closed(
    rigs: list[Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system would deliver the motion later, after the stop on the next connection."""
    monkeypatch.setattr(proxy, "_CLOSE_S", 0.02)  # as above
    robot = CountedWire()
    rigs.append(rig := Rig(robot, stalled_s=1.0, is_strict=True))
    await rig.drive()
    robot.is_stuck = True
    robot.stuck_bytes = 5
    closing = asyncio.ensure_future(rig.transport.close())
    await rig.clock.advance(0.9)
    assert (robot.aborts, robot.opens) == (1, 2)
    assert robot.written[-1] == STOP
    await closing


async def test_end_of_the_guard_stops_before(rig: Rig) -> None:
    await rig.drive()
    finishing = asyncio.ensure_future(rig.guard.finish())
    while not finishing.done():
        await rig.clock.advance(0.05)
    assert rig.robot.written == [b"go 1", STOP]
    assert not rig.robot.is_open


async def test_messages_are_motion_too(rigs: list[Rig]) -> None:
    """A transport of messages takes envelopes, and says nothing of bytes."""
    go, halt = Envelope("publish", {"topic": "/v"}, {"x": 1}), Envelope("publish", {}, {"x": 0})
    rig = Rig(Wire())
    rigs.append(rig)
    await rig.transport.open(1.0)
    rig.guard.arm("drive", TERMS._replace(stop=halt))
    rig.tick(go)
    await settle()
    rig.guard.release("drive")
    await settle()
    assert rig.robot.written == [go, halt]


async def test_new_guard_opens_and_stops_what_moved(rig: Rig) -> None:
    """It is told what the one before it cannot tell any more."""
    rig.guard.channel.post(messages.RecoverStop("wire", "drive", TERMS))
    await rig.clock.advance(0.1)
    assert rig.robot.opens == 1
    assert rig.robot.written == [STOP]


async def test_two_controls_stop_before_either_moves(rig: Rig) -> None:
    await rig.drive()
    rig.guard.arm("turn", TERMS._replace(stop=b"halt"))
    await rig.clock.advance(0.24)
    rig.guard.tick("turn", b"left")
    await rig.clock.advance(0.011)
    rig.guard.tick("turn", b"right")
    await rig.clock.advance(0.05)
    assert rig.robot.written[:3] == [b"go 1", b"left", STOP]


async def test_opening_that_took_long_once_does_not_make_the_next_attempts_slow(rig: Rig) -> None:
    """The quickest opening counts, not the slowest."""
    robot = rig.robot
    await rig.drive()
    patience: list[float] = []
    whole = robot.open

    async def late(timeout_s: float) -> None:
        patience.append(timeout_s)
        if len(patience) == 1:
            await rig.clock.sleep(0.06)
        await whole(timeout_s)

    robot.open = late  # type: ignore[method-assign]
    for _ in range(3):
        robot.cut()
        await rig.clock.advance(0.3)
        await rig.transport.open(1.0)
        rig.guard.arm("drive", TERMS)
        rig.tick(b"go on")
        await settle()
    assert patience == [0.07, 0.07, 0.07]


async def test_engine_may_take_as_much_as_it_likes_where_there_is_no_process(rig: Rig) -> None:
    """What it took is counted there too, so the robot is read on."""
    await rig.transport.open(1.0)
    for number in range(40):
        rig.robot.arriving.put_nowait(bytes([number]) * 4096)
    async with asyncio.timeout(5.0):
        for number in range(40):
            assert await rig.transport.receive() == bytes([number]) * 4096


async def test_what_arrives_counts_with_its_envelope(rig: Rig) -> None:
    """So many small things take no more memory than a few large ones."""
    channel = rig.guard.channel
    assert isinstance(channel, LocalChannel)
    assert channel._emit(messages.BytesReceived("wire", 1, b"four")) == 36
    assert channel._emit(messages.SendDone("wire", 1, 1)) == 0


async def test_a_tick_without_bytes_renews_the_lease_and_writes_nothing(rig: Rig) -> None:
    """Motion waits for an answer that the robot owes: it goes on, and is stopped as ever."""
    await rig.drive()
    for _ in range(4):
        await rig.clock.advance(0.1)
        rig.tick(b"")
    assert rig.robot.written == [b"go 1"]
    await rig.clock.advance(0.3)
    assert rig.robot.written == [b"go 1", STOP]


async def test_control_may_be_stopping_for_a_while_after_its_stop_was_told(rig: Rig) -> None:
    """It may be repeated, and whoever hears of it is behind."""
    assert not rig.guard.is_stopping("drive")
    await rig.drive()
    assert not rig.guard.is_stopping("turn")
    assert rig.guard.is_stopping("drive")
    await rig.clock.advance(5.0)
    rig.tick(b"refused, as is known")
    assert not rig.guard.is_stopping("drive")
    rig.guard.arm("drive", TERMS)
    rig.tick(b"go")
    rig.guard.release("drive")
    await rig.clock.advance(0.875)
    assert rig.guard.is_stopping("drive")
    await rig.clock.advance(0.125)
    assert not rig.guard.is_stopping("drive")


async def test_control_that_is_armed_again_may_still_be_moving(rig: Rig) -> None:
    await rig.drive()
    rig.guard.arm("drive", TERMS)
    assert rig.guard.is_stopping("drive")


async def test_only_frames_with_counters_are_passed_on_with_what_they_count(rig: Rig) -> None:
    await rig.drive()
    caught = rig.caught()
    count = Count({}, {"n": 7})
    rig.guard.tick("drive", b"go")
    rig.guard.tick("drive", CountedFrame(Numbered(b"7 go", count), lambda: None))
    assert [one.count for _, one in caught if isinstance(one, messages.RenewLease)] == [None, count]


async def test_unread_stops_are_bounded(rig: Rig) -> None:
    """The newest are kept."""
    for number in range(1000):
        rig.guard.handle(messages.StopWritten(f"control {number}", "expired", 1), 0)
    stops = await rig.stops()
    assert len(stops) < 500
    assert stops[-1] == ("control 999", "expired")


async def test_session_is_told_that_the_counters_of_an_opened_line_are_settled(rig: Rig) -> None:
    told: list[object] = []
    rig.guard.on_stand = lambda *stand: told.append(stand)
    await rig.transport.open(1.0)
    assert told == [("wire", {}, True)]


async def test_line_has_the_address_of_its_transport_before_it_is_opened(rig: Rig) -> None:
    assert rig.transport.address == "wire"


async def test_tick_whose_number_was_used_up_is_made_again_whatever_else_was(rig: Rig) -> None:
    """Unless it was let go meanwhile, or a newer one is under way; it is as old as it was."""
    await rig.drive()
    rig.guard.arm("turn", TERMS._replace(stop=b"halt"))
    first = Numbered(b"7 left", Count({}, {"n": 7}))
    again = Numbered(b"8 left", Count({"n": 7}, {"n": 8}))
    rig.guard.tick("turn", CountedFrame(first, lambda: again))
    caught = rig.caught()
    rig.guard.handle(
        messages.CountersAdvanced("wire", 1, 0, {}, [("drive", 1), ("lift", 1), ("turn", 1)]), 0
    )
    ((slot, tick),) = caught
    assert isinstance(tick, messages.RenewLease)
    assert (slot, tick.data) == ("turn", b"8 left")
    rig.guard.handle(messages.CountersAdvanced("wire", 1, 0, {}, [("turn", 9)]), 0)
    rig.guard.release("turn")
    rig.guard.handle(messages.CountersAdvanced("wire", 1, 0, {}, [("turn", 1)]), 0)
    assert len(caught) == 1


async def test_tick_whose_number_was_used_up_is_not_made_again_after_the_guards_stop(
    rig: Rig,
) -> None:
    await rig.drive()
    first = Numbered(b"7 go", Count({}, {"n": 7}))
    rig.guard.tick("drive", CountedFrame(first, lambda: first))
    caught = rig.caught()
    rig.guard.handle(messages.StopWritten("drive", "expired", 2), 0)
    rig.guard.handle(messages.CountersAdvanced("wire", 1, 0, {}, [("drive", 2)]), 0)
    assert caught == []


async def test_line_that_is_lost_disarms_also_what_is_at_rest(rig: Rig) -> None:
    """Else the engine would count ticks as motion that the guard drops."""
    await rig.drive()
    rig.guard.release("drive")
    await rig.clock.advance(0.1)
    assert rig.guard.is_armed("drive")
    rig.robot.cut()
    await rig.clock.advance(0.1)
    assert not rig.guard.is_armed("drive")
    await rig.transport.open(1.0)
    rig.guard.arm("drive", TERMS)
    rig.tick(b"go 2")
    await settle()
    assert rig.robot.written == [b"go 1", STOP, b"go 2"]


async def test_tick_that_crosses_the_report_of_a_stop_leaves_no_stop_due(rig: Rig) -> None:
    """The server was blocked: the report and the next tick are on their way at the same time."""
    await rig.drive()
    rig.guard.tick("drive", b"dropped by the guard")
    rig.guard.handle(messages.StopWritten("drive", "expired", 1), 0)
    assert not rig.guard.owes_stop("drive")
    rig.guard.tick("drive", b"dropped here")
    assert not rig.guard.owes_stop("drive")


async def test_late_report_of_an_older_stop_disarms_no_new_gesture(rig: Rig) -> None:
    await rig.drive()
    rig.guard.arm("drive", TERMS)
    rig.guard.handle(messages.StopWritten("drive", "expired", 1), 0)
    assert rig.guard.is_armed("drive")
    rig.tick(b"go 2")
    await settle()
    assert rig.robot.written == [b"go 1", b"go 2"]


async def test_stop_that_waits_in_the_queue_is_reported_with_the_tick_it_stopped(
    rigs: list[Rig],
) -> None:
    """A new gesture meanwhile keeps its control armed, and its own stop due."""
    robot = GatedWire()
    rigs.append(rig := Rig(robot))
    await rig.drive()
    robot.let_through()
    await settle()
    rig.guard.stop({"drive": STOP})
    rig.guard.arm("drive", TERMS)
    rig.tick(b"go 2")
    robot.let_through()
    await settle()
    assert robot.written == [b"go 1", STOP]
    assert rig.guard.is_armed("drive")
    assert rig.guard.owes_stop("drive")
