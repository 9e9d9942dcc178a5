"""A watchdog for the event loop; a blocked loop delays all work in this process.

If the loop is blocked, the guard stops motion when the lease expires. The watchdog detects, counts
and reports each delay. After a long delay, motion continues only with a new gesture.
"""

import logging
from collections.abc import Callable
from typing import Final

from urc.runtime.clock import Clock, Timer

__all__ = ["EVERY_S", "LATE_S", "TOO_LATE_S", "LoopWatchdog"]

EVERY_S: Final = 0.1
LATE_S: Final = 0.1
"""Minimum delay that is counted and reported, in seconds."""
TOO_LATE_S: Final = 0.5
"""Delay, in seconds, after which motion is stopped even if the lease is still valid."""
QUIET_S: Final = 10.0
"""Maximum time between two delays that count as one series, in seconds. Only the first delay
of a series is logged."""

log = logging.getLogger(__name__)


class LoopWatchdog:
    """A periodic check for a blocked event loop."""

    def __init__(self, clock: Clock, late: Callable[[float, bool], None]) -> None:
        """Create the watchdog.

        Args:
            clock: source of time.
            late: callback that receives each counted delay in seconds, and whether it is the first
                of a series.
        """
        self._clock = clock
        self._late = late
        self._alarm: Timer | None = None
        self._due_s = 0.0
        self._noticed_s = float("-inf")
        self.count = 0
        """Number of delays so far."""
        self.worst_s = 0.0
        """Longest delay, in seconds."""

    def start(self) -> None:
        """Start the checks."""
        self.end()
        self._due_s = self._clock.now() + EVERY_S
        self._alarm = self._clock.call_at(self._due_s, self._check)

    def end(self) -> None:
        """End the checks; a second call does nothing."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _check(self) -> None:
        now = self._clock.now()
        late_s = now - self._due_s
        if late_s > LATE_S:
            self._notice(late_s, now)
        self.start()

    def _notice(self, late_s: float, now: float) -> None:
        is_first = now - self._noticed_s > QUIET_S
        self._noticed_s = now
        self.count += 1
        self.worst_s = max(self.worst_s, late_s)
        if is_first:
            log.warning("the server was blocked for %.0f ms", late_s * 1000)
        self._late(late_s, is_first)
