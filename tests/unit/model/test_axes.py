"""Axes and orientations, against worked examples."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.expressions import ExpressionError, compile_expression
from urc.model.axes import turn_angle, turn_quaternion, turn_vector, turns
from urc.model.values import Axes

ORIENTATIONS = [
    ((10, 20, 30), (0.0381, 0.1893, 0.2393, 0.9515)),
    ((-45, 0, 90), (-0.2706, -0.2706, 0.6533, 0.6533)),
    ((0, -30, -170), (-0.2578, -0.0226, -0.9623, 0.0842)),
]


def angles(quaternion: object) -> tuple[float, ...]:
    """Return roll, pitch and yaw in degrees, by the filters that documents use."""
    found = [
        compile_expression(f"q | {name}").evaluate({"q": quaternion})
        for name in ("roll", "pitch", "yaw")
    ]
    return tuple(math.degrees(one) for one in found)


@pytest.mark.parametrize(("wanted", "quaternion"), ORIENTATIONS)
def test_orientation(wanted: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
    """As a list, as named parts, and of any length."""
    assert angles(quaternion) == pytest.approx(wanted, abs=0.02)
    assert angles(dict(zip("xyzw", quaternion, strict=True))) == pytest.approx(wanted, abs=0.02)
    assert angles([7 * one for one in quaternion]) == pytest.approx(wanted, abs=0.02)


@pytest.mark.parametrize(
    "absent", [None, [0, 0, 0, 0], [None, 0, 0, 1], [math.nan, 0, 0, 1], [math.inf, 0, 0, 1]]
)
def test_no_orientation_is_not_available(absent: object) -> None:
    """Zero is what a robot says that does not know."""
    assert math.isnan(compile_expression("q | yaw").evaluate({"q": absent}))


@pytest.mark.parametrize("wrong", [[1, 2, 3], "0 0 0 1", 3, {"x": 1}, ["a", 0, 0, 1], [True] * 4])
def test_what_is_no_orientation_is_refused(wrong: object) -> None:
    """With words for the author."""
    with pytest.raises(ExpressionError, match="expected a quaternion"):
        compile_expression("q | roll").evaluate({"q": wrong})


def test_vectors() -> None:
    """REP-103 on one side, autopilots on the other."""
    assert turn_vector((1, 2, 3), "FLU", "FRD") == (1, -2, -3)
    assert turn_vector((1, 2, 3), "ENU", "NED") == (2, 1, -3)
    assert turn_vector((1, 2), "NED", "ENU") == (2, 1)
    assert turn_vector((1, 2, 3), "FLU", "FLU") == (1, 2, 3)


def test_angles() -> None:
    """Nose up is positive in FRD and negative in FLU; a heading of 0 is east in ENU."""
    assert turn_angle(0.2, "FLU", "FRD", about="y") == -0.2
    assert turn_angle(0.2, "FLU", "FRD", about="x") == 0.2
    assert turn_angle(0, "ENU", "bearing", unit="deg") == 90
    assert turn_angle(180, "ENU", "bearing", unit="deg") == 270
    assert turn_angle(270, "bearing", "NED", unit="deg") == -90
    assert turn_angle(350, "bearing", "ENU", unit="deg") == 100
    assert turn_angle(math.pi / 2, "bearing", "ENU") == pytest.approx(0)


def test_orientation_of_a_level_robot_that_looks_north() -> None:
    """A FLU body with yaw 90° in ENU is a FRD body with no turn in NED."""
    turned = turn_quaternion((0, 0, math.sqrt(0.5), math.sqrt(0.5)), "ENU", "NED")
    assert turned == pytest.approx((0, 0, 0, 1))


@given(st.tuples(*[st.floats(-1, 1)] * 4))
def test_turning_twice_changes_nothing(quaternion: tuple[float, float, float, float]) -> None:
    """There and back, for every pair of axes."""
    for here, there in (("FLU", "FRD"), ("ENU", "NED")):
        once = turn_quaternion(quaternion, here, there)  # type: ignore[arg-type]
        twice = turn_quaternion(once, there, here)  # type: ignore[arg-type]
        assert twice == pytest.approx(quaternion)


@pytest.mark.parametrize(
    ("here", "there", "fits"),
    [("FLU", "FRD", True), ("ENU", "bearing", True), ("FLU", "ENU", False), ("", "", True),
     ("", "FLU", False)],
)  # fmt: skip
def test_which_axes_turn_into_which(here: Axes, there: Axes, fits: bool) -> None:
    """A body's axes say nothing of where it looks."""
    assert turns(here, there) == fits
    if not fits:
        for turn in (turn_vector, turn_quaternion):
            with pytest.raises(ValueError):
                turn((0, 0, 0, 1), here, there)
        with pytest.raises(ValueError):
            turn_angle(1, here, there)
