"""Points in time. Pure."""

from collections.abc import Iterable

__all__ = ["soonest"]


def soonest(times: Iterable[float | None]) -> float | None:
    """Return the earliest of `times`, ignoring None; return None if no time is left."""
    first: float | None = None
    for time in times:
        if time is not None and (first is None or time < first):
            first = time
    return first
