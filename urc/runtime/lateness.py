"""Watches how late the event loop is: what holds it up holds up everything in this process.

Motion stops without it, in the guard, when its lease runs out. Here it is noticed, counted and
told, and whoever drives begins anew after a long one.
"""

import logging
from collections.abc import Callable
from typing import Final

from urc.runtime.clock import Alarm, Clock

__all__ = ["EVERY_S", "LATE_S", "TOO_LATE_S", "LoopWatch"]

EVERY_S: Final = 0.1
LATE_S: Final = 0.1
"""Later than this is counted and told."""
TOO_LATE_S: Final = 0.5
"""Later than this, what moves is stopped, whatever its lease says."""
QUIET_S: Final = 10.0
"""Those that come closer together than this are told once."""

log = logging.getLogger(__name__)


class LoopWatch:
    """Looks at the clock again and again while it is started."""

    def __init__(self, clock: Clock, late: Callable[[float, bool], None]) -> None:
        """Prepare.

        Args:
            clock: the time.
            late: has each lateness that counts, in seconds, and whether it is the first of several
                that came close together.
        """
        self._clock = clock
        self._late = late
        self._alarm: Alarm | None = None
        self._due_s = 0.0
        self._noticed_s = float("-inf")
        self.count = 0
        """How often it was late, since it was made."""
        self.worst_s = 0.0
        """The longest of them."""

    def start(self) -> None:
        """Begin to look."""
        self.end()
        self._due_s = self._clock.now() + EVERY_S
        self._alarm = self._clock.call_at(self._due_s, self._look)

    def end(self) -> None:
        """Look no more; may be called twice."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _look(self) -> None:
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
            log.warning("the server was held up for %.0f ms", late_s * 1000)
        self._late(late_s, is_first)
