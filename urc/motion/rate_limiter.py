"""A rate limiter that never delays values that arrive at the permitted rate.

The limiter implements the generic cell rate algorithm (ITU-T I.371, annex A) with a tolerance of
one period. Values that arrive at the permitted rate pass immediately, despite network jitter. In
any second, at most one value more than permitted passes. A fixed minimum interval would instead
delay every second value.
"""

from typing import Final

__all__ = ["RateLimiter"]

_ROUNDING_S: Final = 1e-9


class RateLimiter:
    """A limit of one value per `period_s` on average, with bursts of two unless `is_strict`."""

    __slots__ = ("_due", "_early_s", "_period_s")

    def __init__(self, period_s: float, *, is_strict: bool = False) -> None:
        if not period_s > 0:
            raise ValueError(f"the period must be greater than 0 s, not {period_s:g}")
        self._period_s = period_s
        self._early_s = 0.0 if is_strict else period_s
        """Maximum time by which a passing value may be ahead of its nominal time, in seconds."""
        self._due = float("-inf")
        """Nominal time of the next value, at exactly the permitted rate, in seconds."""

    @property
    def free_at(self) -> float:
        """Earliest time at which the next value may pass."""
        return self._due - self._early_s

    def allow(self, now: float) -> bool:
        """Return whether a value may pass now; if so, count the value."""
        due, period_s = self._due, self._period_s
        if now < due - self._early_s - _ROUNDING_S:
            return False
        self._due = (now if now > due else due) + period_s
        return True
