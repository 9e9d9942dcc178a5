"""Many frames at once: the same readings as one by one, and functions that go with their engine."""

import gc
import linecache
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.dialogue import Dialogue
from tests.effort import examples
from urc.model.values import Sample, Signal
from urc.protocol.compile.source import function_of
from urc.protocol.events import Event, Samples
from urc.protocol.forms.table import build_reader
from urc.protocol.readings.compiled import build_fast_read
from urc.protocol.readings.readings import Readings
from urc.protocol.requests.reply_match import Matcher
from urc.protocol.values.payload import CodecContext, Frame
from urc.testing.reading import read_spec

LINE = """
transports:
  wire: { type: tcp, host: robot, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
signals: { volts: { min: 0, max: 60, limits: { low: 20 } }, x: {}, y: { value: x * 2 } }
messages:
  bat: { pattern: "BAT {volts:number}" }
  pos: { pattern: "POS {x:number}" }
commands:
  ask: { send: ask, reply: { pattern: "BAT {volts:number}" } }
  two: { send: two, reply: { pattern: "POS {x:number}", lines: 1 } }
"""
BINARY = """
transports:
  wire:
    type: tcp
    host: robot
    port: 1
    framing: { type: fixed, size: 4, checksum: { algorithm: xor8 } }
signals: { a: { max: 200 }, b: {} }
messages: { one: { struct: [u8 1, u8 a, u8 b] }, two: { struct: [u8 2, u8 b, u8 a] } }
"""


def samples_of(events: Sequence[Event]) -> list[Sample]:
    return [one for event in events if isinstance(event, Samples) for one in event.samples]


def others_of(events: Sequence[Event]) -> list[Event]:
    return [event for event in events if not isinstance(event, Samples)]


def told(text: str, chunks: Sequence[bytes], command: str = "") -> tuple[list[Sample], list[Event]]:
    """Return the samples and all other events of chunks."""
    talk = Dialogue(text).connect()
    if command:
        talk.run(command)
    events = [event for chunk in chunks for event in talk.engine.receive("wire", chunk, 1.0)]
    return samples_of(events), others_of(events)


lines = st.sampled_from(
    [
        "BAT 24.5",
        "BAT 12",
        "BAT 99",
        "POS 1.5",
        "POS -2",
        " POS 3",
        "POS x",
        "",
        "?",
        "BAT 1_0",
        "é",
    ]
)


@given(frames=st.lists(lines, max_size=12), command=st.sampled_from(["", "ask", "two"]))
@settings(max_examples=examples(150), deadline=None)
def test_lines_at_once_say_what_they_say_one_by_one(frames: list[str], command: str) -> None:
    """Readings, faults and answers, each kind in its order."""
    single = [f"{frame}\n".encode() for frame in frames]
    assert told(LINE, [b"".join(single)], command) == told(LINE, single, command)


@given(data=st.binary(max_size=24), count=st.integers(0, 3))
@settings(max_examples=examples(150), deadline=None)
def test_bytes_at_once_say_what_they_say_one_by_one(data: bytes, count: int) -> None:
    """Good frames among noise, with checksums that are wrong."""
    stream = b"\x01\x07\x09\x0f" * count + data + b"\x02\xff\x09\xf4" * count
    drip = [bytes([byte]) for byte in stream]
    assert told(BINARY, [stream]) == told(BINARY, drip)


SIGNALS = {
    one.name: one
    for one in (
        Signal("a"),
        Signal("b", "integer", min=-5),
        Signal("c", max=10),
        Signal("word", "string"),
        Signal("f"),
    )
}
STRUCTS = [
    "struct: [u8 1, i16be b, { id: a, type: i16le, scale: 0.1 }]",
    "struct: [{ id: word, type: u8, enum: { '0': off, '1': on } }, f32be f]",
    "struct: [{ id: c, type: u8, valid: [0, 5] }, u8 _own, { id: a, type: f64le, scale: 2 }]",
]


@pytest.mark.parametrize("form", STRUCTS)
@given(frames=st.lists(st.binary(max_size=12), min_size=1, max_size=5))
@settings(max_examples=examples(200), deadline=None)
def test_struct_function_and_closures_agree(form: str, frames: list[bytes]) -> None:
    """The closures are the oracle."""
    spec = read_spec(form, SIGNALS)
    readings = Readings(SIGNALS)
    matcher = Matcher(build_reader(spec, CodecContext()), readings.decoder(spec.fields))

    fast = build_fast_read(spec, matcher.reader, readings, matcher.take)
    assert fast is not None
    for frame in frames:
        for payload in (frame, b"\x01" + frame[:4].ljust(4, b"\x00"), frame.ljust(10, b"\x00")):
            expected = matcher.take(Frame(payload, "utf-8"), 1.0)
            found = fast(Frame(payload, "utf-8"), 1.0)
            assert repr(found and (found[0], list(found[1]))) == repr(expected), payload


def test_source_of_a_function_goes_with_it() -> None:
    """A traceback shows it while the function lives; nothing is kept for those that are gone."""
    made = function_of("nothing", "x", ["    return x"], {})
    file = made.__code__.co_filename
    assert linecache.getline(file, 2) == "    return x\n"
    del made
    gc.collect()
    assert linecache.getline(file, 2) == ""
