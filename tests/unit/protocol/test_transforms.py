"""Rigid transforms, compared with homogeneous matrices that numpy multiplies."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.protocol.values.convert import BadValue
from urc.protocol.values.transforms import (
    IDENTITY,
    Transform,
    compose,
    invert,
    transform_points,
    transform_pose,
)

_METRES = st.floats(-1000, 1000, allow_nan=False)
_ANGLE = st.floats(-math.pi, math.pi)


def matrix(transform: Transform) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the 4 by 4 matrix of a transform, by the formula of Shuster (1993), equation 117."""
    vector = np.array(transform[3:6])
    w = transform.qw
    x, y, z = vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    found = np.eye(4)
    found[:3, :3] = (
        (w * w - vector @ vector) * np.eye(3) + 2 * np.outer(vector, vector) + 2 * w * cross
    )
    found[:3, 3] = transform[:3]
    return found


@st.composite
def transforms(draw: st.DrawFn) -> Transform:
    """Return a transform with a random axis and angle."""
    axis = np.array([draw(st.floats(-1, 1)) for _ in range(3)])
    length = float(np.linalg.norm(axis))
    axis = axis / length if length > 1e-3 else np.array([0.0, 0.0, 1.0])
    half = draw(_ANGLE) / 2
    turn = (float(one) * math.sin(half) for one in axis)
    return Transform(draw(_METRES), draw(_METRES), draw(_METRES), *turn, math.cos(half))


@given(transforms(), transforms())
def test_a_composition_is_the_product_of_the_matrices(outer: Transform, inner: Transform) -> None:
    np.testing.assert_allclose(
        matrix(compose(outer, inner)), matrix(outer) @ matrix(inner), atol=1e-6
    )


@given(transforms())
def test_an_inverse_is_the_inverse_matrix(one: Transform) -> None:
    np.testing.assert_allclose(matrix(invert(one)), np.linalg.inv(matrix(one)), atol=1e-6)


@given(transforms(), st.lists(st.tuples(_METRES, _METRES), max_size=8))
def test_points_lie_on_the_ground_of_their_own_frame(
    one: Transform, points: list[tuple[float, float]]
) -> None:
    found = transform_points(one, [number for point in points for number in point])
    wanted = [(matrix(one) @ [x, y, 0, 1])[:2] for x, y in points]
    np.testing.assert_allclose(found, [number for point in wanted for number in point], atol=6e-5)


@given(transforms(), transforms())
def test_a_pose_in_space_is_composed(one: Transform, pose: Transform) -> None:
    found = transform_pose(one, tuple(pose))
    np.testing.assert_allclose(matrix(Transform(*found)), matrix(one) @ matrix(pose), atol=1e-6)


@given(_METRES, _METRES, _ANGLE, _METRES, _METRES, _ANGLE)
def test_a_planar_pose_is_rotated_and_moved(
    tx: float, ty: float, turn: float, x: float, y: float, yaw: float
) -> None:
    one = Transform(tx, ty, 0, 0, 0, math.sin(turn / 2), math.cos(turn / 2))
    px, py, found = transform_pose(one, [x, y, yaw])
    assert (px, py) == pytest.approx(
        (
            tx + x * math.cos(turn) - y * math.sin(turn),
            ty + x * math.sin(turn) + y * math.cos(turn),
        ),
        abs=1e-6,
    )
    assert math.remainder(found - yaw - turn, math.tau) == pytest.approx(0, abs=1e-6)


def test_a_scanner_that_hangs_upside_down_is_mirrored() -> None:
    """A roll of 180 degrees: a point to the left of the scanner is to the right of the robot."""
    upside_down = Transform(0.1, 0, 0.3, qx=1.0, qw=0.0)
    assert transform_points(upside_down, [1, 0.5]) == pytest.approx([1.1, -0.5])
    assert transform_pose(upside_down, [0, 0, 0.4])[2] == pytest.approx(-0.4)


def test_nothing_changes_within_one_frame() -> None:
    assert transform_pose(IDENTITY, (1.5, -2, 0.5)) == pytest.approx((1.5, -2, 0.5))
    assert transform_points(IDENTITY, []) == []


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ([1, 2], "a pose has 3 elements"),
        ([1, 2, None], "not numbers"),
        ([1, 2, math.inf], "not numbers"),
        ([1, 2, "3"], "not numbers"),
        ("1 2 3", "not a list"),
        ([0, 0, 0, 0, 0, 0, 0], "zero"),
        ([10**400, 0, 0.5], "not numbers"),
    ],
)
def test_a_value_that_is_no_pose_is_described(value: object, reason: str) -> None:
    with pytest.raises(BadValue, match=reason):
        transform_pose(IDENTITY, value)


def test_points_need_pairs() -> None:
    with pytest.raises(BadValue, match="x and y in turn, found 3 numbers"):
        transform_points(IDENTITY, [1, 2, 3])
