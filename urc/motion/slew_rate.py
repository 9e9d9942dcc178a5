"""A slew rate limit for held commands that limits acceleration but never braking.

Distances are measured from rest, the value at which the robot stands still. A change towards rest
is applied immediately. A change away from rest is limited. A change that crosses rest reaches rest
immediately; only the change beyond rest is limited.
"""

import math
from collections.abc import Mapping
from typing import Final

from urc.model.values import Reading

__all__ = ["SlewRateLimiter"]

_LONGEST_S: Final = 1.0
"""Maximum time step for the calculation, in seconds; equal to the longest permitted lease."""


class SlewRateLimiter:
    """The slew rate limits of one held command, and its arguments' current distances from rest."""

    __slots__ = ("_first_s", "_last_s", "_per_s", "_reached", "_rest")

    def __init__(
        self, per_s: Mapping[str, float], rest: Mapping[str, Reading], first_s: float
    ) -> None:
        """Begin at rest.

        Args:
            per_s: maximum increase of each argument per second, in the unit of the argument.
            rest: value of each argument at standstill; 0 for a missing argument.
            first_s: time step assumed for the first value of a motion, in seconds.
        """
        self._per_s = per_s
        self._rest = {name: rest.get(name) for name in per_s}
        self._first_s = first_s
        self._reached: dict[str, tuple[float, ...]] = {}
        """Current distance of each array element from rest, keyed by argument."""
        self._last_s: float | None = None

    def reset(self) -> None:
        """Set all distances to zero, so that the next motion begins at rest."""
        self._reached.clear()
        self._last_s = None

    def limit(self, values: Mapping[str, Reading], now: float) -> dict[str, Reading]:
        """Return `values`, each limited to its maximum distance from rest at the time `now`.

        Non-numeric values stay unchanged, because the argument check refuses them later.
        """
        last_s, self._last_s = self._last_s, now
        passed_s = self._first_s if last_s is None else min(max(0.0, now - last_s), _LONGEST_S)
        limited = dict(values)
        for name, per_s in self._per_s.items():
            if name in values:
                limited[name] = self._value(name, values[name], per_s * passed_s)
        return limited

    def _value(self, name: str, wanted: Reading, room: float) -> Reading:
        given = wanted if isinstance(wanted, (tuple, list)) else (wanted,)
        numbers = [one for one in given if _is_number(one)]
        if len(numbers) < len(given):
            return wanted
        rests = self._rests(name, len(given))
        before = self._reached.get(name, ())
        reached: list[float] = []
        for place, (one, rest) in enumerate(zip(numbers, rests, strict=True)):
            was = before[place] if place < len(before) else 0.0
            reached.append(_grown(float(one) - rest, was, room))
        self._reached[name] = tuple(reached)
        made = tuple(
            _written(one, rest, far) for one, rest, far in zip(numbers, rests, reached, strict=True)
        )
        return made if isinstance(wanted, (tuple, list)) else made[0]

    def _rests(self, name: str, count: int) -> list[float]:
        rest = self._rest[name]
        found = rest if isinstance(rest, (tuple, list)) else (rest,) * count
        numbers = [one if isinstance(one, (int, float)) else 0.0 for one in found]
        return (numbers + [0.0] * count)[:count]


def _grown(wanted: float, was: float, room: float) -> float:
    """Return the permitted distance from rest, at most `room` more than the distance `was`."""
    start = abs(was) if was * wanted > 0 else 0.0
    return math.copysign(min(abs(wanted), start + room), wanted)


def _written(wanted: float, rest: float, far: float) -> float:
    """Return `wanted`, or the value at the distance `far` from rest if `wanted` is farther away."""
    if abs(wanted - rest) <= abs(far):
        return wanted
    return int(rest) + math.trunc(far) if isinstance(wanted, int) else rest + far


def _is_number(value: object) -> bool:
    is_plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_plain and math.isfinite(value)  # type: ignore[arg-type]
