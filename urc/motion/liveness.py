"""The liveness of the program at the other end of a connection, judged by received bytes.

When a program freezes, the kernel still acknowledges bytes that the program never reads.
Acknowledgements therefore do not prove liveness. Instead, the guard sends probes and measures the
time until each reply.
"""

from math import inf
from typing import Final

__all__ = ["ASKED_EVERY_S", "GATHERED_S", "SILENCE_S", "Liveness"]

SILENCE_S: Final = 0.5
"""How long a probed program can be silent before it counts as frozen, in seconds."""
ASKED_EVERY_S: Final = 0.05
"""Interval between a reply and the next probe, in seconds."""
_ON_THE_WAY_S: Final = 0.03
"""Time allowed for delivering a reply, or for a reset if no reply arrives, in seconds."""
GATHERED_S: Final = 2 / 60
"""Longest time for which a transport gathers received data before it delivers them, in seconds. The
last data from before a freeze then seem to be from after its beginning."""


class Liveness:
    """Judges whether the program at the other end of one connection is frozen."""

    __slots__ = ("_asked_s", "_heard_s", "_silent_s")

    def __init__(self, silent_s: float | None) -> None:
        """Create the watch.

        Args:
            silent_s: maximum silence without a probe, in seconds; None means no limit.
        """
        self._silent_s = inf if silent_s is None else silent_s
        self._heard_s = -inf
        self._asked_s: float | None = None

    @property
    def is_asked(self) -> bool:
        """Whether a probe is still unanswered."""
        return self._asked_s is not None

    @property
    def deadline(self) -> float:
        """Time at which the program counts as frozen, unless bytes arrive earlier."""
        asked_s = inf if self._asked_s is None else self._asked_s
        answer_s = SILENCE_S - ASKED_EVERY_S - _ON_THE_WAY_S - GATHERED_S
        return min(self._heard_s + self._silent_s, asked_s + answer_s)

    def note_arrival(self, now: float) -> None:
        """Record that bytes have arrived, which proves that the program works."""
        self._heard_s = now
        self._asked_s = None

    def asked(self, now: float) -> None:
        """Record a probe; if several are unanswered, the oldest probe counts."""
        if self._asked_s is None:
            self._asked_s = now
