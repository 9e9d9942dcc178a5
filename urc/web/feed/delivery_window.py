"""How many bytes of images may be on the way to one page, measured by what the page confirms.

Layer 5. Pure. A socket accepts far more data than a slow line has delivered. The data then wait in
the kernel or in a modem, and everything else waits behind them. The window therefore limits the
bytes that the page has not confirmed.

Theory of operation. The delay of a confirmation grows as soon as data wait on the line. The window
shrinks when all delays of 0.1 s exceed the shortest known delay by `QUEUE_S`. The new size keeps
the line just busy. On lines with a long delay, more may wait. The window grows while the line is
busy and nothing waits. On a line that others fill, the images therefore give way.
"""

from collections import deque
from typing import Final, NamedTuple

__all__ = ["LEAST_PART", "LEAST_WINDOW", "MOST_WINDOW", "QUEUE_S", "DeliveryWindow"]

LEAST_PART: Final = 1400
"""Smallest part of a message, in bytes: one packet of most networks."""
LEAST_WINDOW: Final = 2 * LEAST_PART
MOST_WINDOW: Final = 1_048_576
QUEUE_S: Final = 0.015
"""Permitted wait in queues of the line, in seconds: about one packet at 1 Mbit/s."""
_FIRST_WINDOW: Final = 4 * LEAST_PART
_MOST_PART: Final = 65_536
_PARTS: Final = 16
"""Number of parts in a window: a part must not look like a queue."""
_CONFIRMATIONS: Final = 8
"""Number of confirmations in a window."""
_QUEUE_SHARE: Final = 0.25
"""Permitted wait on lines with a long delay, as a share of the shortest delay."""
_DELAYS: Final = 5
"""Number of delays whose smallest one counts, because a single one may have other causes."""
_STANDING_S: Final = 0.1
"""Time for which data must wait on the line before the window shrinks, in seconds. A busy page or
server confirms late as well, but not for so long."""
_LEAST_SHARE: Final = 0.3
_GROWTH: Final = 0.1
"""Share by which the window grows in each round trip, but at least by one packet."""
_SHORTEST_FOR_S: Final = 30.0
"""Time after which the shortest delay is measured again, in seconds: routes change."""
_FASTEST_FOR_S: Final = 5.0
_LEAST_RATE_S: Final = 0.001
"""Shortest time over which a rate is measured, in seconds."""


class _Asked(NamedTuple):
    total: int
    """Bytes sent so far, including the part that asks."""
    time_s: float
    confirmed: int
    confirmed_s: float
    """Time at which `confirmed` was confirmed, or at which an idle line became busy."""


class DeliveryWindow:
    """The window of one page's line, and the rate that the line bears."""

    def __init__(self, now_s: float) -> None:
        self.size = float(_FIRST_WINDOW)
        """Maximum number of unconfirmed bytes."""
        self.sent_bytes = 0
        self.confirmed_bytes = 0
        self._asked: deque[_Asked] = deque()
        self._unasked = 0
        self._busy_s = now_s
        self._delays: deque[float] = deque(maxlen=_DELAYS)
        self._waits_s: float | None = None
        """Time since which each confirmation shows that data wait on the line; None if not."""
        self._shortest = _Extreme(now_s, _SHORTEST_FOR_S)
        self._fastest = _Extreme(now_s, _FASTEST_FOR_S)
        self._is_full = False
        """Whether data had to wait for the window since the last confirmation."""
        self._has_queued = False
        """Whether data have ever waited on the line; the window then grows slowly."""
        self._shrunk_s = now_s

    @property
    def rate(self) -> float:
        """Highest rate of the last seconds, in bytes a second; 0 while unknown."""
        return -(self._fastest.least or 0.0)

    @property
    def part_bytes(self) -> int:
        """Maximum size of the next part of a message."""
        return max(LEAST_PART, min(_MOST_PART, int(self.size) // _PARTS))

    def allows(self, size: int) -> bool:
        """Return whether a part with `size` bytes may be sent now."""
        waiting = self.sent_bytes - self.confirmed_bytes
        # Bytes that no confirmation covers must not block the window for ever.
        is_allowed = not self._asked or waiting + size <= self.size
        if not is_allowed:
            self._is_full = True
        return is_allowed

    def sends(self, size: int, now_s: float) -> bool:
        """Count a part with `size` bytes; return whether the page must confirm it."""
        if self.sent_bytes == self.confirmed_bytes:
            self._busy_s = now_s
        self.sent_bytes += size
        self._unasked += size
        if self._unasked < self.size / _CONFIRMATIONS:
            return False
        self._unasked = 0
        asked = _Asked(self.sent_bytes, now_s, self.confirmed_bytes, self._busy_s)
        self._asked.append(asked)
        return True

    def confirmed(self, total: int, now_s: float) -> bool:
        """Handle a confirmation of `total` bytes; return False if it cannot be true."""
        if not self._asked or total != self._asked[0].total:
            return False
        asked = self._asked.popleft()
        news = total - self.confirmed_bytes
        self.confirmed_bytes = total
        self._busy_s = now_s
        delay_s = now_s - asked.time_s
        self._delays.append(delay_s)
        self._shortest.add(delay_s, now_s)
        busy_s = max(_LEAST_RATE_S, now_s - asked.confirmed_s)
        self._fastest.add(-(total - asked.confirmed) / busy_s, now_s)
        self._resize(news, delay_s, now_s)
        return True

    def _resize(self, news: int, delay_s: float, now_s: float) -> None:
        shortest_s = self._shortest.least or 0.0
        least_s = min(self._delays)
        queue_s = max(QUEUE_S, _QUEUE_SHARE * shortest_s)
        if delay_s - shortest_s <= queue_s:
            self._waits_s = None
        elif self._waits_s is None:
            self._waits_s = now_s
        if least_s - shortest_s > queue_s:
            is_standing = self._waits_s is not None and now_s - self._waits_s >= _STANDING_S
            if is_standing and now_s - self._shrunk_s > delay_s:
                share = (shortest_s + queue_s / 2) / least_s
                self.size = max(LEAST_WINDOW, self.size * max(_LEAST_SHARE, share))
                self._has_queued, self._shrunk_s = True, now_s
        elif least_s - shortest_s > queue_s / 2:
            self._has_queued = True
        elif self._is_full:
            grown = max(LEAST_PART / self.size, _GROWTH) if self._has_queued else 1.0
            self.size = min(MOST_WINDOW, self.size + grown * news)
        self._is_full = False


class _Extreme:
    """The least value within a time that is one to two times a span."""

    def __init__(self, now_s: float, span_s: float) -> None:
        self._span_s = span_s
        self._began_s = now_s
        self._before: float | None = None
        self._now: float | None = None

    @property
    def least(self) -> float | None:
        found = [one for one in (self._before, self._now) if one is not None]
        return min(found, default=None)

    def add(self, value: float, now_s: float) -> None:
        if now_s - self._began_s >= self._span_s:
            self._before, self._now, self._began_s = self._now, None, now_s
        self._now = value if self._now is None else min(self._now, value)
