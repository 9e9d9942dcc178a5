"""The liveness of the program at the other end of a line, judged by the bytes received from it.

The kernel of a frozen program still acknowledges bytes, which then wait until the program goes on.
So acknowledgements prove nothing. The guard sends probes, and times the replies.
"""

from math import inf
from typing import Final

__all__ = ["ASKED_EVERY_S", "SILENCE_S", "Liveness"]

SILENCE_S: Final = 0.5
"""Silence after which a probed program counts as frozen, in seconds."""
ASKED_EVERY_S: Final = 0.05
"""Time between a reply and the next probe, in seconds."""
_ON_THE_WAY_S: Final = 0.03
"""Time allowed for the delivery of a reply, and for the reset without one, in seconds."""


class Liveness:
    """The liveness of one connection."""

    __slots__ = ("_asked_s", "_heard_s", "_silent_s")

    def __init__(self, silent_s: float | None) -> None:
        """Begin; `silent_s` is the longest silence without a probe, None: unlimited."""
        self._silent_s = inf if silent_s is None else silent_s
        self._heard_s = -inf
        self._asked_s: float | None = None

    @property
    def is_asked(self) -> bool:
        """Whether a probe has no reply yet."""
        return self._asked_s is not None

    @property
    def deadline(self) -> float:
        """Time at which the program counts as frozen, unless bytes arrive before."""
        asked_s = inf if self._asked_s is None else self._asked_s
        answer_s = SILENCE_S - ASKED_EVERY_S - _ON_THE_WAY_S
        return min(self._heard_s + self._silent_s, asked_s + answer_s)

    def note_arrival(self, now: float) -> None:
        """Record that bytes arrived."""
        self._heard_s = now
        self._asked_s = None

    def asked(self, now: float) -> None:
        """Record a probe; the oldest one without a reply counts."""
        if self._asked_s is None:
            self._asked_s = now
