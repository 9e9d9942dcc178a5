"""Alarm states of signals over time.

Callers pass the time, because the module does not read a clock. An alarm begins if the value
reaches a limit or is one of the signal's alarm states. The alarm ends when the value is within the
limit by at least ``hysteresis``. The key ``for`` sets how long the value must be beyond the limit
before the alarm begins. The key ``off_delay`` delays the alarm's end. A delayed change happens at
`AlarmMonitor.deadline`, even without another sample.
"""

from urc.model.values import Alarm, AlarmLimits, Reading, state_texts

__all__ = ["AlarmMonitor"]

_LEVELS: tuple[Alarm, ...] = ("lolo", "hihi", "major", "low", "high", "minor")
"""Alarm levels in order of severity, most severe first."""
_STATE_LEVELS: tuple[Alarm, ...] = ("major", "minor")
_LOWER = ("lolo", "low")


class AlarmMonitor:
    """The alarm state of one signal."""

    __slots__ = (
        "_begun",
        "_due",
        "_ends",
        "_for_s",
        "_levels",
        "_off_s",
        "_within",
        "_words",
        "alarm",
    )  # fmt: skip

    def __init__(self, limits: AlarmLimits) -> None:
        self.alarm: Alarm = ""
        self._for_s = limits.for_s
        self._off_s = limits.off_delay_s
        self._within = limits.hysteresis
        self._levels: list[tuple[Alarm, float]] = [
            (level, limit)
            for level in _LEVELS
            if (limit := getattr(limits, level, None)) is not None
        ]
        self._words: dict[str, Alarm] = {
            word: "major" if limits.attributes_of(word).priority == "high" else "minor"
            for word in limits.states
        }
        self._due: dict[Alarm, float] = {}
        """Times at which pending alarms begin, or active alarms began, keyed by level."""
        self._ends: dict[Alarm, float] = {}
        """Times at which active alarms end because the value is normal again, keyed by level."""
        self._begun: frozenset[Alarm] = frozenset()
        """Levels whose alarm has begun."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` may change the alarm; None if only a sample can change it."""
        pending = [due for level, due in self._due.items() if level not in self._begun]
        return min((*pending, *self._ends.values()), default=None)

    def update(self, value: Reading, now: float) -> Alarm:
        """Process a new value and return its alarm."""
        if value is None:  # not available, so no alarm can be determined
            self._due.clear()
            self._ends.clear()
            return self.tick(now)
        if self._words:
            reached = {self._words[one] for one in state_texts(value) if one in self._words}
            for level in _STATE_LEVELS:
                self._cross(level, now, is_past=level in reached)
        if self._levels:
            span = _span(value)
            if span is None:
                for level, _ in self._levels:
                    self._due.pop(level, None)
                    self._ends.pop(level, None)
            else:
                self._cross_limits(span, now)
        return self.tick(now)

    def _cross_limits(self, span: tuple[float, float], now: float) -> None:
        lowest, highest = span
        for level, limit in self._levels:
            is_lower = level in _LOWER
            is_past = lowest <= limit if is_lower else highest >= limit
            if not is_past and level in self._begun:
                # A value past "lolo" is past "low", too, so returning from "lolo" keeps "low"
                # active.
                back = self._within
                is_past = lowest < limit + back if is_lower else highest > limit - back
            self._cross(level, now, is_past=is_past)

    def _cross(self, level: Alarm, now: float, *, is_past: bool) -> None:
        if is_past:
            self._ends.pop(level, None)
            self._due.setdefault(level, now + self._for_s)
        elif self._off_s and level in self._begun:
            self._ends.setdefault(level, now + self._off_s)
        else:
            self._due.pop(level, None)

    def tick(self, now: float) -> Alarm:
        """Apply all delays that have expired by `now`; return the alarm of the newest value."""
        if self._ends:
            for level in [level for level, end in self._ends.items() if end <= now]:
                del self._ends[level], self._due[level]
        due = self._due
        if not due:
            self._begun, self.alarm = frozenset(), ""
            return ""
        self._begun = frozenset(level for level, time in due.items() if time <= now)
        self.alarm = next((level for level in _LEVELS if level in self._begun), "")
        return self.alarm


def _span(value: Reading) -> tuple[float, float] | None:
    """Return the minimum and maximum number in a value; None if the value has no numbers."""
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        return value, value
    if not isinstance(value, tuple):
        return None
    numbers = [one for one in value if isinstance(one, (int, float)) and not isinstance(one, bool)]
    return (min(numbers), max(numbers)) if numbers else None
