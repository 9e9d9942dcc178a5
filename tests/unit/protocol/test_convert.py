"""Conversions: from what a robot says to what it means, and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.model.values import Conversion, Signal
from urc.protocol.values.convert import BadValue, build_conversion, build_inverse
from urc.protocol.values.decode import build_converter, build_raw

BATTERY = ((3.3, 0.0), (3.7, 50.0), (4.2, 100.0))
TABLE = [
    (Conversion(base=16), "FF", 255),
    (Conversion(base=16), "0x1f", 31),
    (Conversion(base=16), 7, 7),
    (Conversion(base=2), "-101", -5),
    (Conversion(polynomial=(0, 0.1)), 3, 0.3),
    (Conversion(polynomial=(-40, 0.01)), "2512", -14.88),
    (Conversion(polynomial=(1, 2)), 3, 7),
    (Conversion(polynomial=(1, 2, 3)), 2, 17.0),
    (Conversion(points=BATTERY), 3.5, 25.0),
    (Conversion(points=BATTERY), 1, 0.0),
    (Conversion(points=BATTERY), "9", 100.0),
    (Conversion(states=(("0", "off"), ("1", "on"))), 1.0, "on"),
    (Conversion(base=16, polynomial=(0, 0.5)), "A", 5.0),
    (Conversion(not_available=(-1, "--")), "-1", None),
    (Conversion(not_available=(-1, "--")), -1.0, None),
    (Conversion(not_available=(-1, "--")), "--", None),
    (Conversion(not_available=(-1, "--")), "-2", "-2"),
    (Conversion(not_available=("nan", "-inf")), -math.inf, None),
    (Conversion(not_available=("nan",)), "nan", None),
    (Conversion(not_available=("all_ones",), polynomial=(0, 2)), 65535, None),
    (Conversion(base=16, not_available=("all_ones",)), "FFFF", None),
    (Conversion(not_available=(False,)), False, None),
    (Conversion(not_available=(False,)), 0, 0),
    (Conversion(polynomial=(0, 2)), None, None),
]


@pytest.mark.parametrize(("conversion", "raw", "value"), TABLE)
def test_conversion(conversion: Conversion, raw: object, value: object) -> None:
    """One row a rule."""
    convert = build_conversion(conversion)
    assert convert is not None
    found = convert(raw)
    assert found == value
    assert isinstance(found, bool) == isinstance(value, bool)


@pytest.mark.parametrize(
    ("conversion", "raw"),
    [
        (Conversion(base=10), "ten"),
        (Conversion(base=16), "1_0"),
        (Conversion(polynomial=(0, 2)), "fast"),
        (Conversion(polynomial=(0, 2)), True),
        (Conversion(polynomial=(0, 2)), 10**400),
        (Conversion(points=BATTERY), [1]),
        (Conversion(states=(("0", "off"),)), 3),
    ],
)
def test_what_cannot_be_converted_is_refused(conversion: Conversion, raw: object) -> None:
    """A wrong number on the screen is worse than an old one."""
    convert = build_conversion(conversion)
    assert convert is not None
    with pytest.raises(BadValue):
        convert(raw)


@given(
    st.integers(-(10**6), 10**6),
    st.sampled_from([0.1, 0.01, 0.001, 2, -0.5, 3.7, 1 / 3]),
    st.sampled_from([0, -40, 273.15]),
)
def test_scale_and_offset_turn_round(raw: int, scale: float, offset: float) -> None:
    """A whole raw number comes back whole: a struct has no place for another."""
    conversion = Conversion(polynomial=(offset, scale))
    there, back = build_conversion(conversion), build_inverse(conversion)
    assert there is not None
    assert back is not None
    assert back(there(raw)) == raw


@given(st.floats(3.3, 4.2), st.booleans())
def test_points_turn_round(raw: float, is_falling: bool) -> None:
    """Falling tables, as of thermistors, too."""
    points = tuple((x, -y if is_falling else y) for x, y in BATTERY)
    conversion = Conversion(points=points)
    there, back = build_conversion(conversion), build_inverse(conversion)
    assert there is not None
    assert back is not None
    assert math.isclose(back(there(raw)), raw, abs_tol=1e-9)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("conversion", "value", "raw"),
    [
        (Conversion(base=16), 255, "FF"),
        (Conversion(base=36), -35, "-Z"),
        (Conversion(states=(("0", "off"), ("00", "off"))), "off", 0),
        (Conversion(states=(("00", "off"),)), "off", "00"),
        (Conversion(not_available=(-1,), polynomial=(0, 2)), None, -1),
        (Conversion(not_available=("--",)), None, "--"),
        (Conversion(not_available=("all_ones",)), None, 255),
    ],
)
def test_inverse(conversion: Conversion, value: object, raw: object) -> None:
    """What the emulated robot says for a value."""
    back = build_inverse(conversion)
    assert back is not None
    assert back(value) == raw
    assert type(back(value)) is type(raw)


@pytest.mark.parametrize(
    ("conversion", "value"),
    [
        (Conversion(polynomial=(0, 1, 2)), 3),
        (Conversion(polynomial=(0, 0)), 3),
        (Conversion(states=(("0", "off"),)), "on"),
        (Conversion(points=((0, 1), (1, 1), (2, 3))), 2),
    ],
)
def test_what_has_no_inverse_is_refused(conversion: Conversion, value: object) -> None:
    """The emulated robot leaves such a field out."""
    back = build_inverse(conversion)
    assert back is not None
    with pytest.raises(BadValue):
        back(value)


SIGNALS = [
    (Signal("s", "integer"), " 42 ", 42),
    (Signal("s", "integer", conversion=Conversion(polynomial=(0, 0.1))), 26, 3),
    (Signal("s", "integer", states=(("3", "go"),)), "03", "go"),
    (Signal("s", "string", states=(("03", "go"),)), "03", "go"),
    (Signal("s", "boolean"), "ON", True),
    (Signal("s"), float("nan"), None),
    (Signal("s", "array", size=2), "1, 2", (1.0, 2.0)),
    (Signal("s", "array"), "[]", ()),
    (Signal("s", "array", items="integer"), b"\x01\x02", (1, 2)),
    (Signal("s", "array", items="string"), ["a", None], ("a", None)),
    (Signal("s", "array", conversion=Conversion(polynomial=(0, 0.1))), [1, 2], (0.1, 0.2)),
    (Signal("s", "array", items="integer", states=(("1", "on"),)), [1], ("on",)),
    (Signal("s", "object"), {"x": 1}, {"x": 1}),
    (Signal("s", "blob"), b"ab", b"ab"),
    (Signal("s", "image"), "YWI=", b"ab"),
    (Signal("s", "blob", size=3), [1, 2, 255], b"\x01\x02\xff"),
]


@pytest.mark.parametrize(("signal", "raw", "value"), SIGNALS)
def test_signal_takes_a_raw_value(signal: Signal, raw: object, value: object) -> None:
    """One row a type."""
    assert build_converter(signal)(raw) == value


NUMBERS = st.floats() | st.none() | st.integers() | st.booleans() | st.sampled_from(["1.5", "x"])
BOUNDS = st.none() | st.floats(allow_nan=False)


@given(raw=st.lists(NUMBERS) | st.lists(st.floats(-9, 9) | st.none()), least=BOUNDS, most=BOUNDS)
def test_an_array_has_the_same_elements_as_single_values(
    raw: list[object], least: float | None, most: float | None
) -> None:
    """Whether all elements are checked together, such as the rays of a scan, or one by one."""
    convert = build_converter(Signal("s", "number", min=least, max=most))
    array = build_converter(Signal("s", "array", min=least, max=most))
    try:
        elements = tuple(map(convert, raw))
    except BadValue:
        with pytest.raises(BadValue):
            array(raw)
        return
    assert array(raw) == elements


REFUSED = [
    (Signal("s", max=5), 6, "6 is above its maximum 5"),
    (Signal("s", min=5), "4", "'4' is below its minimum 5"),
    (Signal("s"), math.inf, "inf is not finite"),
    (Signal("s", "array", size=2), [1], "expected 2 elements, found 1"),
    (Signal("s", "array", max=5), [1, 6], "element 1: 6 is above its maximum 5"),
    (Signal("s", "array"), 3, "3 is not a list"),
    (Signal("s", "object"), [1], "[1] is not a mapping"),
    (Signal("s", "blob", size=1), b"ab", "expected at most 1 bytes, found 2"),
    (Signal("s", "image"), "?", "'?' is not base64"),
    (Signal("s", "image"), [300], "[300] is not a list of bytes"),
    (Signal("s", "image"), 3, "3 is neither bytes nor base64"),
]


@pytest.mark.parametrize(("signal", "raw", "message"), REFUSED)
def test_signal_refuses(signal: Signal, raw: object, message: str) -> None:
    """The message says what was found."""
    with pytest.raises(BadValue) as refused:
        build_converter(signal)(raw)
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("signal", "value", "raw"),
    [
        (Signal("s"), 3, 3),
        (Signal("s", conversion=Conversion(polynomial=(0, 0.1))), 0.3, 3),
        (Signal("s", "string", states=(("1", "go"),)), "go", 1),
        (Signal("s", "array", conversion=Conversion(polynomial=(0, 0.1))), (0.1, 0.2), [1, 2]),
    ],
)
def test_signal_gives_a_raw_value(signal: Signal, value: object, raw: object) -> None:
    """What the emulated robot puts into a frame."""
    assert build_raw(signal)(value) == raw


def test_a_robot_has_words_of_its_own_for_true_and_false() -> None:
    """In both directions; any other word is a fault."""
    signal = Signal("stable", "boolean", states=(("S", "true"), ("D", "false")))
    convert, back = build_converter(signal), build_raw(signal)
    assert [convert("S"), convert("D"), convert(None)] == [True, False, None]
    assert [back(True), back(False)] == ["S", "D"]
    with pytest.raises(BadValue, match="not one of the states"):
        convert("X")
