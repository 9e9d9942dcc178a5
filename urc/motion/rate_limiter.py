"""How often something may be written: a rate that delays nothing at its own rate.

The generic cell rate algorithm (ITU-T I.371, annex A) with one period of tolerance: values that
come at exactly the rate, with the jitter of a network, pass at once; in any second there is at most
one more than the rate allows. A shortest gap would delay every second one of them.
"""

from typing import Final

__all__ = ["RateLimiter"]

_ROUNDING_S: Final = 1e-9


class RateLimiter:
    """At most one every `period_s` seconds on average, and two in a row unless it `is_strict`."""

    __slots__ = ("_due", "_early_s", "_period_s")

    def __init__(self, period_s: float, *, is_strict: bool = False) -> None:
        if not period_s > 0:
            raise ValueError(f"a period is more than 0 s, not {period_s:g}")
        self._period_s = period_s
        self._early_s = 0.0 if is_strict else period_s
        """How much earlier than at exactly this rate one may go."""
        self._due = float("-inf")
        """When the next one would come at exactly this rate."""

    @property
    def free_at(self) -> float:
        """When the next one may go."""
        return self._due - self._early_s

    def allow(self, now: float) -> bool:
        """Count one that goes now, if it may."""
        due, period_s = self._due, self._period_s
        if now < due - self._early_s - _ROUNDING_S:
            return False
        self._due = (now if now > due else due) + period_s
        return True
