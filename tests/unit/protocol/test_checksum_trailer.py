"""Checksums that stand behind a text: after a mark, in digits as they come, or behind each line."""

import pytest

from tests.dialogue import Dialogue
from tests.unit.protocol.framing_samples import framing, wire
from tests.unit.protocol.framing_samples_text import MARLIN, NMEA_WITH_MARK
from urc.protocol.framing.base import FrameFault, FramingError

PRINTER = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    send_framing:
      type: delimiter
      tx: LF
      rx: LF
      checksum: { algorithm: xor8, as: dec, leading_zeros: false, after: "*" }
commands:
  tool:
    args: { number: { type: integer, min: 0, max: 9 } }
    send: "N{{ seq('line', 3, 99999) }} T{{ number }}"
    reply: { regex: '^ok$' }
"""
SCAN = (
    "{ type: delimiter, tx: LF, rx: [LF, LF],"
    " checksum: { algorithm: { fold: sum, mask: 0x3F, add: 0x30 }, each: LF, skip: 1 } }"
)


def codes(found: list[bytes | FrameFault]) -> list[bytes | str]:
    return [one.code if isinstance(one, FrameFault) else one for one in found]


def test_lines_to_a_printer_are_numbered_and_checked() -> None:
    """RepRap wiki, G-code: ``N3 T0*57``."""
    talk = Dialogue(PRINTER).connect()
    talk.run("tool", number=0)
    assert talk.sent == ["N3 T0*57"]
    talk.says("ok")
    talk.run("tool", number=1)
    assert talk.sent == ["N4 T1*63"]
    assert talk.outcomes == {1: "done"}


@pytest.mark.parametrize(
    ("line", "found"),
    [
        (b"N3 T0*57\n", [b"N3 T0"]),
        (b"N3 T0*057\n", [b"N3 T0"]),
        (b"N3 T0*58\n", ["bad-checksum"]),
        (b"N3 T0*5\n", ["bad-checksum"]),
        (b"N3 T0*\n", ["bad-checksum"]),
        (b"N3 T0*0000057\n", ["bad-checksum"]),
        (b"N3 T0*+57\n", ["bad-checksum"]),
        (b"N3 T0\n", ["bad-checksum"]),
        (b"M117 2*3*113\n", [b"M117 2*3"]),
        (b"AA*0\n", [b"AA"]),
    ],
)
def test_the_last_mark_is_followed_by_the_checksum(line: bytes, found: list[bytes | str]) -> None:
    """With leading zeros or without; a text may have the mark in it."""
    assert codes(framing(MARLIN).decoder().feed(line)) == found


def test_a_missing_mark_is_named() -> None:
    """So an author learns that it is `optional` that is missing."""
    found = framing(MARLIN).decoder().feed(b"ok\n")
    assert isinstance(found[0], FrameFault)
    assert found[0].message == "the frame has no '*' followed by a checksum; dropped"


@pytest.mark.parametrize(
    ("sentence", "found"),
    [
        (b"$GPGLL,1*4D\r\n", [b"GPGLL,1"]),
        (b"$GPGLL,1\r\n", [b"GPGLL,1"]),
        (b"$GPGLL,1*4C\r\n", ["bad-checksum"]),
        (b"$GPGLL,1*\r\n", ["bad-checksum"]),
    ],
)
def test_an_optional_checksum_is_checked_where_it_stands(
    sentence: bytes, found: list[bytes | str]
) -> None:
    """NMEA 0183: few sentences must have one, and a wrong one is wrong for all."""
    made = framing(NMEA_WITH_MARK)
    assert codes(made.decoder().feed(sentence)) == found
    assert made.encode(b"GPGLL,1") == b"$GPGLL,1*4D\r\n"


def test_raw_bytes_that_look_like_the_mark_are_no_mark() -> None:
    """Raw bytes have a fixed place, which tells."""
    made = framing("{ type: slip, checksum: { algorithm: sum8, after: '*' } }")
    assert made.encode(b"!\t") == wire("21 09 2A 2A C0")
    assert made.decoder().feed(wire("21 09 2A 2A C0")) == [b"!\t"]
    assert codes(made.decoder().feed(wire("21 09 2A C0"))) == ["bad-checksum"]


@pytest.mark.parametrize(
    ("over", "checksum"),
    [("payload", b"3"), ("frame", b"19"), ("{ from: 2 }", b"2"), ("{ to: -1 }", b"1B")],
)
def test_the_window_ends_at_the_mark(over: str, checksum: bytes) -> None:
    """And begins where it says; the start bytes count as places."""
    made = framing(
        "{ type: brackets, open: 0x1A, close: CR, checksum: { algorithm: xor8, as: HEX,"
        f" leading_zeros: false, after: ';', over: {over} }} }}"
    )
    assert made.encode(b"\x01\x02") == b"\x1a\x01\x02;" + checksum + b"\r"
    assert made.decoder().feed(made.encode(b"\x01\x02")) == [b"\x01\x02"]


def test_lines_at_the_top_may_have_no_checksum() -> None:
    """SCIP 2.0: the echo of the request has none, and the request neither."""
    made = framing(SCAN)
    assert made.encode(b"VV") == b"VV\n"
    said = b"VV\n00P\nFIRM:1I\n\n"
    assert codes(made.decoder().feed(said)) == [b"VV\n00\nFIRM:1"]
    assert codes(made.decoder().feed(said.replace(b"1I", b"2I"))) == ["bad-checksum"]
    assert made.reversed().encode(b"VV\n00\nFIRM:1") == b"VV\n00P\nFIRM:1I\n\n"


@pytest.mark.parametrize("decode", ["hex", "HEX", "base64"])
def test_what_is_not_spelt_in_digits_is_no_frame(decode: str) -> None:
    """It is counted, and the next frame is read."""
    made = framing(f"{{ type: delimiter, tx: LF, rx: LF, decode: {decode} }}")
    good = made.encode(b"\x01\xfe\xff")
    assert codes(made.decoder().feed(b"0\n" + good)) == ["bad-digits", b"\x01\xfe\xff"]


def test_digits_come_in_capitals_or_small() -> None:
    """What is read is taken in either case; what is written is as declared."""
    made = framing("{ type: delimiter, tx: LF, rx: LF, decode: HEX }")
    assert made.encode(b"\xab") == b"AB\n"
    assert made.decoder().feed(b"ab\nAB\n") == [b"\xab", b"\xab"]


def test_a_checksum_behind_a_mark_is_taken_over_the_digits() -> None:
    """One in a fixed place is over the bytes that they spell."""
    made = framing(
        "{ type: delimiter, tx: LF, rx: LF, decode: HEX,"
        " checksum: { algorithm: xor8, as: HEX, after: '*' } }"
    )
    assert made.encode(b"\x01\xab") == b"01AB*02\n"
    assert made.decoder().feed(b"01AB*02\n") == [b"\x01\xab"]
    with pytest.raises(FramingError, match="exceeds the limit"):
        framing("{ type: datagram, decode: hex, max: 3 }").encode(b"ab")
