"""The clock of the event loop, and timers. `urc.testing` has a fake clock for tests."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Protocol

__all__ = ["Timer", "Clock", "LoopClock", "PeriodicTimer", "within"]


class Timer(Protocol):
    """A scheduled call that can be cancelled."""

    def cancel(self) -> None:
        """Cancel the call; do nothing if the call has already been made."""


class Clock(Protocol):
    """The interface of clocks; all code that runs a robot gets the time only from a clock."""

    def now(self) -> float:
        """Return monotonic seconds."""

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds`."""

    def call_at(self, time_s: float, action: Callable[[], None]) -> Timer:
        """Call `action` at `time_s` on this clock, or immediately if `time_s` has passed."""


class LoopClock:
    """A clock that reads the time of the running event loop."""

    now = staticmethod(time.monotonic)
    """Return monotonic seconds."""

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds`."""
        await asyncio.sleep(seconds)

    def call_at(self, time_s: float, action: Callable[[], None]) -> Timer:
        """Call `action` at `time_s`, or immediately if `time_s` has passed."""
        # Relative to `now`, because an event loop's own clock may start at a different zero.
        return asyncio.get_running_loop().call_later(max(0.0, time_s - self.now()), action)


class PeriodicTimer:
    """A timer that calls an action repeatedly.

    The action returns the number of seconds until its next call, or None to end the timer.
    """

    def __init__(self, clock: Clock, delay_s: float, action: Callable[[], float | None]) -> None:
        self._clock = clock
        self._action = action
        self._alarm: Timer = clock.call_at(clock.now() + delay_s, self._ring)

    def cancel(self) -> None:
        """Cancel all further calls."""
        self._alarm.cancel()

    def _ring(self) -> None:
        delay_s = self._action()
        if delay_s is not None:
            self._alarm = self._clock.call_at(self._clock.now() + delay_s, self._ring)


@asynccontextmanager
async def within(clock: Clock, seconds: float) -> AsyncIterator[None]:
    """Raise `TimeoutError` if the block takes longer than `seconds`, measured by `clock`."""
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(None) as scope:
        alarm = clock.call_at(clock.now() + seconds, lambda: scope.reschedule(loop.time()))
        try:
            yield
        finally:
            alarm.cancel()
