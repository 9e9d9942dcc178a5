"""How values become text, and filters that take apart what one field holds."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.expressions import ExpressionError, compile_expression, compile_template, spelt


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (20, "20"),
        (20.0, "20"),
        (-0.0, "0"),
        (0.5, "0.5"),
        (1e-07, "0.0000001"),
        (-1.25e-10, "-0.000000000125"),
        (1e22, "10000000000000000000000"),
        (1.5e16, "15000000000000000"),
        (123456789.125, "123456789.125"),
        (True, "true"),
        (False, "false"),
        (None, ""),
        ("as it is", "as it is"),
        (math.inf, "inf"),
        (math.nan, "nan"),
    ],
)
def test_a_value_has_one_spelling(value: object, text: str) -> None:
    assert spelt(value) == text
    assert compile_template("{{ x }}").render({"x": value}) == text
    assert compile_template("a{{ x }}b").render({"x": value}) == f"a{text}b"
    assert compile_expression("[x, x] | join(',')").render({"x": value}) == f"{text},{text}"


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_the_spelling_of_a_float_is_exact_and_has_no_exponent(value: float) -> None:
    text = spelt(value)
    assert float(text) == value
    assert set(text) <= set("-.0123456789")


@pytest.mark.parametrize(
    ("expression", "names", "value"),
    [
        ("x | split('\n') | column(1, ',')", {"x": "0,221,1\n1,223,2\n"}, ["221", "223"]),
        ("x | column('v')", {"x": [{"v": 1}, {"v": 2}]}, [1, 2]),
        ("x | column(-1)", {"x": [[1, 2], [3]]}, [2, 3]),
        ("x | split('\n') | cut(0, -1) | join", {"x": "abX\ncY"}, "abc"),
        ("x | cut(1)", {"x": [[1, 2], "ab"]}, [[2], "b"]),
        ("x | digits(3, 64)", {"x": "0CB1Dh3j0"}, [1234, 5432, 16000]),
        ("x | digits(2, 16, 'A')", {"x": "BAAB"}, [16, 1]),
        ("x | int(0, 16) | signed(32)", {"x": "FFF92230"}, -450000),
        ("x | signed(8)", {"x": 127}, 127),
        ("x | hexbytes | unpack('f32be')", {"x": "3F800000"}, 1.0),
        ("x | hexbytes | unpack('i16le', 2)", {"x": "4D05F6FF"}, -10),
        ("x | b64decode | unpack('u8', 1)", {"x": "AQI="}, 2),
        ("x | hexbytes | unpack('f32cdab')", {"x": "00003F80"}, 1.0),
        ("x | hexbytes | unpack('bcd24be')", {"x": "123456"}, 123456),
        ("x | hexbytes | unpack('varint', 1)", {"x": "08AC02"}, 300),
        ("x | hexbytes | unpack('u14by7le')", {"x": "2B01"}, 171),
        ("x | hexbytes | numbers('varint')", {"x": "AC0205"}, [300, 5]),
        ("x | hexbytes | numbers('bcd8')", {"x": "1099"}, [10, 99]),
        ("x | hexbytes | numbers('u16le')", {"x": "01000200"}, [1, 2]),
        ("x | i16le | hexdigits", {"x": -2}, "FEFF"),
        ("x | ramp(0.5, 3)", {"x": -1}, [-1.0, -0.5, 0.0]),
    ],
)
def test_filters_take_fields_apart(
    expression: str, names: dict[str, object], value: object
) -> None:
    assert compile_expression(expression).evaluate(names) == value


@pytest.mark.parametrize(
    ("expression", "names", "why"),
    [
        ("x | column('v')", {"x": [{"w": 1}]}, "the row {'w': 1} has no column 'v'"),
        ("x | column(5, ',')", {"x": ["a,b"]}, "the row ['a', 'b'] has no column 5"),
        ("x | cut(0, -1)", {"x": [3]}, "expected text or a list, found 3"),
        ("x | digits(3, 64)", {"x": "0000"}, "4 characters cannot be split into groups of 3"),
        ("x | digits(1, 10)", {"x": "A"}, "'A' is not a digit of base 10"),
        ("x | signed(8)", {"x": 256}, "the number must be a whole number from 0 to 255, found 256"),
        (
            "x | hexbytes | unpack('u16le', 1)",
            {"x": "0102"},
            "2 bytes contain no 'u16le' at offset 1",
        ),
        (
            "x | hexbytes | unpack(n)",
            {"x": "0102", "n": "word"},
            "a type such as 'u16le'",
        ),
        (
            "x | hexbytes | numbers('u16le')",
            {"x": "010203"},
            "3 bytes contain no 'u16le' at offset 2",
        ),
        ("x | unpack('u8')", {"x": "a"}, "expected bytes, such as from 'hexbytes'"),
        ("x | ramp(1, n)", {"x": 0, "n": 9000}, "the count must be a whole number from 0"),
    ],
)
def test_what_does_not_fit_says_so(expression: str, names: dict[str, object], why: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        compile_expression(expression).evaluate(names)
    assert why in str(caught.value)


@given(st.binary(max_size=64).filter(lambda data: len(data) % 4 == 0))
def test_numbers_are_what_struct_says(data: bytes) -> None:
    found = compile_expression("x | hexbytes | numbers('i32be')").evaluate({"x": data.hex()})
    assert found == [one for (one,) in struct.iter_unpack(">i", data)]
