"""Messages that are collected over several frames, and those that are answered."""

from pathlib import Path

import pytest

from urc.config.load import check
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Samples, Send, Violation
from urc.runtime.registries import built_in_catalog

HEAD = """\
urc: 1
kind: robot
name: probe
settings: { who: { type: string, default: urc } }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 1
    framing: { type: delimiter, tx: LF, rx: LF }
    on_connect: [{ expect: "^HELLO$", timeout: 60s }]
signals:
  ranges: { type: array }
  volts: {}
  picture: { type: blob }
"""


def engine(folder: Path, messages: str, signals: str = "") -> Engine:
    """An engine whose line is connected, and still in its greeting."""
    file = folder / "probe.yaml"
    lines = "\n".join(f"  {line}" for line in messages.strip().splitlines())
    file.write_text(f"{HEAD}{signals}messages:\n{lines}\n", "utf-8")
    checked = check(str(file), built_in_catalog())
    assert checked.profile is not None, checked.problems
    made = Engine(checked.profile.driver, {"who": "urc"})
    made.tick(0.0)
    made.start("wire", 0.0)
    return made


def sent(events: list[Event]) -> list[bytes]:
    return [one.data for one in events if isinstance(one, Send) and isinstance(one.data, bytes)]


def values(events: list[Event], signal: str) -> list[object]:
    return [
        sample.value
        for one in events
        if isinstance(one, Samples)
        for sample in one.samples
        if sample.signal == signal
    ]


def faults(events: list[Event]) -> list[str]:
    return [one.message for one in events if isinstance(one, Violation)]


POINT = (
    "point: { regex: '^(?P<_mark>[<>.])(?P<_far>[0-9]+)$',"
    " collect: { ranges: { value: _far | int, %s } } }"
)


@pytest.mark.parametrize(
    ("marks", "frames", "told"),
    [
        ("begin: _mark == '<'", ".9 <1 .2 .3 <4 .5 <6", [(1, 2, 3), (4, 5)]),
        ("end: _mark == '>'", ".1 .2 >3 >4 .5", [(1, 2, 3), (4,)]),
        (
            "begin: _mark == '<', end: _mark == '>'",
            ".9 <1 .2 >3 .8 >7 <4 <5 >6",
            [(1, 2, 3), (5, 6)],
        ),
    ],
)
def test_a_scan_is_told_when_it_is_whole(
    tmp_path: Path, marks: str, frames: str, told: list[tuple[int, ...]]
) -> None:
    """What came before its first frame, or was begun anew, belongs to none."""
    made = engine(tmp_path, POINT % marks)
    data = "".join(f"{frame}\n" for frame in frames.split()).encode()
    assert values(made.receive("wire", data, 1.0), "ranges") == told


def test_a_scan_is_the_same_byte_by_byte(tmp_path: Path) -> None:
    made = engine(tmp_path, POINT % "begin: _mark == '<'")
    events = [one for byte in b"<1\n.2\n<3\n" for one in made.receive("wire", bytes((byte,)), 1.0)]
    assert values(events, "ranges") == [(1, 2)]


def test_half_a_scan_does_not_outlive_its_connection(tmp_path: Path) -> None:
    made = engine(tmp_path, POINT % "begin: _mark == '<'")
    made.receive("wire", b"<1\n.2\n", 1.0)
    made.closed("wire", "pulled", 2.0)
    made.start("wire", 3.0)
    assert values(made.receive("wire", b".3\n<4\n<5\n", 4.0), "ranges") == [(4,)]


def test_a_scan_without_an_end_is_dropped_and_told_once(tmp_path: Path) -> None:
    """Nothing grows without bound, and the next whole one is told again."""
    made = engine(tmp_path, POINT % "begin: _mark == '<', max: 3")
    events = made.receive("wire", b"<1\n.2\n.3\n.4\n.5\n<6\n<7\n", 1.0)
    assert values(events, "ranges") == [(6,)]
    assert faults(events) == ["ranges: more than 3 values before the last frame; dropped"]


def test_a_picture_comes_in_pieces_of_bytes(tmp_path: Path) -> None:
    made = engine(
        tmp_path,
        "piece: { regex: '^(?P<_n>[12]) (?P<_hex>[0-9A-F]+)$',"
        " collect: { picture: { value: _hex | hexbytes, begin: _n == '1', end: _n == '2' } } }",
    )
    assert values(made.receive("wire", b"1 FFD8\n2 FFD9\n", 1.0), "picture") == [
        b"\xff\xd8\xff\xd9"
    ]


def test_bytes_are_no_number(tmp_path: Path) -> None:
    """They may be computed, for pictures; elsewhere they are a fault of the line."""
    made = engine(
        tmp_path, "v: { regex: '^V(?P<_hex>[0-9A-F]+)$', set: { volts: _hex | hexbytes } }"
    )
    [fault] = faults(made.receive("wire", b"VFF\n", 1.0))
    assert fault.startswith("volts: ")


def test_rows_that_are_lists_become_one_list(tmp_path: Path) -> None:
    made = engine(
        tmp_path,
        "row: { regex: '^(?P<_n>[1-3]):(?P<_row>.*)$', collect:"
        " { ranges: { value: \"_row | split(',')\", begin: _n == '1', end: _n == '3' } } }",
    )
    events = made.receive("wire", b"1:1,2\n2:3\n3:4,5\n", 1.0)
    assert values(events, "ranges") == [(1, 2, 3, 4, 5)]


def test_a_message_is_answered_at_once_even_before_the_line_is_ready(tmp_path: Path) -> None:
    made = engine(
        tmp_path,
        "ping: { regex: '^PING (?P<_token>[a-z]+)$',"
        " acknowledge: 'PONG {{ _token }} {{ settings.who }}' }",
    )
    events = made.receive("wire", b"PING abc\nPING def\n", 1.0)
    assert sent(events) == [b"PONG abc urc\n", b"PONG def urc\n"]
    assert sent(made.receive("wire", b"PONG abc\n", 2.0)) == []


def test_answers_are_counted(tmp_path: Path) -> None:
    """The counters are those of the connection."""
    made = engine(tmp_path, "ping: { equals: P, acknowledge: \"{{ seq('n', 1, 2) }}\" }")
    assert sent(made.receive("wire", b"P\nP\nP\n", 1.0)) == [b"1\n", b"2\n", b"1\n"]
    made.closed("wire", "pulled", 2.0)
    made.start("wire", 3.0)
    assert sent(made.receive("wire", b"P\n", 4.0)) == [b"1\n"]


def test_an_answer_knows_what_was_read_before_and_nothing_that_is_old(tmp_path: Path) -> None:
    made = engine(
        tmp_path,
        "volts: { regex: '^V(?P<volts>[0-9.]+)$' }\n"
        "ask: { equals: ASK, acknowledge: \"{{ volts | default('none') }}\" }",
    )
    assert sent(made.receive("wire", b"ASK\n", 1.0)) == [b"none\n"]
    made.receive("wire", b"V2.5\n", 2.0)
    assert sent(made.receive("wire", b"ASK\n", 3.0)) == [b"2.5\n"]
    assert sent(made.receive("wire", b"ASK\n", 60.0)) == [b"none\n"]


def test_an_answer_that_cannot_be_written_is_a_fault_and_its_message_is_not(tmp_path: Path) -> None:
    made = engine(
        tmp_path,
        "volts: { regex: '^V(?P<volts>[0-9.]+)( (?P<_token>\\w+))?$',"
        " acknowledge: '{{ _token }}' }",
    )
    events = made.receive("wire", b"V2.5\n", 1.0)
    assert (values(events, "volts"), sent(events)) == ([2.5], [])
    assert faults(events) == ["the acknowledgement cannot be sent: '_token' has no value here"]
