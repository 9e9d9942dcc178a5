"""Orientations, against worked examples."""

import math

import pytest

from urc.expressions import ExpressionError, compile_expression

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
