"""Alarm states of signals over time.

Callers pass the time, because the module reads no clock. A value equal to the limit causes an
alarm. The alarm ends when the value is inside the limit by ``hysteresis``. The key ``for`` delays
the alarm until the value has been beyond the limit for this time. A delayed alarm begins at
`AlarmMonitor.deadline`, even without another sample.
"""

from urc.model.values import Alarm, AlarmLimits, Reading

__all__ = ["AlarmMonitor"]

_LEVELS: tuple[Alarm, ...] = ("lolo", "hihi", "low", "high")
"""Alarm levels in order of severity, most severe first."""
_LOWER = ("lolo", "low")
_DEEPER = {"lolo": "low", "hihi": "high"}


class AlarmMonitor:
    """The alarm state of one signal."""

    __slots__ = ("_due", "_for_s", "_levels", "_within", "alarm")

    def __init__(self, limits: AlarmLimits) -> None:
        self.alarm: Alarm = ""
        self._for_s = limits.for_s
        self._within = limits.hysteresis
        self._levels: list[tuple[Alarm, float]] = [
            (level, limit) for level in _LEVELS if (limit := getattr(limits, level)) is not None
        ]
        self._due: dict[Alarm, float] = {}
        """Start times of pending and active alarms, by crossed level."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` may begin an alarm; None if only a sample can change the alarm."""
        active = (self.alarm, _DEEPER.get(self.alarm, ""))
        return min((due for level, due in self._due.items() if level not in active), default=None)

    def update(self, value: Reading, now: float) -> Alarm:
        """Process a new value, and return its alarm."""
        span = _span(value)
        if span is None:
            self._due.clear()
            self.alarm = ""
            return ""
        lowest, highest = span
        held = (self.alarm, _DEEPER.get(self.alarm, ""))
        for level, limit in self._levels:
            is_lower = level in _LOWER
            past = lowest <= limit if is_lower else highest >= limit
            if not past and level in held:
                # A value past "lolo" is past "low", too, so returning from "lolo" keeps "low"
                # active.
                back = self._within
                past = lowest < limit + back if is_lower else highest > limit - back
            if not past:
                self._due.pop(level, None)
            elif level not in self._due:
                self._due[level] = now + self._for_s
        return self.tick(now)

    def tick(self, now: float) -> Alarm:
        """Return the alarm of the newest value at `now`."""
        begun = (level for level in _LEVELS if self._due.get(level, now + 1) <= now)
        self.alarm = next(begun, "")
        return self.alarm


def _span(value: Reading) -> tuple[float, float] | None:
    """Return the minimum and maximum number in a value; None for a value without numbers."""
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        return value, value
    if not isinstance(value, tuple):
        return None
    numbers = [one for one in value if isinstance(one, (int, float)) and not isinstance(one, bool)]
    return (min(numbers), max(numbers)) if numbers else None
