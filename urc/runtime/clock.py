"""Time, as an argument: the real one here, a fake one in `urc.testing`."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Protocol

__all__ = ["Alarm", "Clock", "LoopClock", "within"]


class Alarm(Protocol):
    """A call that is due later, and can be called off."""

    def cancel(self) -> None:
        """Call it off; harmless when it has already been made."""


class Clock(Protocol):
    """The only source of time for everything that runs a robot."""

    def now(self) -> float:
        """Return monotonic seconds."""

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds`."""

    def call_at(self, time_s: float, action: Callable[[], None]) -> Alarm:
        """Make `action` run at `time_s` on this clock, or at once when that is past."""


class LoopClock:
    """The running event loop's time."""

    def now(self) -> float:
        """Return monotonic seconds."""
        return time.monotonic()

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds`."""
        await asyncio.sleep(seconds)

    def call_at(self, time_s: float, action: Callable[[], None]) -> Alarm:
        """Make `action` run at `time_s`, or at once when that is past."""
        # Relative to our own reading: other loops' clocks need not start where this one does.
        return asyncio.get_running_loop().call_later(max(0.0, time_s - self.now()), action)


@asynccontextmanager
async def within(clock: Clock, seconds: float) -> AsyncIterator[None]:
    """Raise `TimeoutError` out of the block when it takes longer than `seconds` on `clock`."""
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(None) as scope:
        alarm = clock.call_at(clock.now() + seconds, lambda: scope.reschedule(loop.time()))
        try:
            yield
        finally:
            alarm.cancel()
