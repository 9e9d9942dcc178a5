"""Rigid transforms: rotation and translation from one coordinate frame to another.

Pure. The transform of a frame converts coordinates in this frame to coordinates in its parent, as
in ROS: first the rotation, then the translation. Axes are those of REP 103: right-handed, and z is
up in frames on the ground.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from urc.expressions import quoted
from urc.protocol.values.convert import BadValue

__all__ = ["IDENTITY", "Transform", "compose", "invert", "move_columns"]
__all__ += ["transform_points", "transform_pose"]


class Transform(NamedTuple):
    """A translation in metres, and a rotation as a unit quaternion."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0


IDENTITY: Final = Transform()
_PLANAR: Final = 3
"""Number of elements of a planar pose: x, y and yaw."""
_SPATIAL: Final = 7
"""Number of elements of a pose in space: x, y, z, and a quaternion as x, y, z, w."""


def compose(outer: Transform, inner: Transform) -> Transform:
    """Return the transform that applies `inner`, then `outer`."""
    ax, ay, az, aw = outer[3:]
    bx, by, bz, bw = inner[3:]
    x, y, z = _rotated(outer, inner[0], inner[1], inner[2])
    return Transform(
        outer[0] + x,
        outer[1] + y,
        outer[2] + z,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def invert(transform: Transform) -> Transform:
    """Return the transform in the opposite direction."""
    turned = Transform(0.0, 0.0, 0.0, -transform[3], -transform[4], -transform[5], transform[6])
    x, y, z = _rotated(turned, transform[0], transform[1], transform[2])
    return turned._replace(x=-x, y=-y, z=-z)


def transform_pose(transform: Transform, pose: object) -> tuple[float | None, ...]:
    """Return a pose in another frame, with as many elements as `pose`.

    Args:
        transform: transform from the pose's frame to the other frame.
        pose: x, y and yaw, in metres and radians; or x, y, z, and a quaternion as x, y, z, w. The
            yaw in the result is the direction of the pose's x axis, seen from above.

    Raises:
        BadValue: `pose` has another shape.
    """
    numbers = _numbers(pose)
    if len(numbers) == _PLANAR:
        x, y, half = numbers[0], numbers[1], numbers[2] / 2
        placed = compose(transform, Transform(x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half)))
        qx, qy, qz, qw = placed[3:]
        yaw = math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
        return placed[0], placed[1], yaw
    if len(numbers) == _SPATIAL:
        norm = math.hypot(*numbers[3:])
        if not norm > 0:
            raise BadValue("the quaternion of the pose is zero")
        turn = [one / norm for one in numbers[3:]]
        return tuple(compose(transform, Transform(*numbers[:3], *turn)))
    raise BadValue(
        f"a pose has 3 elements (x, y, yaw) or 7 (x, y, z and a quaternion), found {len(numbers)}"
    )


def transform_points(transform: Transform, points: object) -> list[float]:
    """Return points on the ground in another frame: x and y in turn, as in `points`.

    The numbers are rounded to 0.1 mm: pages receive them as text, and a scan has hundreds.

    Raises:
        BadValue: `points` is not a list of x and y in turn.
    """
    numbers = _numbers(points)
    if len(numbers) % 2:
        raise BadValue(f"points are x and y in turn, found {len(numbers)} numbers")
    tx, ty, _, qx, qy, qz, qw = transform
    a, b = 1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw)
    c, d = 2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz)
    xs, ys = numbers[::2], numbers[1::2]
    found = [0.0] * len(numbers)
    found[::2] = [round(tx + a * x + b * y, 4) for x, y in zip(xs, ys, strict=True)]
    found[1::2] = [round(ty + c * x + d * y, 4) for x, y in zip(xs, ys, strict=True)]
    return found


def move_columns(
    transform: Transform, xs: Sequence[float], ys: Sequence[float], zs: Sequence[float]
) -> tuple[list[float], list[float], list[float]]:
    """Return points in another frame, as lists of their x, y and z."""
    a, b, c, tx = *_rotated(transform, 1, 0, 0), transform.x
    d, e, f, ty = *_rotated(transform, 0, 1, 0), transform.y
    g, h, i, tz = *_rotated(transform, 0, 0, 1), transform.z
    points = list(zip(xs, ys, zs, strict=True))
    return (
        [tx + a * x + d * y + g * z for x, y, z in points],
        [ty + b * x + e * y + h * z for x, y, z in points],
        [tz + c * x + f * y + i * z for x, y, z in points],
    )


def _rotated(by: Transform, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector, rotated by the rotation of a transform."""
    qx, qy, qz, qw = by[3], by[4], by[5], by[6]
    # Twice the cross product of the quaternion's vector and the given vector.
    cx, cy, cz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return (
        x + qw * cx + qy * cz - qz * cy,
        y + qw * cy + qz * cx - qx * cz,
        z + qw * cz + qx * cy - qy * cx,
    )


def _numbers(value: object) -> Sequence[float]:
    """Return a list of finite numbers; raise `BadValue` for any other value."""
    if not isinstance(value, (list, tuple)):
        raise BadValue(f"{quoted(value)} is not a list of numbers")
    try:
        total = sum(value)
        if total - total == 0:
            return value
    except (TypeError, OverflowError):
        pass
    raise BadValue(f"{quoted(value)} contains values that are not numbers")
