"""Expression filters for angles, roots, rounding and limits.

Private to `urc.filters.table`. Angles are in radians. An undefined result, such as the root of a
negative number, raises ValueError, as in all expressions.
"""

import math
from collections.abc import Callable
from typing import Any, Final

__all__ = ["GEOMETRY_FILTERS"]


def _number(value: object) -> float:
    if isinstance(value, (int, float)):
        return value
    text = repr(value)
    raise TypeError(f"expected a number, found {text if len(text) <= 40 else text[:37] + '...'}")


def _of(name: str, function: Callable[..., float], where: str = "") -> Callable[..., float]:
    """Return a filter that applies `function`; error messages end with `where`, the valid range."""

    def filtered(*values: object) -> float:
        numbers = [_number(value) for value in values]
        try:
            return function(*numbers)
        except (ValueError, OverflowError):
            shown = " and ".join(f"{number:g}" for number in numbers)
            reason = f"'{name}' is not defined for {shown}"
            raise ValueError(f"{reason}; {where}" if where else reason) from None

    return filtered


def _clamped(value: float, low: float, high: float) -> float:
    if not low <= high or math.isnan(value):
        raise ValueError
    return min(max(value, low), high)


MAX_POINTS: Final = 1440
"""Maximum number of points of a laser scan: four per degree. Of a larger scan, only every second,
third … distance is used."""


def _scan_points(ranges: object, first: object, step: object) -> list[float]:
    """Return x and y of the points of a laser scan in turn.

    Distances that are missing, or not above 0, are skipped: many scanners report 0 for no echo.
    """
    if not isinstance(ranges, (list, tuple)):
        raise TypeError("expected a list of distances")
    start, turn = _number(first), _number(step)
    every = -(-len(ranges) // MAX_POINTS) or 1
    found: list[float] = []
    for place in range(0, len(ranges), every):
        distance = ranges[place]
        if distance is None or not _number(distance) > 0:
            continue
        angle = start + turn * place
        found += (distance * math.cos(angle), distance * math.sin(angle))
    return found


GEOMETRY_FILTERS: Final[dict[str, tuple[Callable[..., Any], tuple[int, int]]]] = {
    "acos": (_of("acos", math.acos, "expected -1 to 1"), (0, 0)),
    "asin": (_of("asin", math.asin, "expected -1 to 1"), (0, 0)),
    "atan": (_of("atan", math.atan), (0, 0)),
    "atan2": (_of("atan2", math.atan2), (1, 1)),
    "ceil": (_of("ceil", math.ceil), (0, 0)),
    "clamp": (_of("clamp", _clamped, "expected the lower limit first"), (2, 2)),
    "cos": (_of("cos", math.cos), (0, 0)),
    "degrees": (_of("degrees", math.degrees), (0, 0)),
    "exp": (_of("exp", math.exp), (0, 0)),
    "floor": (_of("floor", math.floor), (0, 0)),
    "hypot": (_of("hypot", math.hypot), (1, 1)),
    "log": (_of("log", math.log, "expected a number above 0"), (0, 0)),
    "radians": (_of("radians", math.radians), (0, 0)),
    "scan_points": (_scan_points, (2, 2)),
    "sin": (_of("sin", math.sin), (0, 0)),
    "sqrt": (_of("sqrt", math.sqrt, "expected a number of at least 0"), (0, 0)),
    "tan": (_of("tan", math.tan), (0, 0)),
}
"""Filters for angles, points, roots, rounding and limits, by name: function, and the range of the
number of arguments."""
