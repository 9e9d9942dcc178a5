"""Axis conventions, and the conversion of values between two conventions.

Arithmetic only. Body axes are FLU (x forward, y left, z up; REP-103) and FRD (x forward, y right, z
down). World axes are ENU (east, north, up) and NED (north, east, down). A bearing is a clockwise
angle from north.
"""

import math
from collections.abc import Sequence
from typing import Final

from urc.model.values import Axes

__all__ = ["ANGLE_UNITS", "turn_angle", "turn_quaternion", "turn_vector", "turns"]

ANGLE_UNITS: Final = ("rad", "deg", "°")
_BODY: Final = ("FLU", "FRD")
_WORLD: Final = ("ENU", "NED")
_HALF: Final = math.sqrt(0.5)


def turns(here: Axes, there: Axes) -> bool:
    """Return whether two conventions are convertible: both for a body, or both for a world."""
    if here == there or not here or not there:
        return here == there
    world = (*_WORLD, "bearing")
    return (here in _BODY and there in _BODY) or (here in world and there in world)


def turn_vector(vector: Sequence[float], here: Axes, there: Axes) -> tuple[float, ...]:
    """Convert a vector of two or three numbers from the axes `here` to the axes `there`."""
    if here == there:
        return tuple(vector)
    if here in _BODY and there in _BODY:
        first, *others = vector
        return (first, *(-one for one in others))
    if here in _WORLD and there in _WORLD:
        east, north, *up = vector
        return (north, east, *(-one for one in up))
    raise ValueError(f"a vector cannot be converted from {here} to {there}")


def turn_quaternion(
    quaternion: Sequence[float], here: Axes, there: Axes
) -> tuple[float, float, float, float]:
    """Convert an orientation [x, y, z, w] from the axes `here` to the axes `there`.

    Between FLU and FRD, the result is the same rotation in the new axes. Between ENU and NED, the
    body axes also change, as in autopilots. An FLU body in ENU becomes an FRD body in NED.
    """
    x, y, z, w = quaternion
    if here == there:
        return (x, y, z, w)
    if here in _BODY and there in _BODY:
        return (x, -y, -z, w)
    if here in _WORLD and there in _WORLD:
        return ((x + y) * _HALF, (x - y) * _HALF, (w - z) * _HALF, (w + z) * _HALF)
    raise ValueError(f"an orientation cannot be converted from {here} to {there}")


def turn_angle(
    angle: float, here: Axes, there: Axes, *, about: str = "z", unit: str = "rad"
) -> float:
    """Convert a heading, or an angle or rate about one body axis, to the axes `there`.

    Args:
        angle: angle, angular rate or heading to convert, in `unit`.
        here: current axis convention of `angle`; ENU, NED or bearing for a heading.
        there: target axis convention.
        about: rotation axis for body axes: ``x`` (roll), ``y`` (pitch) or ``z`` (yaw).
        unit: ``rad``, ``deg`` or ``°``; needed for headings, because headings wrap at a full turn.
    """
    if here == there:
        return angle
    if here in _BODY and there in _BODY:
        return angle if about == "x" else -angle
    if not turns(here, there):
        raise ValueError(f"an angle cannot be converted from {here} to {there}")
    full = 2 * math.pi if unit == "rad" else 360.0
    from_north = full / 4 - angle if here == "ENU" else angle
    turned = full / 4 - from_north if there == "ENU" else from_north
    if there == "bearing":
        return turned % full
    return (turned + full / 2) % full - full / 2
