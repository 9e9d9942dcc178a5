"""Converts a quaternion to roll, pitch and yaw, in radians.

Private to `urc.filters.table`. A quaternion is [x, y, z, w] or {x, y, z, w}, of any norm except
zero. Roll, pitch and yaw are rotations about x, then y, then z, in the axes of REP-103. Without an
orientation, all angles are not-a-number. Arithmetic preserves not-a-number, which means "not
available".
"""

import math
from collections.abc import Mapping

__all__ = ["pitch", "roll", "yaw"]

_Parts = tuple[float, float, float, float]


def roll(value: object) -> float:
    """Return the roll angle (about x), -pi to pi; not-a-number without an orientation."""
    q = _parts(value)
    if q is None:
        return math.nan
    x, y, z, w = q
    return math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))


def pitch(value: object) -> float:
    """Return the pitch angle (about y), -pi/2 to pi/2; not-a-number without an orientation."""
    q = _parts(value)
    if q is None:
        return math.nan
    x, y, z, w = q
    return math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))


def yaw(value: object) -> float:
    """Return the yaw angle (about z), -pi to pi; not-a-number without an orientation."""
    q = _parts(value)
    if q is None:
        return math.nan
    x, y, z, w = q
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _parts(value: object) -> _Parts | None:
    """Return a unit quaternion; None for a missing, zero or infinite quaternion."""
    if value is None:
        return None
    if isinstance(value, Mapping):
        items = [value.get(name, "") for name in "xyzw"]
    elif isinstance(value, (list, tuple)):
        items = list(value)
    else:
        items = []
    if len(items) != 4 or any(isinstance(one, (bool, str)) for one in items):
        raise TypeError("expected a quaternion: [x, y, z, w], or the parts x, y, z and w")
    if any(one is None for one in items):
        return None
    try:
        length = math.hypot(*items)
    except (OverflowError, TypeError):
        raise TypeError("the parts of a quaternion must be numbers") from None
    if not 0 < length < math.inf:
        return None
    x, y, z, w = (one / length for one in items)
    return (x, y, z, w)
