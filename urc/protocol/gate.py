"""What may be sent, and when: the queue of a line, rates, counters.

Floor 3, pure. Everything is bounded, and everything that is dropped is given back to be told of.
"""

from bisect import insort, insort_left
from collections.abc import Callable, Mapping
from typing import Final, Protocol, TypeVar

from urc.model.codec import Count, Numbered, Payload, Series
from urc.model.flow import Priority

__all__ = ["RANKS", "REALTIME", "Bucket", "Counters", "Draw", "Made", "Waiting"]

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


Stand = tuple[tuple[str, int], ...]
"""How counters stand: their last numbers, by name in the order of the names."""
Made = dict[Stand, Numbered]


class Draw:
    """The counters of one frame: asked twice for the same one, it gives the same number."""

    __slots__ = ("_last", "values")

    def __init__(self, last: Mapping[str, int]) -> None:
        self._last = last
        self.values: dict[str, int] = {}
        """Counter → number that the frame carries."""

    def __call__(self, name: str, low: int, high: int) -> int:
        """Return the number after the last one that was sent; after `high` comes `low`."""
        if name not in self.values:
            last = self._last.get(name, high)
            self.values[name] = last + 1 if low <= last < high else low
        return self.values[name]

    @property
    def count(self) -> Count:
        """What the frame does to the counters."""
        before = {name: self._last[name] for name in self.values if name in self._last}
        return Count(before, dict(self.values))


class Counters:
    """The counters of one connection.

    Numbers are allotted in the order in which frames leave. A line that only the engine writes to
    has that order by itself. A line whose motion is written by the guard is *shared*: there the
    engine only proposes numbers, and is told how the counters stand.
    """

    __slots__ = ("_known", "_last", "ahead", "counted", "is_shared")

    def __init__(self) -> None:
        self._last: Mapping[str, int] = {}
        """How they stand once all that was sent has left."""
        self._known: Mapping[str, int] = {}
        """How they stood when that was last known for sure."""
        self.ahead = 0
        """Frames that were counted since then."""
        self.is_shared = False
        self.counted: Callable[[], None] | None = None
        """Called when a frame was counted; must not count any."""

    def draw(self) -> Draw:
        """Return the numbers of the next frame; nothing is counted yet."""
        return Draw(self._last)

    def draw_urgent(self) -> Draw:
        """Return the numbers of a frame that overtakes all that is still on its way."""
        return Draw(self._known)

    def count(self, draw: Draw) -> None:
        """Count the frame that was made with `draw`."""
        if not draw.values:
            return
        self._last = {**self._last, **draw.values}
        if self.is_shared:
            self.ahead += 1
        else:
            self._known = self._last
        if self.counted is not None:
            self.counted()

    def told(self, stand: Mapping[str, int], *, is_settled: bool) -> None:
        """Take how shared counters stand.

        Args:
            stand: counter → the last number that has left.
            is_settled: whether nothing that was counted here is still on its way.
        """
        self._known = dict(stand)
        if is_settled:
            self._last, self.ahead = self._known, 0

    def series(self, encode: Callable[[Draw], Payload], length: int, made: Made) -> Series:
        """Render a frame for each of the next numbers, and for the first of a new connection.

        Args:
            encode: renders it.
            length: how many.
            made: frames that need not be rendered again; takes those of this series.
        """
        frames: dict[Stand, Numbered] = {}
        for begin, most in ((self._known, length + self.ahead), ({}, length)):
            stand: Mapping[str, int] = begin
            for _ in range(most):
                key = tuple(sorted(stand.items()))
                one = frames.get(key) or made.get(key)
                if one is None:
                    draw = Draw(stand)
                    one = Numbered(encode(draw), draw.count)
                frames[key] = one
                stand = {**stand, **one.takes.after}
        made.clear()
        made.update(frames)
        return Series(tuple(frames.values()))

    def is_near(self, made: Made, most: int) -> bool:
        """Return whether a series was made for `most` numbers before the next one, or fewer."""
        key = tuple(sorted(self._known.items()))
        place = next((at for at, one in enumerate(made) if one == key), most)
        return place + self.ahead < most

    def begin(self) -> None:
        """Begin anew, as each connection does. Shared counters begin when that is told."""
        if not self.is_shared:
            self._last = self._known = {}


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
