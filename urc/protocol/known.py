"""What is known of the robot right now: the names of conditions.

Floor 3, pure. An old reading is no knowledge: a condition over a signal that is stale, or was never
read, does not hold.
"""

from collections.abc import Iterable, Iterator, Mapping

from urc.expressions import ExpressionError, Template
from urc.model.values import NOTHING, Sample, Signal

__all__ = ["Known", "View"]


class Known:
    """The newest reading of every signal."""

    def __init__(self, signals: Mapping[str, Signal], names: Mapping[str, object]) -> None:
        self._signals = signals
        self.names = names
        """What is known beside signals: ``settings``."""
        self.latched = ""
        """Why nothing may be begun that moves by itself; "" while it may."""
        self.stops = 0
        """How often it was stopped: what moves and was asked for before is not sent."""
        self._last: dict[str, Sample] = {}

    def latch(self, reason: str) -> None:
        """Take note of a stop, or of its reset: ""."""
        self.latched = reason
        self.stops += reason != ""

    def take(self, samples: Iterable[Sample]) -> None:
        """Keep new readings."""
        for sample in samples:
            self._last[sample.signal] = sample

    def reading(self, name: str, now: float, since: float) -> Sample | None:
        """Return the newest reading, unless it is stale at `now` or older than `since`."""
        sample = self._last.get(name)
        if sample is None or sample.time_s < since:
            return None
        age_s = self._signals[name].stale_after_s if name in self._signals else 0.0
        return None if age_s and now - sample.time_s > age_s else sample

    def view(
        self,
        now: float,
        names: Mapping[str, object] = NOTHING,
        *,
        since: float = float("-inf"),
    ) -> "View":
        """Return a namespace of fresh signals.

        Args:
            now: the time.
            names: what goes before signals of the same name, such as arguments.
            since: readings before it do not count.
        """
        return View(self, now, names, since)

    def holds(
        self,
        condition: Template,
        now: float,
        names: Mapping[str, object] = NOTHING,
        *,
        since: float = float("-inf"),
    ) -> bool:
        """Return whether `condition` is true; what cannot be told is not."""
        try:
            return bool(condition.evaluate(self.view(now, names, since=since)))
        except ExpressionError:
            return False


class View(Mapping[str, object]):
    """A namespace: given names, then settings, then fresh signals."""

    __slots__ = ("_known", "_names", "_now", "_since")

    def __init__(self, known: Known, now: float, names: Mapping[str, object], since: float) -> None:
        self._known = known
        self._now = now
        self._names = names
        self._since = since

    def __getitem__(self, name: str) -> object:
        if name in self._names:
            return self._names[name]
        if name in self._known.names:
            return self._known.names[name]
        sample = self._known.reading(name, self._now, self._since)
        if sample is None:
            raise KeyError(name)
        return sample.value

    def __iter__(self) -> Iterator[str]:
        yield from {**self._known.names, **self._names}

    def __len__(self) -> int:
        return len({**self._known.names, **self._names})
