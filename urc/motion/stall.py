"""Detection of stalled connections by the age of the oldest unsent byte.

The system reports only the number of unsent bytes. Each write increases the number of unsent bytes.
Each acknowledgement decreases the number, starting with the oldest bytes. The write time of the
oldest unsent byte can therefore be computed from earlier counts of unsent bytes. A large number of
unsent bytes does not prove a stall, because a busy connection may always have unsent bytes.
"""

import sys
from collections import deque
from typing import Final

__all__ = [
    "AFRESH_S",
    "IN_FLIGHT_S",
    "SHORTEST_CUT_S",
    "STALLED_S",
    "STOP_WITHIN_S",
    "TICK_S",
    "WAITED_S",
    "StallWatch",
]

SHORTEST_CUT_S: Final = 0.2
"""Shortest network interruption for which `STOP_WITHIN_S` is guaranteed, in seconds."""
STOP_WITHIN_S: Final = 0.1
"""Maximum time between the end of a network interruption and the stop, in seconds."""
TICK_S: Final = 0.05
"""Period of the ticks of a held control, in seconds. After an interruption begins, up to one such
period may pass before the first write."""
AFRESH_S: Final = 0.03
"""Time for resetting and reopening the connection to a nearby robot and writing the stop, in
seconds."""
STALLED_S: Final = round(SHORTEST_CUT_S + STOP_WITHIN_S - TICK_S - AFRESH_S, 3)
"""Age of unsent bytes at which a connection counts as stalled, in seconds. A stalled connection is
reset and reopened; otherwise, the kernel would deliver the old bytes later. A byte written one tick
period after the shortest interruption begins reaches this age just in time."""
WAITED_S: Final = 1.0
"""Age of unsent bytes at which a connection that is slow to open counts as stalled, in seconds."""
IN_FLIGHT_S: Final = 0.15
"""Maximum age of unacknowledged bytes on a healthy connection, in seconds. Operating systems delay
acknowledgements: Linux by up to 40 ms, and small TCP stacks until a second segment arrives."""
_TOGETHER_S: Final = 0.005
_MOST: Final = 256


class StallWatch:
    """Detects whether one connection has stalled."""

    __slots__ = ("_marks", "_taken", "_written", "limit_s")

    def __init__(self, limit_s: float = STALLED_S) -> None:
        self.limit_s = limit_s
        self._marks: deque[tuple[float, int]] = deque()
        """Time of each write, with the total number of bytes written by then."""
        self._written = 0
        self._taken = 0

    @property
    def deadline(self) -> float | None:
        """Time at which the connection counts as stalled unless the oldest bytes are sent first."""
        return self._marks[0][0] + self.limit_s if self._marks else None

    def age_s(self, now: float) -> float:
        """Return the age of the oldest unsent bytes in seconds; 0 if no bytes are unsent."""
        return now - self._marks[0][0] if self._marks else 0.0

    def saw(self, unsent: int, now: float) -> bool:
        """Record the number of unsent bytes; return whether the connection is stalled.

        Call this method immediately before each write and regularly between writes.
        """
        if not unsent:
            self.reset()
            return False
        change = unsent - (self._written - self._taken)
        if change > 0:
            self._written += change
            self._mark(now)
        elif change < 0:
            self._taken -= change
            while self._marks and self._marks[0][1] <= self._taken:
                self._marks.popleft()
        return self.age_s(now) >= self.limit_s

    def wrote(self, size: int, now: float) -> None:
        """Record a write of `size` bytes; the next `saw` call records how many bytes are unsent."""
        self._written += size
        self._mark(now)

    def gave_up(self) -> None:
        """Record that the unsent bytes will never be sent; later bytes inherit their age."""
        if self._marks:
            began = self._marks[0][0]
            self._marks.clear()
            self._marks.append((began, sys.maxsize))
        self._written = self._taken = 0

    def reset(self) -> None:
        """Reset the watch, as if all bytes had been sent."""
        self._marks.clear()
        self._written = self._taken = 0

    def _mark(self, now: float) -> None:
        marks = self._marks
        if marks and (now - marks[-1][0] < _TOGETHER_S or len(marks) >= _MOST):
            marks[-1] = marks[-1][0], self._written
        else:
            marks.append((now, self._written))
