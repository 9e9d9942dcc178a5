"""Limit the entries for a repeated event to one per second, with a count.

Layer 4. Pure. A token bucket limits the entries for all events combined. Hostile visitors with many
addresses therefore cannot push older entries out of the log.
"""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

__all__ = ["RepeatLimiter"]

_AGAIN_S: Final = 1.0
"""Minimum interval between entries for the same event, in seconds."""
_MOST_KEPT: Final = 64
"""Maximum number of different events that have their own counts."""
_Key = TypeVar("_Key", bound=Hashable)


@dataclass(slots=True)
class _Repeat:
    told_s: float
    count: int = 0


class RepeatLimiter(Generic[_Key]):
    """A limiter that counts repeated events until an entry with the count may be written."""

    def __init__(self, burst: int = 16, per_s: float = 16.0) -> None:
        """Create a limiter without events.

        Args:
            burst: maximum number of entries at once.
            per_s: maximum mean rate, in entries per second.
        """
        self._forgotten = 0
        self._known: dict[_Key, _Repeat] = {}
        self._burst = burst
        self._per_s = per_s
        self._tokens = float(burst)
        self._filled_s: float | None = None

    def __len__(self) -> int:
        """Return the number of different events counted."""
        return len(self._known)

    def count(self, key: _Key, now: float) -> int:
        """Count an event; return the count for an entry, or 0 if no entry may be written now.

        Args:
            key: the kind of event; identical events are counted together.
            now: monotonic time in seconds.
        """
        known = self._known.get(key)
        if known is None:
            while len(self._known) >= _MOST_KEPT:
                self._forgotten += self._known.pop(next(iter(self._known))).count
            known = self._known[key] = _Repeat(now - _AGAIN_S)
        known.count += 1
        return self._taken(known, now)

    def due(self, now: float) -> Iterator[tuple[_Key, int]]:
        """Yield each event that may be written now, with its count."""
        for key, known in self._known.items():
            if known.count and (count := self._taken(known, now)):
                yield key, count

    def forgotten(self, now: float | None = None) -> int:
        """Return the number of events whose own counts were dropped, and reset the number.

        The result is 0 if no entry may be written at the time `now`. Without `now`, the number is
        returned regardless of the limits.
        """
        count = self._forgotten
        if not count or (now is not None and not self._may_tell(now)):
            return 0
        self._forgotten = 0
        return count

    def rest(self) -> Iterator[tuple[_Key, int]]:
        """Yield each event that has a count, regardless of the limits, and remove all events."""
        known, self._known = self._known, {}
        yield from ((key, one.count) for key, one in known.items() if one.count)

    def _taken(self, known: _Repeat, now: float) -> int:
        if now - known.told_s < _AGAIN_S or not self._may_tell(now):
            return 0
        count, known.count, known.told_s = known.count, 0, now
        return count

    def _may_tell(self, now: float) -> bool:
        passed_s = 0.0 if self._filled_s is None else max(0.0, now - self._filled_s)
        self._filled_s = now
        self._tokens = min(self._burst, self._tokens + passed_s * self._per_s)
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True
