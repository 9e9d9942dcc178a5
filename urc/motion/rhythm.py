"""When is the next of things due that come regularly? Told by the shortest of the last gaps.

What comes together counts once: a page says the samples of all that is held one behind the other.
"""

from collections import deque
from typing import Final

__all__ = ["Rhythm"]

_TOGETHER_S: Final = 0.005
_LONGEST_S: Final = 0.15
"""A gap longer than this is a pause; what comes after it begins anew."""
_REMEMBERED: Final = 4


class Rhythm:
    """The last few gaps."""

    __slots__ = ("_gaps", "_last_s")

    def __init__(self) -> None:
        self._gaps: deque[float] = deque(maxlen=_REMEMBERED)
        self._last_s = float("-inf")

    def take(self, now: float) -> float | None:
        """Take note that one came; return when the next is due at the soonest, None: unknown."""
        gap, gaps = now - self._last_s, self._gaps
        if gap >= _TOGETHER_S:
            self._last_s = now
            if gap <= _LONGEST_S:
                gaps.append(gap)
            else:
                gaps.clear()
        return self._last_s + min(gaps) if gaps else None
