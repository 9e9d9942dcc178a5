"""Units of one kind are converted; others do not fit."""

import math

import pytest

from urc.model.units import conversion


@pytest.mark.parametrize(
    ("have", "want", "value", "expected"),
    [
        ("rad", "deg", math.pi, 180),
        ("deg", "rad", 180, math.pi),
        ("m/s", "km/h", 10, 36),
        ("degC", "K", 0, 273.15),
        ("degF", "degC", 212, 100),
        ("degC", "°F", -40, -40),
        ("V", "mV", 1.5, 1500),
        ("rpm", "rad/s", 60, 2 * math.pi),
        ("mAh", "Ah", 2200, 2.2),
        ("furlong", "furlong", 3, 3),
        ("", "", 3, 3),
    ],
)
def test_a_value_gets_into_the_other_unit(
    have: str, want: str, value: float, expected: float
) -> None:
    """Factors and zero points; a unit that nobody knows fits itself."""
    scale = conversion(have, want)
    assert scale is not None
    assert scale(value) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("have", "want"), [("V", "%"), ("", "V"), ("m", "m/s"), ("rad", "furlong")]
)
def test_units_of_other_kinds_do_not_fit(have: str, want: str) -> None:
    """Nothing is shown that is wrong by a factor."""
    assert conversion(have, want) is None
