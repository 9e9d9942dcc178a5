"""Angles, roots and rounding in expressions."""

import math

import pytest

from urc.expressions import ExpressionError, compile_expression, compile_template


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("pi", math.pi),
        ("(pi / 6) | sin", 0.5),
        ("(pi / 3) | cos", 0.5),
        ("(pi / 4) | tan", 1.0),
        ("0.5 | asin | degrees", 30.0),
        ("0.5 | acos | degrees", 60.0),
        ("1 | atan | degrees", 45.0),
        ("1 | atan2(-1) | degrees", 135.0),
        ("180 | radians", math.pi),
        ("3 | hypot(4)", 5.0),
        ("16 | sqrt", 4.0),
        ("1 | exp | log", 1.0),
        ("-2.5 | floor", -3),
        ("2.1 | ceil", 3),
        ("130 | clamp(-100, 100)", 100),
        ("-130 | clamp(-100, 100)", -100),
        ("0.5 | clamp(0, 1)", 0.5),
        ("x | sin * 2", 2 * math.sin(0.3)),
    ],
)
def test_what_each_gives(text: str, expected: float) -> None:
    """In radians, as everywhere in expressions."""
    assert compile_expression(text).evaluate({"x": 0.3}) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("-1 | sqrt", "'sqrt' is not defined for -1; expected a number of at least 0"),
        ("2 | asin", "'asin' is not defined for 2; expected -1 to 1"),
        ("0 | log", "'log' is not defined for 0; expected a number above 0"),
        ("1000 | exp", "'exp' is not defined for 1000"),
        ("'a' | sin", "expected a number, found 'a'"),
        ("1 | clamp(2, 0)", "'clamp' is not defined for 1 and 2 and 0; expected the lower limit"),
        ("x | clamp(0, 1)", "'clamp' is not defined for nan and 0 and 1"),
    ],
)
def test_what_has_no_value_says_why(text: str, why: str) -> None:
    """No reading becomes a zero by accident."""
    with pytest.raises(ExpressionError, match=why):
        compile_expression(text).evaluate({"x": math.nan})


def test_the_number_pi_is_no_name_that_somebody_must_give() -> None:
    """A template of it alone is constant."""
    assert compile_template("{{ pi }}").is_constant
    assert compile_template("{{ settings.pi }}").settings == {"pi"}
