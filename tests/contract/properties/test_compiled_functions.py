"""The functions made for one declaration do what the closures do, on good input and on bad."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.expressions import compile_template
from urc.model.driver import Argument, Command, FramingSpec
from urc.model.values import AlarmLimits, Conversion, Signal
from urc.protocol.forms.table import build_reader
from urc.protocol.framing.table import build_framing
from urc.protocol.readings.compiled import build_fast_read
from urc.protocol.readings.compiled_value import Taken
from urc.protocol.readings.readings import Readings
from urc.protocol.requests.compiled_encode import build_fast_encode
from urc.protocol.requests.encode import BadArgument, build_check, build_encode, check_arguments
from urc.protocol.requests.messages import Messages
from urc.protocol.requests.reply_match import Matcher
from urc.protocol.values.payload import CodecContext, Frame
from urc.testing.profile import text
from urc.testing.reading import read_spec

SIGNALS = {
    one.name: one
    for one in (
        Signal("volts", min=0, max=60, limits=AlarmLimits(low=20, hysteresis=1)),
        Signal("amps"),
        Signal("top", max=5),
        Signal("count", "integer", min=-5),
        Signal("whole", "integer"),
        Signal("name", "string"),
        Signal("tenths", conversion=Conversion(polynomial=(0, 0.1))),
        Signal("shifted", conversion=Conversion(polynomial=(-40, 0.01)), max=100),
        Signal("line", conversion=Conversion(polynomial=(1.5, 3))),
        Signal("double", conversion=Conversion(polynomial=(0, 2))),
        Signal("power", formula=compile_template("{{ volts * 2 }}")),
    )
}
FAST = [
    r"regex: '^BAT (?P<volts>[0-9.+-]+) (?P<count>[0-9]+)$'",
    r"regex: '^X(?P<amps>\S+) (?P<_own>\w+) (?P<name>.*)$'",
    r"regex: '^(?P<tenths>-?[0-9]+),(?P<shifted>-?[0-9]+)(,(?P<line>-?[0-9]+))?$'",
    r"regex: '^(?P<top>[0-9.einfa+-]+);(?P<whole>\w+);(?P<double>[0-9.]+)$'",
    "regex: '^pong$'",
    'pattern: "BAT {volts:number} {count:integer}"',
    'pattern: "{name:word} {:number} x {amps:integer} {_own:word} %"',
    'pattern: "{tenths:integer} {shifted:number} {line:number} {double:number}"',
    'pattern: "{top:number} {whole:integer} {:word}"',
    'pattern: "pong now"',
    "json: { volts: v.a, count: v.b, name: 'n[0]', _own: v.a }",
    "json: { tenths: v.a, amps: v.b }",
]
SLOW = [
    "regex: '(?P<volts>[0-9]+)'",
    'pattern: "{name:text};{volts:number}"',
    'pattern: "V={volts:number}"',
    'pattern: "V {whole:hex}"',
    'pattern: "V {name:rest}"',
    "split: { fields: [volts] }",
    "json: { volts: 'max(v)' }",
    "regex: '^(?P<volts>[0-9]+)$'\nfields: { volts: { scale: 2 } }",
]


def both(form: str) -> tuple[Matcher, Any]:
    """Return the closures of a form with readings of their own, and the function for it."""
    spec = read_spec(form, SIGNALS)
    context = CodecContext()
    matchers = []
    for _ in range(2):
        readings = Readings(SIGNALS)
        decode = readings.decoder(spec.fields)
        matchers.append((Matcher(build_reader(spec, context), decode), readings))
    (oracle, _), (other, readings) = matchers

    return oracle, build_fast_read(spec, other.reader, readings, other.take)


@pytest.mark.parametrize("form", FAST)
def test_form_has_a_function(form: str) -> None:
    """What is simple is fast."""
    assert both(form)[1] is not None


@pytest.mark.parametrize("form", SLOW)
def test_form_has_no_function(form: str) -> None:
    """What is not is left to the closures."""
    assert both(form)[1] is None


numbers = (
    st.integers(-100, 100).map(str)
    | st.floats().map(repr)
    | st.sampled_from(
        ["1_0", "+5", ".5", "5.", "1e5", "inf", "nan", "-", "", "0x1", "٣", "1\t", "9" * 500]
    )
)
words = (
    st.sampled_from(["BAT", "X", "pong", "now", "x", "%", "a_b", "ok", "é", "\x1c", " "]) | numbers
)
frames = st.one_of(
    st.lists(words, max_size=7).flatmap(
        lambda parts: st.sampled_from([" ", "  ", ",", ";", "\t"]).map(lambda by: by.join(parts))
    ),
    st.tuples(numbers, numbers).map("BAT {0[0]} {0[1]}".format),
    st.tuples(numbers, words, words).map("X{0[0]} {0[1]} {0[2]}".format),
    st.tuples(numbers, numbers, numbers).map("{0[0]};{0[1]};{0[2]}".format),
    st.tuples(numbers, numbers).map("{0[0]},{0[1]}".format),
    st.tuples(words, numbers, numbers, words).map("{0[0]} {0[1]} x {0[2]} {0[3]} %".format),
    st.tuples(numbers, numbers, numbers, numbers).map(" ".join),
    st.tuples(numbers, numbers, numbers).map(
        '{{"v":{{"a":{0[0]},"b":{0[1]}}},"n":[{0[2]}]}}'.format
    ),
    st.tuples(numbers, words).map('{{"v":{{"a":{0[0]},"b":null}},"n":["{0[1]}",3]}}'.format),
    st.text(max_size=20),
)


@pytest.mark.parametrize("form", FAST)
@given(lines=st.lists(frames, min_size=1, max_size=6))
@settings(max_examples=examples(150), deadline=None)
def test_function_and_closures_agree(form: str, lines: list[str]) -> None:
    """The closures are the oracle; the state of alarms goes along with both."""
    oracle, fast = both(form)
    for now, line in enumerate(lines):
        payload = line.encode()
        expected = oracle.take(Frame(payload, "utf-8"), float(now))
        found = fast(Frame(payload, "utf-8"), float(now))
        assert plain(found) == plain(expected), line


def test_negative_zero_keeps_its_sign_in_both() -> None:
    """Found by the property above: only the closures added an offset of zero, which loses it."""
    oracle, fast = both("json: { tenths: v.a, amps: v.b }")
    frame = Frame(b'{"v":{"a":-0.0,"b":null},"n":["BAT",3]}', "utf-8")
    assert plain(fast(frame, 0.0)) == plain(oracle.take(frame, 0.0))


def plain(taken: Taken | None) -> Any:
    """Return what was taken in a form that can be compared: order aside, nothing is equal to it."""
    if taken is None:
        return None
    samples, refused = taken
    return sorted(map(repr, samples)), sorted(refused)


@given(lines=st.lists(frames | st.binary(max_size=9), min_size=10, max_size=40))
@settings(max_examples=examples(60), deadline=None)
def test_the_right_message_has_the_frame(lines: list[str | bytes]) -> None:
    """The first one declared that takes it, compiled or not."""
    context = CodecContext()
    plainly, quickly = [], []
    for form in (*FAST[:3], *SLOW[1:4], *FAST[5:]):
        spec = read_spec(form, SIGNALS)
        for made in (plainly, quickly):
            readings = Readings(SIGNALS)
            matcher = Matcher(build_reader(spec, context), readings.decoder(spec.fields))

            if made is quickly:
                fast = build_fast_read(spec, matcher.reader, readings, matcher.take)
                matcher = Matcher(matcher.reader, matcher.decode, fast)
            made.append(matcher)
    messages = Messages(quickly)
    for now, line in enumerate(lines):
        payload = line.encode() if isinstance(line, str) else line
        frame = Frame(payload, "utf-8")
        takes = (one.take(frame, float(now)) for one in plainly)
        expected = next((taken for taken in takes if taken is not None), None)
        found = messages.decode(Frame(payload, "utf-8"), float(now))
        assert plain(found) == plain(expected), line


# ---- encoding

LF = build_framing(FramingSpec("delimiter", {"tx": b"\n", "rx": b"\n"}))
ARGUMENTS = {
    "a": Argument("a", "number", min=-10, max=10),
    "b": Argument("b", "number"),
    "n": Argument("n", "integer", min=-(10**30)),
}
TEMPLATES = [
    "V {{ a }} {{ n }}",
    "V {{ (a * 100) | fixed(2) }} {{ (b + n / 3 - 1) | fixed(0) }}",
    "{{ a }}",
    "{{ b - 0.5 }};{ {{ 3 }}} ns['b'] {b}",
    "{{ (a / n) | fixed(1) }}",
    "{{ (n * n * n * n * 99999) | fixed(3) }}",
]
values_of = st.fixed_dictionaries(
    {},
    optional={
        name: st.integers() | st.floats() | st.booleans() | st.none() | st.text(max_size=2)
        for name in "abnx"
    }
    | {"a": st.floats(-11, 11), "n": st.integers(-3, 3)},
)


def outcome(function: Any, *given_arguments: Any) -> object:
    """Return what a function gives, or says."""
    try:
        return function(*given_arguments)
    except BadArgument as error:
        return str(error)


@pytest.mark.parametrize("source", TEMPLATES)
@given(given_arguments=values_of)
@settings(max_examples=examples(150), deadline=None)
def test_command_is_written_as_by_closures(source: str, given_arguments: dict[str, Any]) -> None:
    """Checks, arithmetic, digits and delimiter."""
    send = text(source)
    command = Command("c", "wire", send, arguments=ARGUMENTS)
    check = build_check(command, is_compiled=True)
    encode = build_encode(send, LF, CodecContext(is_compiled=True), ARGUMENTS)
    slow = build_encode(send, LF, CodecContext())
    assert build_fast_encode(send.options["template"], ARGUMENTS, LF, "utf-8", slow)  # type: ignore[arg-type]

    def quickly() -> bytes:
        return encode(check(given_arguments))

    def plainly() -> bytes:
        return slow(check_arguments(command, given_arguments))

    assert outcome(quickly) == outcome(plainly)


@pytest.mark.parametrize(
    "source",
    ["V {{ s }}", "V {{ a | round }}", "V\n{{ a }}", "V {{ 'x' if a else 'y' }}", "{{ z }}"],
)
def test_what_is_not_simple_is_written_by_closures(source: str) -> None:
    """Text may hold a delimiter, and so on."""
    send = text(source)
    arguments = {**ARGUMENTS, "s": Argument("s", "string")}
    slow = build_encode(send, LF, CodecContext())
    template = send.options["template"]
    assert build_fast_encode(template, arguments, LF, "utf-8", slow) is None  # type: ignore[arg-type]


def test_a_delimiter_that_looks_like_a_number_is_not_taken_for_granted() -> None:
    """A frame that holds it would be two."""
    framing = build_framing(FramingSpec("delimiter", {"tx": b"0", "rx": b"\n"}))
    send = text("V {{ a }}")
    slow = build_encode(send, framing, CodecContext())
    template = send.options["template"]
    assert build_fast_encode(template, ARGUMENTS, framing, "utf-8", slow) is None  # type: ignore[arg-type]
