"""The robot's state as a namespace for conditions.

Pure. A condition is false if it uses a signal that is stale or was never received.
"""

from collections.abc import Iterable, Iterator, Mapping

from urc.expressions import ExpressionError, Template
from urc.model.values import NOTHING, Sample, Signal

__all__ = ["SignalState", "ConditionScope"]


class SignalState:
    """The state that conditions use: the newest sample of each signal, and the latched STOP."""

    def __init__(self, signals: Mapping[str, Signal], names: Mapping[str, object]) -> None:
        self._signals = signals
        self.names = names
        """Values of the additional names in conditions, such as ``settings``."""
        self.latched = ""
        """Reason for refusing autonomous motion; "" if motion is allowed."""
        self.stops = 0
        """Number of stops. A motion command that was requested before the last stop is not sent."""
        self._last: dict[str, Sample] = {}

    def latch(self, reason: str) -> None:
        """Record a stop with its reason, or the reset of the stop if `reason` is empty."""
        self.latched = reason
        self.stops += reason != ""

    def update(self, samples: Iterable[Sample]) -> None:
        """Store new readings."""
        for sample in samples:
            self._last[sample.signal] = sample

    def reading(self, name: str, now: float, since: float) -> Sample | None:
        """Return the newest sample; None if it is stale at `now` or arrived before `since`."""
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
    ) -> "ConditionScope":
        """Return a namespace of fresh signals, settings and `names`.

        Args:
            now: current time, in seconds.
            names: values that take precedence over signals, such as arguments, keyed by name.
            since: earliest arrival time of valid samples, in seconds.
        """
        return ConditionScope(self, now, names, since)

    def holds(
        self,
        condition: Template,
        now: float,
        names: Mapping[str, object] = NOTHING,
        *,
        since: float = float("-inf"),
    ) -> bool:
        """Return whether `condition` is true; False if the evaluation fails."""
        try:
            return bool(condition.evaluate(self.view(now, names, since=since)))
        except ExpressionError:
            return False


class ConditionScope(Mapping[str, object]):
    """A namespace of given names, settings and fresh signals, in this order of precedence."""

    __slots__ = ("_known", "_names", "_now", "_since")

    def __init__(
        self, known: SignalState, now: float, names: Mapping[str, object], since: float
    ) -> None:
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
