"""The end of a line: what is left of it keeps nothing waiting, and comes back in no other one."""

import asyncio

import pytest

from tests.unit.guard.lines import STOP, TERMS, Bench, CountedWire, ScatteredWire
from urc.guard import guarded_connection, messages
from urc.testing.clock import settle
from urc.transports.base import PeerClosed

pytestmark = pytest.mark.anyio

BOUND_S = 5.0


async def finish(bench: Bench) -> None:
    """End the guard, which has a bounded time for it."""
    finishing = asyncio.ensure_future(bench.host.finish())
    async with asyncio.timeout(BOUND_S):
        while not finishing.done():
            await bench.clock.advance(0.1)
            await asyncio.sleep(0.001)


class Hanging(CountedWire):
    """One that does not close."""

    async def close(self) -> None:
        await asyncio.Event().wait()


class Stubborn(CountedWire):
    """One whose reading does not end when it is told to."""

    def __init__(self) -> None:
        super().__init__()
        self.relents = asyncio.Event()

    async def receive(self) -> bytes:
        while not self.relents.is_set():
            try:
                await self.relents.wait()
            except asyncio.CancelledError:
                continue
        raise PeerClosed("at last")


class Broken(CountedWire):
    """One with a bug in its close."""

    async def close(self) -> None:
        raise RuntimeError("no such handle")


async def test_fault_of_a_connection_that_was_closed_does_not_cut_the_next_one() -> None:
    bench = Bench(CountedWire())
    await bench.open(1)
    of_the_first = bench.robot.arriving
    bench.tell(messages.CloseLine("wire", 1))
    await settle()
    assert bench.heard() == [messages.LineClosed("wire", 1)]
    await bench.open(2)
    of_the_first.put_nowait(PeerClosed("too late"))
    await settle()
    assert bench.heard() == []
    assert bench.robot.is_open
    await finish(bench)


async def test_owed_stop_is_written_after_an_attempt_of_the_engine_that_failed() -> None:
    """Nothing is left of that attempt; the guard opens the line by itself."""
    bench = Bench(CountedWire())
    bench.robot.refusal = "nothing listens"
    bench.tell(messages.OpenLine("wire", 1, 1.0))
    await settle()
    assert bench.heard() == [messages.OpenFailed("wire", 1, "nothing listens")]
    bench.robot.refusal = ""
    bench.tell(messages.RecoverStop("wire", "drive", TERMS))
    await bench.clock.advance(0.1)
    assert bench.robot.written == [STOP]
    await finish(bench)


async def test_last_stop_is_not_thrown_away_at_the_end() -> None:
    """A line that takes what it is given is closed; a reset would drop what is still under way."""
    bench = Bench(robot := CountedWire())
    await bench.drive()
    await finish(bench)
    assert robot.written == [b"go 1", STOP]
    assert (robot.is_open, robot.aborts) == (False, 0)


async def test_reading_that_does_not_end_does_not_hold_up_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        guarded_connection, "_CLOSE_S", 0.01
    )  # of real time, and it is waited for in full
    bench = Bench(robot := Stubborn())
    await bench.drive()
    try:
        await finish(bench)
        assert robot.written == [b"go 1", STOP]
        assert not robot.is_open
    finally:
        robot.relents.set()
        await settle()


async def test_line_that_does_not_close_does_not_hold_up_the_end(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(guarded_connection, "_CLOSE_S", 0.01)  # as above
    bench = Bench(robot := Hanging())
    await bench.drive()
    await finish(bench)
    assert robot.written == [b"go 1", STOP]
    assert "wire did not close in time" in caplog.text


async def test_log_says_why_a_line_could_not_be_closed(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(Broken())
    await bench.open()
    await finish(bench)
    assert "no such handle" in caplog.text


class Faulty(CountedWire):
    """A wire whose `unsent` and `offer`, or only one of them, raise an exception."""

    def __init__(self, *faults: str) -> None:
        super().__init__()
        self.is_faulty = False
        self._faults = faults or ("unsent", "offer")

    def unsent(self) -> int:
        self._fail("unsent")
        return super().unsent()

    def offer(self, data: bytes) -> bool:
        self._fail("offer")
        return super().offer(data)

    def _fail(self, name: str) -> None:
        if self.is_faulty and name in self._faults:
            raise RuntimeError("no such socket")

    async def abort(self) -> None:
        self.is_faulty = False
        await super().abort()


async def test_bug_of_a_transport_ends_no_lease_timer(benches: list[Bench]) -> None:
    """Its line is reset, and the stop is the first on the next one."""
    robot = Faulty()
    benches.append(bench := Bench(robot))
    await bench.drive()
    robot.is_faulty = True
    await bench.clock.advance(0.5)
    assert robot.written == [b"go 1", STOP]
    assert robot.opens == 2


async def test_bug_of_a_transport_at_the_release_loses_no_stop(benches: list[Bench]) -> None:
    robot = Faulty()
    benches.append(bench := Bench(robot))
    await bench.drive()
    await bench.clock.advance(0.05)
    robot.is_faulty = True
    bench.tell(messages.ReleaseControl("drive"))
    await bench.clock.advance(0.2)
    assert robot.written[:2] == [b"go 1", STOP]
    assert set(robot.written[1:]) == {STOP}, "the queue took it, and it comes first again"


async def test_stop_that_a_faulty_transport_did_not_take_is_not_reported(
    benches: list[Bench],
) -> None:
    """Only the stop on the next connection counts."""
    robot = Faulty("offer")
    benches.append(bench := Bench(robot))
    await bench.drive()
    await bench.clock.advance(0.05)
    bench.heard()
    robot.is_faulty = True
    bench.tell(messages.ReleaseControl("drive"))
    assert not any(isinstance(one, messages.StopWritten) for one in bench.heard())
    await bench.clock.advance(0.2)
    assert robot.opens == 2
    assert any(isinstance(one, messages.StopWritten) for one in bench.heard())


async def test_frame_that_a_faulty_transport_did_not_take_is_sent_by_the_queue(
    benches: list[Bench],
) -> None:
    robot = Faulty("offer")
    benches.append(bench := Bench(robot))
    await bench.open()
    robot.is_faulty = True
    bench.tell(messages.SendBytes("wire", 1, 1, b"poll"))
    await bench.clock.advance(0.3)
    assert robot.written == [b"poll"]
    assert robot.aborts == 1


async def test_stop_stays_in_doubt_while_a_faulty_transport_cannot_count(
    benches: list[Bench],
) -> None:
    """The reset discards the stop, so it is due again."""
    robot = Faulty("unsent")
    benches.append(bench := Bench(robot))
    await bench.drive()
    await bench.clock.advance(0.05)
    robot.is_stuck = True
    bench.tell(messages.ReleaseControl("drive"))
    bench.heard()
    robot.is_faulty = True
    await bench.clock.advance(0.2)
    assert messages.StopDue("drive") in bench.heard()


class Unforgetful(ScatteredWire):
    """A wire whose `forget` raises an exception until it is reset."""

    is_faulty = True

    def forget(self) -> None:
        if self.is_faulty:
            raise RuntimeError("no such socket")
        super().forget()

    async def abort(self) -> None:
        self.is_faulty = False
        await super().abort()


async def test_transport_that_cannot_forget_is_reset_for_the_stop(benches: list[Bench]) -> None:
    robot = Unforgetful()
    benches.append(bench := Bench(robot))
    await bench.drive()
    await bench.clock.advance(0.05)
    bench.tell(messages.ReleaseControl("drive"))
    await bench.clock.advance(0.3)
    assert robot.opens == 2
    assert robot.written[-1] == STOP
