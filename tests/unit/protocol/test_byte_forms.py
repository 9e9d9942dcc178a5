"""The forms hex, bytes and json of what is sent, in both directions."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.config.parse.forms import bytes as bytes_form
from urc.config.parse.forms import hex as hex_form
from urc.config.parse.forms import json_text
from urc.expressions import ExpressionError
from urc.protocol.forms.table import build_writer
from urc.protocol.values.payload import CodecContext, Frame, NotWritable, PayloadWriter
from urc.source import parse_document

FORMS = {"hex": hex_form, "bytes": bytes_form, "json": json_text}


def writer(source: str, encoding: str = "utf-8") -> PayloadWriter:
    """Return what writes the form in `source`: ``hex: …``, ``bytes: …`` or ``json: …``."""
    document = parse_document(source, "test.yaml")
    part = Node(document, (), document.data)
    problems = Problems()
    ((key, inner),) = part.entries().items()
    spec = FORMS[key].parse_write(inner, problems, FormContext(encoding))
    assert spec is not None, list(problems)
    return build_writer(spec, CodecContext(encoding))


WRITTEN = [
    ("hex: '80 83'", {}, "8083", {}),
    ("hex: '91 {{ right | i16be }} {{ left|i16be }}'", {"right": 200, "left": -200},
     "91 00C8 FF38", {"right": 200, "left": -200}),
    ("hex: '{{ x | u24le }}{{ y | f32le }}'", {"x": 1, "y": 1.0}, "010000 0000803F",
     {"x": 1, "y": 1.0}),
    ("hex: '02 {{ data | hexbytes }} 03'", {"data": "0aFF"}, "02 0AFF 03", {"data": "0aff"}),
    ("hex: '{{ name | length | u8 }} {{ name | utf8 }}'", {"name": "abc"}, "03 616263",
     {"name": "abc"}),
    ("hex: '{{ (x * 10) | u8 }}'", {"x": 1.26}, "0D", {}),
    ("bytes: [0x02, STX, 'GO ', '{{ x }}', [CR, LF]]", {"x": 65}, "02 02 474F20 41 0D0A", {}),
    ("bytes: ['{{ name }}', ETX]", {"name": "ab"}, "6162 03", {}),
    ("bytes: ['{{ x | u16be }}', '{{ y | i8 }}']", {"x": 513, "y": -1}, "0201 FF",
     {"x": 513, "y": -1}),
]  # fmt: skip


@pytest.mark.parametrize(("source", "values", "data", "read"), WRITTEN)
def test_bytes_are_written_and_read_back(
    source: str, values: dict[str, Any], data: str, read: dict[str, Any]
) -> None:
    """What has a name and a width of its own comes back, the rest only has to fit."""
    one = writer(source)
    assert one.write(values) == bytes.fromhex(data)
    found = one.read(Frame(bytes.fromhex(data), "utf-8"))
    assert found is not None
    assert dict(found) == read


REFUSED = [
    ("hex: '{{ x | u8 }}'", {"x": 256}, "256 does not fit into 'u8': expected 0 to 255"),
    ("hex: '{{ x | i8 }}'", {"x": -129}, "-129 does not fit into 'i8': expected -128 to 127"),
    ("hex: '{{ x | u8 }}'", {"x": float("nan")}, "expected a whole number for 'u8', found nan"),
    ("hex: '{{ x | u8 }}'", {"x": "a"}, "expected a number for 'u8', found 'a'"),
    ("hex: '{{ x | f32be }}'", {"x": 1e39}, "1e+39 is too large for 'f32be'"),
    ("hex: '{{ x | hexbytes }}'", {"x": "0g"}, "expected hex digits, found '0g'"),
    ("bytes: ['{{ x }}']", {"x": 256}, "x: expected a byte, 0 to 255, found 256"),
    ("bytes: ['{{ x }}']", {"x": None}, "x: None is neither a byte nor text"),
    ("bytes: ['{{ x }}']", {"x": 1.5}, "x: 1.5 is neither a byte nor text"),
    ("json: ['{{ x }}']", {"x": float("inf")}, "JSON cannot represent infinity or NaN"),
]  # fmt: skip


@pytest.mark.parametrize(("source", "values", "message"), REFUSED)
def test_values_that_do_not_fit_are_refused(
    source: str, values: dict[str, Any], message: str
) -> None:
    """One line that says what was found and what fits."""
    with pytest.raises((ExpressionError, NotWritable)) as refused:
        writer(source).write(values)
    assert message in str(refused.value)


@pytest.mark.parametrize("data", ["", "92 00C8 00C8", "91 00C8 00", "91 00C8 00C8 00"])
def test_another_frame_is_not_read(data: str) -> None:
    """Constants and lengths must fit."""
    one = writer("hex: '91 {{ right | i16be }} {{ left | i16be }}'")
    assert one.read(Frame(bytes.fromhex(data), "utf-8")) is None


@given(st.binary(max_size=20))
@settings(max_examples=examples(200), deadline=None)
def test_any_bytes_are_read_or_not(data: bytes) -> None:
    """Bytes that nobody wrote give a mapping or None; what was read is written again."""
    for source in ("hex: '91 {{ x | i16be }} {{ t | hexbytes }} 03'", "bytes: [2, '{{ x | u8 }}']"):
        one = writer(source)
        found = one.read(Frame(data, "utf-8"))
        assert found is None or one.write(found) == data


def test_json_keeps_the_types_of_its_leaves() -> None:
    """A leaf that is one expression is typed; text around it makes text."""
    one = writer(
        "json: { cmd: move, x: '{{ x }}', on_top: ['{{ flag }}', null, 'to {{ x }}', 1.5],"
        " none: '{{ missing | default(none) }}' }"
    )
    data = one.write({"x": 3, "flag": True})
    assert data == b'{"cmd":"move","x":3,"on_top":[true,null,"to 3",1.5],"none":null}'
    assert one.read(Frame(data, "utf-8")) == {"x": 3, "flag": True}
    assert one.read(Frame(data.replace(b"move", b"stop"), "utf-8")) is None
    assert one.read(Frame(b"[1", "utf-8")) is None
    assert one.read(Frame(b"\xff", "utf-8")) is None


SAME_NUMBERS = (
    ("61.0", "61"),
    ("-0.0", "0"),
    ("(60.6 | round)", "61"),
    ("(122 / 2)", "61"),
    ("(61.0 | clamp(-100, 100))", "61"),
    ("60.5", "60.5"),
    ("1e300", "1e+300"),
    ("true", "true"),
)


@pytest.mark.parametrize(("expression", "number"), SAME_NUMBERS)
def test_json_writes_equal_numbers_alike(expression: str, number: str) -> None:
    """As in text, a whole number has no decimal point, at any depth of the document."""
    one = writer(f"json: {{ l: '{{{{ {expression} }}}}', deep: [{{ r: '{{{{ x }}}}' }}] }}")
    assert one.write({"x": 100.0}) == f'{{"l":{number},"deep":[{{"r":100}}]}}'.encode()


@pytest.mark.parametrize(
    ("encoding", "data"), [("utf-8", '["é"]'.encode()), ("ascii", b'["\\u00e9"]')]
)
def test_json_is_written_for_its_line(encoding: str, data: bytes) -> None:
    """A line of ASCII gets escapes, which mean the same."""
    assert writer("json: ['{{ x }}']", encoding).write({"x": "é"}) == data


plain = st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.text(max_size=5)


@given(st.dictionaries(st.sampled_from(["a", "b", "c"]), plain, min_size=3))
@settings(max_examples=examples(100), deadline=None)
def test_json_is_read_as_it_was_written(values: dict[str, Any]) -> None:
    """For every value that JSON has."""
    one = writer("json: { a: '{{ a }}', deep: { b: ['{{ b }}'] }, c: '{{ c }}', d: 1 }")
    assert one.read(Frame(one.write(values), "utf-8")) == values
