"""Filters that give bytes, hashes and base64: what they give, and where they may stand."""

import hashlib
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc._bytes import BYTE_FILTERS, NUMBERS
from urc.expressions import ExpressionError, compile_expression, compile_template

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
]  # fmt: skip


@pytest.mark.parametrize(("source", "expected"), VALUES)
def test_filter_gives(source: str, expected: object) -> None:
    """Bytes and the text of hashes, lower-case."""
    assert compile_expression(source, allows_bytes=True).evaluate({"x": 5}) == expected


@pytest.mark.parametrize("name", BYTE_FILTERS)
def test_bytes_are_refused_in_text(name: str) -> None:
    """One line at load, and another filter behind it may make text of them."""
    with pytest.raises(ExpressionError, match=f"'{name}' gives bytes, which only") as refused:
        compile_template(f"GO {{{{ x | {name} }}}}")
    assert refused.value.offset == 10
    compile_template(f"GO {{{{ x | {name} | md5 }}}}")


@pytest.mark.parametrize("source", ["{{ (x | u8) }}", "{{ (x | u8) ~ 'a' }}"])
def test_brackets_do_not_hide_bytes(source: str) -> None:
    """Refused at load, too."""
    with pytest.raises(ExpressionError, match="gives bytes"):
        compile_template(source)


@pytest.mark.parametrize("source", ["{{ x | u8 | default(1) }}", "A{{ x | u8 | default(1) }}"])
def test_bytes_that_slip_into_text_are_refused_when_sent(source: str) -> None:
    """Never the word b'...' on the wire."""
    with pytest.raises(ExpressionError, match="bytes are no text"):
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


@given(st.sampled_from(sorted(NUMBERS)), st.integers(-(2**70), 2**70) | st.floats())
def test_any_number_gives_its_size_or_is_refused(name: str, number: float) -> None:
    """Never an exception of another kind, never other bytes."""
    try:
        data = compile_expression(f"x | {name}", allows_bytes=True).evaluate({"x": number})
    except ExpressionError:
        return
    assert len(data) == NUMBERS[name][1] // 8
