"""What may be sent, and when: the queue of a line, rates, counters.

Floor 3, pure. Everything is bounded, and everything that is dropped is given back to be told of.
"""

from bisect import insort, insort_left
from collections.abc import Callable
from typing import Final, Protocol, TypeVar

from urc.model.flow import Priority

__all__ = ["RANKS", "REALTIME", "Bucket", "Counters", "Draw", "Waiting"]

RANKS: Final[dict[Priority, int]] = {"realtime": 0, "high": 1, "normal": 2, "low": 3}
"""Of two that wait, the one with the lower rank goes first."""
REALTIME: Final = 0


class Bucket:
    """A rate: the generic cell rate algorithm, with one period of tolerance.

    A sender that was quiet may send twice at once; over any longer time it keeps its rate. A
    shortest gap would be no rate: whoever came a moment too early would lose half a period.
    """

    __slots__ = ("_next_s", "_period_s")

    def __init__(self, rate_per_s: float) -> None:
        self._period_s = 1 / rate_per_s
        self._next_s = float("-inf")
        """When the next one is due by the rate itself."""

    @property
    def free_at(self) -> float:
        """When the next one may go."""
        return self._next_s - self._period_s

    def take(self, now: float) -> None:
        """Count one that goes."""
        self._next_s = max(self._next_s, now) + self._period_s


class Draw:
    """The counters of one frame: asked twice for the same one, it gives the same number."""

    __slots__ = ("_last", "values")

    def __init__(self, last: dict[str, int]) -> None:
        self._last = last
        self.values: dict[str, int] = {}
        """Counter → number that the frame carries."""

    def __call__(self, name: str, low: int, high: int) -> int:
        """Return the number after the last one that was sent; after `high` comes `low`."""
        if name not in self.values:
            last = self._last.get(name, high)
            self.values[name] = last + 1 if low <= last < high else low
        return self.values[name]


class Counters:
    """The counters of one connection."""

    __slots__ = ("_last", "counted")

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self.counted: Callable[[], None] | None = None
        """Called when a frame was counted; must not count any."""

    def draw(self) -> Draw:
        """Return the numbers of the next frame; nothing is counted yet."""
        return Draw(self._last)

    def count(self, draw: Draw) -> None:
        """Count the frame that was made with `draw`."""
        self._last.update(draw.values)
        if self.counted is not None:
            self.counted()

    def reserve(self, draw: Draw) -> None:
        """Keep the numbers of `draw` for a frame that may be sent later: no other gets them."""
        self._last.update(draw.values)

    def begin(self) -> None:
        """Begin anew, as each connection does."""
        self._last = {}


class Rankable(Protocol):
    """What may wait."""

    @property
    def rank(self) -> int:
        """The lower, the sooner."""

    @property
    def latest_key(self) -> str:
        """Those with the same key replace each other; "" for those that do not."""


Item = TypeVar("Item", bound=Rankable)


class Waiting(list[Item]):
    """What waits to be sent, the first to go first; those of one rank in the order they came."""

    __slots__ = ("_depth",)

    def __init__(self, depth: int) -> None:
        super().__init__()
        self._depth = depth

    def put(self, item: Item) -> Item | None:
        """Take `item`; return the one that had to make room, which may be `item` itself."""
        if item.latest_key:
            for place, other in enumerate(self):
                if other.latest_key == item.latest_key:
                    self[place] = item  # keeps the place, so that it cannot starve
                    return other
        crowded_out: Item | None = None
        if len(self) >= self._depth:
            if self[-1].rank <= item.rank:
                return item
            crowded_out = self.pop()
        insort(self, item, key=_rank)
        return crowded_out

    def put_back(self, item: Item) -> None:
        """Take what was sent before and must be sent again, ahead of its rank."""
        insort_left(self, item, key=_rank)

    def drain(self) -> list[Item]:
        """Take all out and return them."""
        items = list(self)
        self.clear()
        return items


def _rank(item: Rankable) -> int:
    return item.rank
