"""Filters that give bytes, hashes and base64: what they give, and where they may stand."""

import hashlib
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc._number_types import NUMBER_NAMES, number_of
from urc.expressions import ExpressionError, compile_expression, compile_template
from urc.filters.binary import BYTE_FILTERS

VALUES = [
    ("x | u8", b"\x05"),
    ("x | u16be", b"\x00\x05"),
    ("x | u24le", b"\x05\x00\x00"),
    ("-x | i8", b"\xfb"),
    ("x | f64be", struct.pack(">d", 5)),
    ("1.5 | i16le", b"\x02\x00"),
    ("'0aFf 01' | hexbytes", b"\x0a\xff\x01"),
    ("'é' | utf8", "é".encode()),
    ("'aGk=' | b64decode", b"hi"),
    ("'hi' | b64encode", "aGk="),
    ("'abc' | md5", hashlib.md5(b"abc").hexdigest()),  # noqa: S324  # a login of a robot
    ("'abc' | sha1", hashlib.sha1(b"abc").hexdigest()),  # noqa: S324  # the same
    ("'abc' | sha256 | length", 64),
    # RFC 4231, test case 2
    ("'what do ya want for nothing?' | hmac_sha256('Jefe')",
     "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"),
    ("'0102' | hexbytes | sha256", hashlib.sha256(b"\1\2").hexdigest()),
    ("x | u16be | length", 2),
    # Modbus over serial line: registers of a float, the low word first
    ("1.0 | f32cdab", b"\x00\x00\x3f\x80"),
    # Protocol Buffers, encoding: 300, and zigzag
    ("300 | varint", b"\xac\x02"),
    ("-2 | zigzag", b"\x03"),
    ("1234 | bcd16be", b"\x12\x34"),
    ("true | bool", b"\x01"),
    ("171 | u14by7le", b"\x2b\x01"),
]  # fmt: skip


@pytest.mark.parametrize(("source", "expected"), VALUES)
def test_filter_gives(source: str, expected: object) -> None:
    """Bytes and the text of hashes, lower-case."""
    assert compile_expression(source, allows_bytes=True).evaluate({"x": 5}) == expected


@pytest.mark.parametrize("name", BYTE_FILTERS)
def test_bytes_are_refused_in_text(name: str) -> None:
    """One line at load, and another filter behind it may make text of them."""
    with pytest.raises(ExpressionError, match=f"'{name}' returns bytes, which only") as refused:
        compile_template(f"GO {{{{ x | {name} }}}}")
    assert refused.value.offset == 10
    compile_template(f"GO {{{{ x | {name} | md5 }}}}")


@pytest.mark.parametrize("source", ["{{ (x | u8) }}", "{{ (x | u8) ~ 'a' }}"])
def test_brackets_do_not_hide_bytes(source: str) -> None:
    """Refused at load, too."""
    with pytest.raises(ExpressionError, match="returns bytes"):
        compile_template(source)


@pytest.mark.parametrize("source", ["{{ x | u8 | default(1) }}", "A{{ x | u8 | default(1) }}"])
def test_bytes_that_slip_into_text_are_refused_when_sent(source: str) -> None:
    """Never the word b'...' on the wire."""
    with pytest.raises(ExpressionError, match="bytes are not text"):
        compile_template(source).render({"x": 5})


@pytest.mark.parametrize(
    "source",
    ["'a' | u8", "'0' | hexbytes", "5 | hexbytes", "'?' | b64decode", "5 | md5", "256 | u8",
     "-1 | u16be", "1e999 | u8"],
)  # fmt: skip
def test_wrong_values_are_refused(source: str) -> None:
    """With words for a person."""
    with pytest.raises(ExpressionError):
        compile_expression(source, allows_bytes=True).evaluate({})


@given(st.sampled_from(NUMBER_NAMES), st.integers(-(2**70), 2**70) | st.floats())
def test_any_number_gives_its_size_or_is_refused(name: str, number: float) -> None:
    """Never an exception of another kind, never other bytes."""
    try:
        data = compile_expression(f"x | {name}", allows_bytes=True).evaluate({"x": number})
    except ExpressionError:
        return
    kind = number_of(name)
    assert kind is not None
    assert 1 <= len(data) <= 10 if kind.is_variable else len(data) == kind.size


@given(st.sampled_from(NUMBER_NAMES), st.integers(0, 99))
def test_what_a_filter_packs_unpack_reads(name: str, number: int) -> None:
    """Every type that a `struct` knows, both ways."""
    value = number % 2 if name == "bool" else number
    source = f"x | {name} | unpack('{name}')"
    assert compile_expression(source).evaluate({"x": value}) == value


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("'GPGLL,5057.970,N,00146.110,E,142451,A' | checksum('xor8') | hex(2)", "27"),
        ("'N3 T0' | checksum('xor8')", 57),
        ("'123456789' | checksum('crc16-modbus') | hex(4)", "4B37"),
        ("'0102' | hexbytes | checksum('sum8')", 3),
    ],
)
def test_a_checksum_is_a_number(source: str, expected: object) -> None:
    """gpsd's NMEA notes, the RepRap wiki, and the check value of the catalogue of CRCs."""
    assert compile_expression(source).evaluate({}) == expected


def test_a_checksum_that_does_not_exist_is_refused_at_load() -> None:
    """With the nearest one that does."""
    with pytest.raises(ExpressionError, match="no checksum 'xor9'; did you mean 'xor8'") as refused:
        compile_expression("x | checksum('xor9')")
    assert refused.value.offset == 13


@pytest.mark.parametrize("test", ["unpack('u17be')", "numbers('flot32')", "unpack('u16')"])
def test_a_type_that_does_not_exist_is_refused_at_load(test: str) -> None:
    """Not at the first frame, when a robot is connected."""
    with pytest.raises(ExpressionError, match="there is no type") as refused:
        compile_expression(f"x | hexbytes | {test}")
    assert refused.value.offset == 15 + test.index("(") + 1
