"""Does a line still take what is written? Told by the bytes that have not left for good.

Only their number is known. It grows by what is written and shrinks by what the other side has
acknowledged, in that order; so from its course follows when the oldest of them was written. That is
what counts: on a line that is written to all the time there may always be some.
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
"""A cut of the link that lasts as long as this, or longer, ..."""
STOP_WITHIN_S: Final = 0.1
"""... is followed by the stop within this time of its end."""
TICK_S: Final = 0.05
"""Of a hand that holds a control: as long may it take after a cut until anything is written."""
AFRESH_S: Final = 0.03
"""What it takes to reset a line near by, to open it, and to write the stop."""
STALLED_S: Final = round(SHORTEST_CUT_S + STOP_WITHIN_S - TICK_S - AFRESH_S, 3)
"""Unsent bytes that stay for this long mean that the line is stalled: it is to be reset, and opened
afresh, because what waits in the kernel would be delivered later, however old it is then. A byte
that was written as late as a tick after the shortest cut began has just this time."""
WAITED_S: Final = 1.0
"""The same where opening afresh is dear."""
IN_FLIGHT_S: Final = 0.15
"""Bytes may be unacknowledged for this long without anything being wrong: systems put an
acknowledgement off, for up to 40 ms (Linux) or until a second segment comes (small stacks)."""
_TOGETHER_S: Final = 0.005
_MOST: Final = 256


class StallWatch:
    """Watches one line."""

    __slots__ = ("_marks", "_taken", "_written", "limit_s")

    def __init__(self, limit_s: float = STALLED_S) -> None:
        self.limit_s = limit_s
        self._marks: deque[tuple[float, int]] = deque()
        """When bytes were written, and how many had been by then."""
        self._written = 0
        self._taken = 0

    @property
    def deadline(self) -> float | None:
        """When the line is stalled, unless the bytes leave before."""
        return self._marks[0][0] + self.limit_s if self._marks else None

    def age_s(self, now: float) -> float:
        """Return how old the oldest unsent bytes are; 0 when there are none."""
        return now - self._marks[0][0] if self._marks else 0.0

    def saw(self, unsent: int, now: float) -> bool:
        """Take how many bytes are unsent; return whether the line is stalled.

        To be told right before each write, and now and then.
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
        """Take note that so many bytes were written; `saw` puts right what is not known better."""
        self._written += size
        self._mark(now)

    def gave_up(self) -> None:
        """Take note that what is unsent never leaves: what follows it counts as old as that."""
        if self._marks:
            began = self._marks[0][0]
            self._marks.clear()
            self._marks.append((began, sys.maxsize))
        self._written = self._taken = 0

    def reset(self) -> None:
        """Begin anew: nothing is unsent."""
        self._marks.clear()
        self._written = self._taken = 0

    def _mark(self, now: float) -> None:
        marks = self._marks
        if marks and (now - marks[-1][0] < _TOGETHER_S or len(marks) >= _MOST):
            marks[-1] = marks[-1][0], self._written
        else:
            marks.append((now, self._written))
