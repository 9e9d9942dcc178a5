"""The queue, the rate limits and the counters of a connection.

Pure. All queues are bounded, and dropped requests are returned for reporting.
"""

from bisect import insort, insort_left
from collections.abc import Callable, Mapping
from typing import Final, Protocol, TypeVar

from urc.model.exchange import Priority
from urc.model.payload import Count, FrameVariants, Numbered, Payload

__all__ = ["RANKS", "REALTIME", "GcraLimiter", "Counters", "FrameCounters", "Made", "PriorityQueue"]

RANKS: Final[dict[Priority, int]] = {"realtime": 0, "high": 1, "normal": 2, "low": 3}
"""Rank of each priority; the request with the lowest rank is sent first."""
REALTIME: Final = 0


class GcraLimiter:
    """A rate limiter: the generic cell rate algorithm, with one period of tolerance.

    After a pause, two calls may follow immediately; the average rate stays within the limit. A
    minimum gap between calls would instead delay every slightly early call and so reduce the
    average rate.
    """

    __slots__ = ("_next_s", "_period_s")

    def __init__(self, rate_per_s: float) -> None:
        self._period_s = 1 / rate_per_s
        self._next_s = float("-inf")
        """Time at which the next call would be due if calls came at the limit's rate, in
        seconds."""

    @property
    def free_at(self) -> float:
        """Earliest time of the next call, in seconds."""
        return self._next_s - self._period_s

    def count(self, now: float) -> None:
        """Count one call."""
        self._next_s = max(self._next_s, now) + self._period_s


Stand = tuple[tuple[str, int], ...]
"""Last number of each counter, as pairs of name and number, sorted by name."""
Made = dict[Stand, Numbered]


class FrameCounters:
    """The counter numbers of one frame; repeated use of a counter returns the same number."""

    __slots__ = ("_last", "values")

    def __init__(self, last: Mapping[str, int]) -> None:
        self._last = last
        self.values: dict[str, int] = {}
        """Numbers in the frame, keyed by counter."""

    def __call__(self, name: str, low: int, high: int) -> int:
        """Return the next number of a counter, which restarts at `low` after `high`."""
        if name not in self.values:
            last = self._last.get(name, high)
            self.values[name] = last + 1 if low <= last < high else low
        return self.values[name]

    @property
    def count(self) -> Count:
        """Counter numbers before and after the frame."""
        before = {name: self._last[name] for name in self.values if name in self._last}
        return Count(before, dict(self.values))


class Counters:
    """The counters of one connection.

    Counter numbers are assigned in the order of transmission. If the engine is the only sender, the
    order of transmission is known. If the guard also sends motion frames, the counters are
    *shared*. For shared counters, the engine only proposes numbers and receives the actual
    numbers later.
    """

    __slots__ = ("_known", "_last", "ahead", "is_shared")

    def __init__(self) -> None:
        self._last: Mapping[str, int] = {}
        """Number that each counter will have after all pending frames have been transmitted."""
        self._known: Mapping[str, int] = {}
        """Last confirmed number of each counter."""
        self.ahead = 0
        """Number of frames counted since the last confirmation."""
        self.is_shared = False

    def draw(self) -> FrameCounters:
        """Return the next frame's numbers without counting the frame."""
        return FrameCounters(self._last)

    def draw_urgent(self) -> FrameCounters:
        """Return the numbers for a frame that is sent before all pending frames, such as a stop."""
        return FrameCounters(self._known)

    def count(self, draw: FrameCounters) -> None:
        """Count the frame that was rendered with `draw`."""
        if not draw.values:
            return
        self._last = {**self._last, **draw.values}
        if self.is_shared:
            self.ahead += 1
        else:
            self._known = self._last

    def set_counters(self, stand: Mapping[str, int], *, is_settled: bool) -> None:
        """Update shared counters with confirmed values.

        Args:
            stand: last transmitted number of each counter.
            is_settled: whether all counted frames have been transmitted.
        """
        self._known = dict(stand)
        if is_settled:
            self._last, self.ahead = self._known, 0

    def series(
        self, encode: Callable[[FrameCounters], Payload], length: int, made: Made
    ) -> FrameVariants:
        """Render frames for the next numbers and for the first numbers of a new connection.

        Args:
            encode: function that renders a frame with the given numbers.
            length: number of frames to render.
            made: cache of rendered frames; the method reuses its frames and replaces its content.
        """
        frames: dict[Stand, Numbered] = {}
        for begin, most in ((self._known, length + self.ahead), ({}, length)):
            stand: Mapping[str, int] = begin
            for _ in range(most):
                key = tuple(sorted(stand.items()))
                one = frames.get(key) or made.get(key)
                if one is None:
                    draw = FrameCounters(stand)
                    one = Numbered(encode(draw), draw.count)
                frames[key] = one
                stand = {**stand, **one.takes.after}
        made.clear()
        made.update(frames)
        return FrameVariants(tuple(frames.values()))

    def is_near(self, made: Made, most: int) -> bool:
        """Return whether fewer than `most` frames have been counted since `made` was rendered."""
        key = tuple(sorted(self._known.items()))
        place = next((at for at, one in enumerate(made) if one == key), most)
        return place + self.ahead < most

    def reset(self) -> None:
        """Reset the counters for a new connection.

        Shared counters keep their values until `set_counters` is called.
        """
        if not self.is_shared:
            self._last = self._known = {}


class Prioritized(Protocol):
    """An item in a priority queue."""

    @property
    def rank(self) -> int:
        """Priority rank; items with lower ranks are sent first."""

    @property
    def latest_key(self) -> str:
        """Key of requests that replace each other; "" means that none are replaced."""


Item = TypeVar("Item", bound=Prioritized)


class PriorityQueue(list[Item]):
    """A priority queue; requests of equal rank keep their order of arrival."""

    __slots__ = ("_depth",)

    def __init__(self, depth: int) -> None:
        super().__init__()
        self._depth = depth

    def push(self, item: Item) -> Item | None:
        """Add `item`; return the displaced item (possibly `item` itself), or None."""
        if item.latest_key:
            for place, other in enumerate(self):
                if other.latest_key == item.latest_key:
                    self[place] = item  # keep its place, so that updates cannot starve it
                    return other
        crowded_out: Item | None = None
        if len(self) >= self._depth:
            if self[-1].rank <= item.rank:
                return item
            crowded_out = self.pop()
        insort(self, item, key=_rank)
        return crowded_out

    def put_back(self, item: Item) -> None:
        """Add a request that must be retried, ahead of other requests of equal rank."""
        insort_left(self, item, key=_rank)

    def drain(self) -> list[Item]:
        """Remove and return all items."""
        items = list(self)
        self.clear()
        return items


def _rank(item: Prioritized) -> int:
    return item.rank
