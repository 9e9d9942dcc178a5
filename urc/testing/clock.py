"""A fake clock that only a test advances."""

import asyncio
import heapq
from collections.abc import Callable
from itertools import count

__all__ = ["FakeClock", "settle"]

_TURNS = 30
"""Number of event loop turns that is enough for all ready tasks to run. Every chain of tasks in URC
that make each other ready is shorter."""
_QUIET_TURNS = 3
"""Number of consecutive turns without a ready task after which the event loop counts as idle."""


async def settle() -> None:
    """Let the event loop run until every task is waiting."""
    # The loop's queue of ready callbacks; a loop without this queue gets all turns.
    ready = getattr(asyncio.get_running_loop(), "_ready", None)
    quiet = 0
    for _ in range(_TURNS):
        await asyncio.sleep(0)
        quiet = 0 if ready is None or ready else quiet + 1
        if quiet == _QUIET_TURNS:
            return


class _FakeAlarm:
    def __init__(self, action: Callable[[], None]) -> None:
        self.action: Callable[[], None] | None = action

    def cancel(self) -> None:
        self.action = None


class FakeClock:
    """A replacement for `urc.runtime.clock.LoopClock`; the time starts at `start_s`."""

    def __init__(self, start_s: float = 1000.0) -> None:
        self._now = start_s
        self._due: list[tuple[float, int, _FakeAlarm]] = []
        self._numbers = count()

    def now(self) -> float:
        """Return the current fake time, in seconds."""
        return self._now

    async def sleep(self, seconds: float) -> None:
        """Wait until `advance` has moved the time by `seconds`; return immediately for zero."""
        if seconds <= 0:
            await asyncio.sleep(0)
            return
        done = asyncio.Event()
        alarm = self.call_at(self._now + seconds, done.set)
        try:
            await done.wait()
        finally:
            alarm.cancel()

    def call_at(self, time_s: float, action: Callable[[], None]) -> _FakeAlarm:
        """Call `action` when `advance` reaches the time `time_s`."""
        alarm = _FakeAlarm(action)
        heapq.heappush(self._due, (time_s, next(self._numbers), alarm))
        return alarm

    async def hold_up(self, seconds: float) -> None:
        """Advance time without running calls, then run overdue calls, as a blocked loop does."""
        self._now += seconds
        await self.advance(0)

    async def advance(self, seconds: float) -> None:
        """Advance the time; run each due call, and the tasks that it makes ready, in order."""
        end_s = self._now + seconds
        await settle()
        while self._due and self._due[0][0] <= end_s:
            due_s, _, alarm = heapq.heappop(self._due)
            if alarm.action is not None:
                self._now = max(self._now, due_s)
                alarm.action()
                await settle()
        self._now = end_s
        await settle()
