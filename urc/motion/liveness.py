"""Does the program at the other end of a line still live? Told by what comes back.

A program that stands still, with a kernel that goes on, looks well from here: what is written is
acknowledged, and waits there until the program goes on. So it is asked, and what comes is timed.
"""

from math import inf
from typing import Final

__all__ = ["ASKED_EVERY_S", "SILENCE_S", "Liveness"]

SILENCE_S: Final = 0.5
"""A program that is asked all the time, and from which nothing came for so long, stands still."""
ASKED_EVERY_S: Final = 0.05
"""Time between an answer and the next question."""
_ON_THE_WAY_S: Final = 0.03
"""What a sign of life, and what follows from its absence, may take."""


class Liveness:
    """Of one connection."""

    __slots__ = ("_asked_s", "_heard_s", "_silent_s")

    def __init__(self, silent_s: float | None) -> None:
        """Begin; `silent_s` is how long the robot may say nothing unasked, None: for ever."""
        self._silent_s = inf if silent_s is None else silent_s
        self._heard_s = -inf
        self._asked_s: float | None = None

    @property
    def is_asked(self) -> bool:
        """Whether nothing has come since the last question."""
        return self._asked_s is not None

    @property
    def deadline(self) -> float:
        """When the program counts as standing still, unless something comes before."""
        asked_s = inf if self._asked_s is None else self._asked_s
        answer_s = SILENCE_S - ASKED_EVERY_S - _ON_THE_WAY_S
        return min(self._heard_s + self._silent_s, asked_s + answer_s)

    def note_arrival(self, now: float) -> None:
        """Take note that something came."""
        self._heard_s = now
        self._asked_s = None

    def asked(self, now: float) -> None:
        """Take note that a sign of life was asked for; the oldest question counts."""
        if self._asked_s is None:
            self._asked_s = now
