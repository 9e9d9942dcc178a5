"""The text forms: what they find in a frame, and that they write what they would read."""

import json
import math
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.protocol.forms.json_paths import JsonReader
from urc.protocol.forms.table import build_reader
from urc.protocol.values.payload import BadText, CodecContext, Frame, NotWritable
from urc.testing.reading import read_spec, reader_of

SIGNALS = ("bat", "baro", "mode")
PATTERN = 'pattern: "BAT {v:number} {i:integer}"'
WORDS = 'pattern: "{name:word}: {t:text}, {h:hex};{r:rest}"'
SPLIT = "split: { by: ',', fields: [_kind, a, null, b, '...'] }"
BLANKS = "split: { fields: [a, b] }"
STRIP = "split: { by: ';', strip: '[] ', fields: [a, b] }"
SHAPED = f"""
{SPLIT}
when: "_kind == 'X'"
fields: {{ a: {{ scale: 0.1, not_available: ["-"] }} }}
set: {{ p: "a * 2" }}
"""
CODED = """
split: { by: ',', fields: [_code, a] }
when: _code == 1 or _code in [3, 4]
"""
PAIRS = "keyvalue: { pairs: ';', separator: ':' }"
NAMED = "keyvalue: { pairs: ' ', separator: '=', fields: { B: bat } }"
JSON = """json: { a: b.c, d: "e[1].f", g: h, k: "e[0].f", q: '"x y".z' }"""
SEARCH = 'json: { top: "max(x)", second: "x[1]" }'
XML = 'xml: { a: s/b/@l, m: "s/m[2]" }'
INDI = """
xml: { ra: "v[@name='COORD']/n[@name='RA']", dec: "v[@name='COORD']/n[@name='a/b'][2]/@x" }
"""

TAIL = "split: { by: ',', fields: [_kind, null, 'joints...'] }"
FIRST = "keyvalue: { pairs: ' ', separator: '=', first: [_kind, state], fields: { a: bat } }"
QUOTED = """keyvalue: { pairs: ',', separator: ':', strip: '" ', fields: { a: bat } }"""
COLUMNS = 'pattern: "X{v:number:6}{i:integer:3} {t:text:4};{h:hex:2}"'

READS = [
    (TAIL, b"J,x,1, 2,,3", {"_kind": "J", "joints": ["1", "2", None, "3"]}),
    (TAIL, b"J,x", {"_kind": "J", "joints": []}),
    (TAIL, b"J", None),
    (FIRST, b"STATUS OK a=1 b=2", {"_kind": "STATUS", "state": "OK", "bat": "1"}),
    (FIRST, b" STATUS  OK ", {"_kind": "STATUS", "state": "OK"}),
    (FIRST, b"STATUS a=1", None),
    (FIRST, b"STATUS", None),
    (QUOTED, b'"a" : "1 x", "b":2', {"bat": "1 x"}),
    (COLUMNS, b"X  12.5 -3 ab  ;ff", {"v": 12.5, "i": -3, "t": "ab", "h": 255}),
    (COLUMNS, b"X-12.50100 abcd;0A", {"v": -12.5, "i": 100, "t": "abcd", "h": 10}),
    (COLUMNS, b"X           ;  ", None),
    (COLUMNS, b"X              ;  ", {"v": None, "i": None, "t": None, "h": None}),
    (COLUMNS, b"X  1x.5 -3 ab  ;ff", None),
    (COLUMNS, b"X  1_25 -3 ab  ;ff", None),
    (PATTERN, b"BAT 12.5 3", {"v": 12.5, "i": 3}),
    (PATTERN, b" BAT  -1e3\t+3 \r", {"v": -1000.0, "i": 3}),
    (PATTERN, b"BAT .5 3", {"v": 0.5, "i": 3}),
    (PATTERN, b"BAT 1 3.5", None),
    (PATTERN, b"BAT 1_0 3", None),
    (PATTERN, b"BAT 1 3 4", None),
    (PATTERN, b"BAT 1", None),
    (PATTERN, b"BATTERY 1 2", None),
    (PATTERN, "BAT ٣ 3".encode(), None),
    (WORDS, b"ab: c d, fF;g, h", {"name": "ab", "t": "c d", "h": 255, "r": "g, h"}),
    (WORDS, b"ab: , 0;", {"name": "ab", "t": "", "h": 0, "r": ""}),
    (WORDS, b"a b: c, 0;", None),
    (SPLIT, b"X, 1,z,4", {"_kind": "X", "a": "1", "b": "4"}),
    (SPLIT, b"X,1,z,4,5,6", {"_kind": "X", "a": "1", "b": "4"}),
    (SPLIT, b"X,,z,", {"_kind": "X", "a": None, "b": None}),
    (SPLIT, b"X,1,z", None),
    (BLANKS, b" 1 \t 2 ", {"a": "1", "b": "2"}),
    (BLANKS, b"1 2 3", None),
    (STRIP, b"[1; 2]", {"a": "1", "b": "2"}),
    (SHAPED, b"X,12,,4", {"_kind": "X", "a": 1.2, "b": "4", "p": 2.4}),
    (SHAPED, b"X,-,,4", {"_kind": "X", "a": None, "b": "4", "p": None}),
    (SHAPED, b"Y,12,,4", None),
    (CODED, b"01,5", {"_code": "01", "a": "5"}),
    (CODED, b"3,5", {"_code": "3", "a": "5"}),
    (CODED, b"2,5", None),
    (PAIRS, b"bat:87;baro:31.02;x:1;\r\n", {"bat": "87", "baro": "31.02"}),
    (PAIRS, b" bat : 87 ; mode:", {"bat": "87", "mode": None}),
    (PAIRS, b"x:1;y:2", None),
    (PAIRS, b"bat", None),
    (NAMED, b"A=1 B=2 bat=3", {"bat": "2"}),
    (
        JSON,
        b'{"b":{"c":1},"e":[{"f":2},{"f":3,"z":[]}],"h":null}',
        {"a": 1, "d": 3, "g": None, "k": 2},
    ),
    (JSON, b'{"b":null,"e":[null,{"f":"x"}]}', {"d": "x"}),
    (JSON, b'{"b":3,"e":{},"h":1}', {"g": 1}),
    (JSON, b'{"x y":{"z":true}}', {"q": True}),
    (JSON, b"{}", None),
    (JSON, b"[1]", None),
    (JSON, b"{", None),
    (JSON, b"", None),
    (JSON, b"[" * 100_000, None),
    (JSON, b'{"b":' * 100_000, None),
    (SEARCH, b'{"x":[1,5,3]}', {"top": 5, "second": 5}),
    (SEARCH, b'{"x":["a"]}', {"top": "a"}),
    (SEARCH, b'{"x":[1,"a"]}', {"second": "a"}),
    (XML, b'<s><b l="3"/><m>x</m><m> y </m></s>', {"a": "3", "m": "y"}),
    (XML, b'<n:s xmlns:n="u"><n:b n:l=""/></n:s>', {"a": None}),
    (XML, b'<t><b l="3"/></t>', None),
    (XML, b"<s><b", None),
    (XML, b"<s>" * 5000 + b"</s>" * 5000, None),
    (XML, b'<!DOCTYPE s [<!ENTITY a "b">]><s><b l="&a;"/></s>', None),
    (INDI, b"<v name='COORD'><n name='DEC'>1</n><n name='RA'> 5.2 </n></v>", {"ra": "5.2"}),
    (INDI, b"<v name='COORD'><n name='a/b'/><n>2</n><n name='a/b' x='3'/></v>", {"dec": "3"}),
    (INDI, b"<v name='OTHER'><n name='RA'>5.2</n></v>", None),
    (INDI, b"<v><n name='RA'>5.2</n></v>", None),
    ("equals: pong", b"pong", {}),
    ("equals: pong", b"pong ", None),
]


@pytest.mark.parametrize(("form", "frame", "fields"), READS)
def test_frame_is_read(form: str, frame: bytes, fields: dict[str, object] | None) -> None:
    """One row a behaviour: what is found, or None for a frame that is another one."""
    found = reader_of(form, SIGNALS).read(Frame(frame, "utf-8"))
    assert (None if found is None else dict(found)) == fields


def test_numbers_that_are_none_are_read_as_such() -> None:
    """Robots say nan, and robots written in Python say NaN in JSON."""
    found = reader_of(PATTERN).read(Frame(b"BAT nan 1", "utf-8"))
    assert found is not None
    assert math.isnan(found["v"])  # type: ignore[arg-type]
    found = reader_of(JSON).read(Frame(b'{"h": NaN}', "utf-8"))
    assert found is not None
    assert math.isnan(found["g"])  # type: ignore[arg-type]


def test_an_unusable_field_says_why_and_spoils_what_rests_on_it() -> None:
    """Whoever needs the field can tell; the others are not touched."""
    found = reader_of(SHAPED).read(Frame(b"X,q,,4", "utf-8"))
    assert repr(found) == (
        "{'_kind': 'X', 'a': Unusable(\"'q' is not a number\"), 'b': '4',"
        " 'p': Unusable(\"'q' is not a number\")}"
    )


WRITES = [
    (TAIL, {"_kind": "J", "joints": [1, 2.5]}, b"J,,1,2.5"),
    (FIRST, {"_kind": "S", "state": "OK", "bat": 3}, b"S OK a=3"),
    (COLUMNS, {"v": 1.25, "i": -3, "t": "ab", "h": 255}, b"X  1.25 -3 ab  ;FF"),
    (PATTERN, {"v": 1.25, "i": 3}, b"BAT 1.25 3"),
    (PATTERN, {"v": 2, "i": -3}, b"BAT 2 -3"),
    (PATTERN, {}, b"BAT 0 0"),
    (WORDS, {"name": "ab", "t": "c d", "h": 255, "r": "g"}, b"ab: c d, FF;g"),
    (SPLIT, {"_kind": "X", "b": 4}, b"X,,,4"),
    (BLANKS, {"a": 1, "b": True}, b"1 true"),
    (SHAPED, {"_kind": "X", "a": 1.2, "p": 7}, b"X,12,,"),
    (SHAPED, {"_kind": "X", "a": None}, b"X,-,,"),
    (CODED, {"_code": 1, "a": 2}, b"1,2"),
    (PAIRS, {"bat": 87, "mode": "x"}, b"bat:87;mode:x"),
    (NAMED, {"bat": 2.5}, b"B=2.5"),
    (JSON, {"a": 1, "d": [1]}, b'{"b":{"c":1},"e":[null,{"f":[1]}]}'),
    (JSON, {"q": None}, b'{"x y":{"z":null}}'),
    (XML, {"a": 3, "m": "q&<"}, b'<s><b l="3" /><m /><m>q&amp;&lt;</m></s>'),
    ("equals: pong", {}, b"pong"),
    ("regex: '^V(?P<v>[0-9]+)( (?P<w>[a-z]+))?$'", {"v": 3}, b"V3"),
    ("regex: '^V(?P<v>[0-9]+)( (?P<w>[a-z]+))?$'", {"v": 3, "w": "x"}, b"V3 x"),
    (r"regex: '^V(?P<v>\d{3})$'", {"v": 5}, b"V005"),
    (r"regex: '^V(?P<v>[+-]\d{4}) (?P<i>\d{2}\.\d)$'", {"v": -12, "i": 7}, b"V-0012 07.0"),
    (r"regex: '^V(?P<v>[+-]\d{4})$'", {"v": 12}, b"V+0012"),
    (r"regex: '^V(?P<v>\d{2}\.\d{2})$'", {"v": 5.5}, b"V05.50"),
]  # fmt: skip


@pytest.mark.parametrize(("form", "fields", "frame"), WRITES)
def test_fields_are_written(form: str, fields: dict[str, object], frame: bytes) -> None:
    """The emulated robot answers by the same declaration."""
    assert reader_of(form, SIGNALS).write(fields) == frame


NOT_WRITABLE = [
    (PATTERN, {"v": "x"}),
    (PATTERN, {"i": 1.5}),
    (WORDS, {"name": "a b"}),
    (SPLIT, {"a": "1,2"}),
    (BLANKS, {"a": "1 2"}),
    (SHAPED, {"_kind": "Y"}),
    (SHAPED, {"_kind": "X", "a": "fast"}),
    (PAIRS, {"bat": "1;2"}),
    (PAIRS, {}),
    (SEARCH, {"top": 1}),
    (JSON, {}),
    (XML, {}),
    (XML, {"m": "\x00"}),
]


@pytest.mark.parametrize(("form", "fields"), NOT_WRITABLE)
def test_what_no_frame_says_is_not_written(form: str, fields: dict[str, object]) -> None:
    """A frame that would be read as something else is never made."""
    with pytest.raises(NotWritable):
        reader_of(form, SIGNALS).write(fields)


FORMS = [PATTERN, WORDS, SPLIT, BLANKS, STRIP, SHAPED, PAIRS, NAMED, JSON, SEARCH, XML]
texts = st.text(max_size=6)
plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | texts
fields_of = st.fixed_dictionaries(
    {},
    optional={
        name: st.just("X") | plain if name == "_kind" else plain
        for name in ("v", "i", "name", "t", "h", "r", "_kind", "a", "b", "bat", "mode", "d", "m")
    },
)


@pytest.mark.parametrize("form", FORMS)
@given(fields=fields_of)
@settings(max_examples=examples(80), deadline=None)
def test_written_frame_reads_back(form: str, fields: dict[str, Any]) -> None:
    """Whatever can be written says what was meant, or it is refused."""
    spec = read_spec(form, SIGNALS)
    reader = build_reader(spec, CodecContext())
    given_fields = {name: value for name, value in fields.items() if name in spec.fields}
    try:
        frame = reader.write(given_fields)
    except NotWritable:
        return
    found = reader.read(Frame(frame, "utf-8"))
    assert found is not None
    for name, value in given_fields.items():
        if name not in spec.sets:
            assert is_same(found.get(name), value), (name, value, found)


def is_same(found: object, value: object) -> bool:
    """Compare as the wire does: text for a number, nothing for what is absent."""
    if found == value or (value in (None, "") and found in (None, "", "-", 0, "x")):
        return True
    if isinstance(value, bool):
        return str(found).lower() == str(value).lower()
    try:
        return math.isclose(float(str(found)), float(str(value)), rel_tol=1e-9, abs_tol=1e-9)
    except ValueError:
        return str(found) == str(value)


@pytest.mark.parametrize("form", [*FORMS, "equals: pong"])
@given(data=st.binary(max_size=200) | st.text(max_size=100).map(str.encode))
@settings(max_examples=examples(80), deadline=None)
def test_any_bytes_are_read_or_refused(form: str, data: bytes) -> None:
    """No frame of a robot raises anything but that it is no text."""
    with suppress(BadText):
        reader_of(form, SIGNALS).read(Frame(data, "utf-8"))


leaves = st.none() | st.booleans() | st.integers(-5, 5) | st.floats(allow_nan=False) | texts
documents = st.recursive(
    leaves,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["b", "c", "e", "f", "h", "x y", "z", "o"]), inner)
    ),
    max_leaves=12,
)


@given(document=documents)
@settings(max_examples=examples(300), deadline=None)
def test_json_by_types_and_json_as_a_whole_agree(document: object) -> None:
    """The walk over the whole document is the oracle of the decoder made for the paths."""
    reader = JsonReader(read_spec(JSON), CodecContext())
    assert reader.pick is not None
    frame = Frame(json.dumps(document).encode(), "utf-8")
    assert reader.read(frame) == reader.read_whole(frame)


LONG = 200_000


@pytest.mark.parametrize("form", [*FORMS, 'pattern: "{a:text}x{b:number}"'])
@pytest.mark.parametrize(
    "piece", ["9", " ", "1 ", "a,", "x:", "<s>", '{"b":', "BAT 1", "=", "X,", "e1", "ab: "]
)
def test_a_long_frame_takes_linear_time(form: str, piece: str) -> None:
    """Anything worse would run into the time-out of a test."""
    frame = Frame((piece * (LONG // len(piece))).encode(), "utf-8")
    reader_of(form, SIGNALS).read(frame)
