"""Points in time.

Floor 3, pure.
"""

from collections.abc import Iterable

__all__ = ["soonest"]


def soonest(times: Iterable[float | None]) -> float | None:
    """Return the first of `times`, of which None is never."""
    first: float | None = None
    for time in times:
        if time is not None and (first is None or time < first):
            first = time
    return first
