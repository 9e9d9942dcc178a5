"""The emulated robot makes fields out of what is computed from them."""

import pytest

from urc.expressions import compile_expression
from urc.simulator.expression_inverse import field_of


@pytest.mark.parametrize(
    ("expressions", "values", "field"),
    [
        (["x | hexbytes | unpack('u16be')"], [6904], "1AF8"),
        (["x | hexbytes | unpack('f32be', 2)"], [1.0], "00003F800000"),
        (
            ["x | hexbytes | unpack('u16le', 0)", "x | hexbytes | unpack('i16le', 2)"],
            [1357, -10],
            "4D05F6FF",
        ),
        (["x | b64decode | unpack('u8', 1)"], [2], "AAI="),
        (["x | hexbytes | numbers('u16le')"], [[1, 2]], "01000200"),
        (["x | digits(3, 64)"], [[1234, 5432, 16000]], "0CB1Dh3j0"),
        (["x | digits(4, 64) | first"], [78976], "0CB0"),
        (["x | int(0, 16) | signed(32)"], [-450000], "FFF92230"),
        (["x | float"], [2.5], "2.5"),
    ],
)
def test_a_chain_of_filters_is_turned_round(
    expressions: list[str], values: list[object], field: str
) -> None:
    """And back: each expression gives its value again."""
    templates = [compile_expression(one) for one in expressions]
    assert field_of(zip(templates, values, strict=True)) == field
    assert [one.evaluate({"x": field}) for one in templates] == values


@pytest.mark.parametrize(
    "expression",
    [
        "x | split(',') | column(0)",
        "x | float * 2",
        "x[0:2] | int",
        "x | hexbytes | unpack('u8', x)",
    ],
)
def test_what_has_no_way_back_gives_nothing(expression: str) -> None:
    assert field_of([(compile_expression(expression), 1)]) is None


def test_what_does_not_fit_becomes_the_nearest_value() -> None:
    """An emulated reading may lie beyond what its bytes hold."""
    assert field_of([(compile_expression("x | hexbytes | unpack('u16le')"), 75320.4)]) == "FFFF"
    assert field_of([(compile_expression("x | digits(2, 10)"), [120, -3])]) == "9900"
