"""A rate limiter that delays no value that arrives at the rate.

This is the generic cell rate algorithm (ITU-T I.371, annex A) with a tolerance of one period.
Values that arrive at the rate, with the jitter of a network, pass at once. In any second, at most
one value more than the rate passes. A minimum gap would delay every second value instead.
"""

from typing import Final

__all__ = ["RateLimiter"]

_ROUNDING_S: Final = 1e-9


class RateLimiter:
    """A limit of one value per `period_s` on average, and of two in a row unless `is_strict`."""

    __slots__ = ("_due", "_early_s", "_period_s")

    def __init__(self, period_s: float, *, is_strict: bool = False) -> None:
        if not period_s > 0:
            raise ValueError(f"a period is more than 0 s, not {period_s:g}")
        self._period_s = period_s
        self._early_s = 0.0 if is_strict else period_s
        """Tolerance: how much earlier than at the exact rate a value may pass, in seconds."""
        self._due = float("-inf")
        """Time of the next value at the exact rate."""

    @property
    def free_at(self) -> float:
        """Earliest time of the next value."""
        return self._due - self._early_s

    def allow(self, now: float) -> bool:
        """Return whether a value may pass now, and count it if so."""
        due, period_s = self._due, self._period_s
        if now < due - self._early_s - _ROUNDING_S:
            return False
        self._due = (now if now > due else due) + period_s
        return True
