"""Which limit a value has passed, from one reading to the next.

Floor 3, pure: time is passed in. A limit is passed at its very value; once its alarm has begun, it
ends ``hysteresis`` inside. With ``for`` the alarm begins only when the value has stayed past the
limit for that long, even if no further reading comes: `Judge.deadline` says when to look again.
"""

from urc.model.values import Alarm, Limits, Reading

__all__ = ["Judge"]

_LEVELS: tuple[Alarm, ...] = ("lolo", "hihi", "low", "high")
"""The graver ones first."""
_LOWER = ("lolo", "low")
_DEEPER = {"lolo": "low", "hihi": "high"}


class Judge:
    """Owns the alarm state of one signal."""

    __slots__ = ("_due", "_for_s", "_levels", "_within", "alarm")

    def __init__(self, limits: Limits) -> None:
        self.alarm: Alarm = ""
        self._for_s = limits.for_s
        self._within = limits.hysteresis
        self._levels: list[tuple[Alarm, float]] = [
            (level, limit) for level in _LEVELS if (limit := getattr(limits, level)) is not None
        ]
        self._due: dict[Alarm, float] = {}
        """Level that the value is past → when its alarm begins."""

    @property
    def deadline(self) -> float | None:
        """When `tick` may begin an alarm; None when only a reading can change anything."""
        active = (self.alarm, _DEEPER.get(self.alarm, ""))
        return min((due for level, due in self._due.items() if level not in active), default=None)

    def judge(self, value: Reading, now: float) -> Alarm:
        """Take a reading and return its alarm."""
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
                # Past "lolo" one is past "low" as well, so coming back from it keeps "low" alive.
                back = self._within
                past = lowest < limit + back if is_lower else highest > limit - back
            if not past:
                self._due.pop(level, None)
            elif level not in self._due:
                self._due[level] = now + self._for_s
        return self.tick(now)

    def tick(self, now: float) -> Alarm:
        """Return the alarm of the newest reading at `now`."""
        begun = (level for level in _LEVELS if self._due.get(level, now + 1) <= now)
        self.alarm = next(begun, "")
        return self.alarm


def _span(value: Reading) -> tuple[float, float] | None:
    """Return the smallest and largest number in a reading; None when there is none."""
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        return value, value
    if not isinstance(value, tuple):
        return None
    numbers = [one for one in value if isinstance(one, (int, float)) and not isinstance(one, bool)]
    return (min(numbers), max(numbers)) if numbers else None
