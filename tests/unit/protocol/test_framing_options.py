"""What framings may have besides: patience, terminals, kinds of frames that nobody knows."""

import pytest

from tests.unit.protocol.framing_samples import HEARTBEAT, MAVLINK, UBX_POLL, framing, wire
from urc.protocol.framing.base import FrameFault, FramingError
from urc.testing.framing import feed_three_ways

UNKNOWN = wire("fd 01 00 00 00 01 01 07 00 00 55 12 34")
PATIENT = (
    "{ type: length, start: 0x02, length: { offset: 1, size: 1, adjust: 3 }, end: 0x03,"
    " timeout: 200ms }"
)
LINES = "{ type: delimiter, tx: LF, rx: LF, timeout: 200ms }"
CONSOLE = '{ type: delimiter, tx: LF, rx: "> ", strip_ansi: true }'
XBEE = (
    "{ type: length, start: 0x7E, length: { offset: 1, size: 2, adjust: 4 },"
    " checksum: { algorithm: { fold: sum, complement: ones } }, escape: { byte: 0x7D, xor: 0x20 } }"
)
XBEE_FRAME = wire("7E 00 02 23 11 CB")
GARMIN = (
    "{ type: brackets, open: DLE, close: [DLE, ETX], escape: { byte: DLE, double: true },"
    " checksum: { algorithm: lrc } }"
)
GARMIN_FRAME = wire("10 06 02 10 10 00 E8 10 03")


def codes(found: list[bytes | FrameFault]) -> list[bytes | str]:
    return [one.code if isinstance(one, FrameFault) else one for one in found]


def test_a_frame_that_does_not_go_on_is_given_up() -> None:
    """A length that was read wrongly asks for bytes that never come."""
    decoder = framing(PATIENT).decoder()
    assert decoder.feed(wire("02 F0 02 01 41 03"), 1.0) == []
    assert decoder.deadline == pytest.approx(1.2)
    assert codes(decoder.tick(1.1)) == []
    assert codes(decoder.tick(1.2)) == ["frame-timeout", b"A"]
    assert decoder.deadline is None
    assert decoder.pending == 0
    assert decoder.feed(wire("02 01 42 03"), 1.3) == [b"B"]


def test_bytes_that_come_too_late_begin_anew() -> None:
    """Also when nobody has looked at the clock in between."""
    decoder = framing(PATIENT).decoder()
    assert decoder.feed(wire("02 02 41"), 1.0) == []
    assert codes(decoder.feed(wire("02 01 42 03"), 2.0)) == ["frame-timeout", b"B"]


def test_a_frame_that_goes_on_slowly_is_waited_for() -> None:
    """The silence is that behind the newest byte."""
    decoder = framing(PATIENT).decoder()
    for place, byte in enumerate(wire("02 02 41 42")):
        assert decoder.feed(bytes((byte,)), 0.19 * place) == []
    assert decoder.feed(b"\x03", 0.19 * 4) == [b"AB"]


def test_the_begin_of_a_line_is_given_up_as_a_whole() -> None:
    """There is no other begin to look for in it."""
    decoder = framing(LINES).decoder()
    assert decoder.feed(b"half a li", 0.0) == []
    assert codes(decoder.tick(0.2)) == ["frame-timeout"]
    assert decoder.feed(b"whole\n", 0.3) == [b"whole"]


def test_a_silent_flood_of_begins_is_given_up_in_bounded_work() -> None:
    """Each of 60000 bytes looks like the begin of a frame."""
    decoder = framing(PATIENT.replace("size: 1", "size: 2")).decoder()
    decoder.feed(b"\x02\xf0" * 30_000, 0.0)
    assert codes(decoder.tick(1.0))[:1] == ["frame-timeout"]
    assert decoder.pending == 0


def test_colours_of_a_terminal_are_taken_out_before_the_frame_is_cut() -> None:
    """However they are torn apart by the network."""
    made = framing(CONSOLE)
    said = b"\x1b[1;32muptime\x1b[0m\r\n12 days\r\n\x1b]0;robot\x07robot\x1b[K> \x1b[0m"
    frames = feed_three_ways(made.decoder, said, b"\x1b[3")
    assert frames == [b"uptime\r\n12 days\r\nrobot"]
    assert made.encode(b"uptime") == b"uptime\n"


def test_an_escape_that_never_ends_holds_up_little() -> None:
    """What is no sequence of a terminal is text without its escape."""
    decoder = framing(CONSOLE).decoder()
    found = decoder.feed(b"\x1b[" + b"0" * 400 + b"> ")
    assert found == [b"[" + b"0" * 400]
    assert decoder.pending == 0


@pytest.mark.parametrize(
    ("otherwise", "told"),
    [("fault", ["no-salt"]), ("skip", []), ("pass", [UNKNOWN[2:-2]])],
)
def test_a_frame_of_a_kind_without_a_salt(otherwise: str, told: list[bytes | str]) -> None:
    """It is told and dropped, dropped, or taken as it is."""
    made = framing(
        MAVLINK.replace("endian: little, table", f"endian: little, else: {otherwise}, table")
    )
    known = HEARTBEAT[2:-2]
    assert codes(made.decoder().feed(HEARTBEAT + UNKNOWN + HEARTBEAT)) == [known, *told, known]
    with pytest.raises(FramingError, match="no row 7"):
        made.encode(UNKNOWN[2:-2])


def test_what_one_case_skips_ends_the_case() -> None:
    """The next frame may be another case's."""
    salted = MAVLINK.replace("endian: little, table", "endian: little, else: skip, table")
    text = (
        f"{{ type: switch, cases: [{{ first: 0xFD, framing: {salted} }}],"
        " else: { type: delimiter, tx: LF, rx: LF } }"
    )
    assert framing(text).decoder().feed(UNKNOWN + b"ready\n" + HEARTBEAT) == [
        b"ready",
        HEARTBEAT[2:-2],
    ]


def test_a_wrong_checksum_of_the_header_alone_is_seen() -> None:
    """Each of several checksums is looked at."""
    text = (
        "{ type: length, start: 0x02, length: { offset: 1, size: 1, adjust: 5 }, end: 0x03,"
        " checksum: [{ algorithm: xor8 }, { algorithm: sum8, over: { from: 1 } }] }"
    )
    made = framing(text)
    good = made.encode(b"AB")
    assert good == wire("02 02 41 42 03 88 03")
    for place in (4, 5):
        bad = good[:place] + bytes((good[place] ^ 1,)) + good[place + 1 :]
        assert "bad-checksum" in codes(made.decoder().feed(bad))


@pytest.mark.parametrize(
    ("text", "frame", "payload", "before", "faults"),
    [
        (XBEE, XBEE_FRAME, wire("23 11"), b"\x01\x02", ["no-frame"]),
        (XBEE, XBEE_FRAME, wire("23 11"), wire("7E 00 05 01"), ["bad-stuffing"]),
        (XBEE, XBEE_FRAME, wire("23 11"), wire("7E FF FF 01"), ["bad-length"]),
        (GARMIN, GARMIN_FRAME, wire("06 02 10 00"), wire("01 10 03 02"), ["no-frame"]),
        (GARMIN, GARMIN_FRAME, wire("06 02 10 00"), wire("10 06 02"), ["no-frame"]),
        (GARMIN, GARMIN_FRAME, wire("06 02 10 00"), wire("10 06 02 10 03"), ["bad-checksum"]),
        (PATIENT, wire("02 01 41 03"), b"A", wire("55 55"), ["no-frame"]),
    ],
)
def test_after_what_is_no_frame_the_next_one_is_found(
    text: str, frame: bytes, payload: bytes, before: bytes, faults: list[str]
) -> None:
    """Whole or dripping, with one fault."""
    made = framing(text)
    expected = [*faults, payload, payload]
    assert codes(made.decoder().feed(before + frame + frame)) == expected
    drip = made.decoder()
    assert (
        codes([one for byte in before + frame * 2 for one in drip.feed(bytes((byte,)))]) == expected
    )


def test_other_frames_than_those_of_the_cases_are_cut_by_else() -> None:
    """The emulated robot says lines as lines, and the rest in the case."""
    text = (
        "{ type: switch, cases: [{ first: 0xB5, framing: { type: length, start: [0xB5, 0x62],"
        " length: { offset: 4, size: 2, endian: little, adjust: 8 },"
        " checksum: { algorithm: fletcher16-mod256, over: { from: 2 }, endian: little } } }],"
        " else: { type: delimiter, tx: LF, rx: LF } }"
    )
    made = framing(text)
    said = b"ready\n" + UBX_POLL + b"steady\n"
    assert feed_three_ways(made.decoder, said, b"\xb5") == [b"ready", UBX_POLL[2:-2], b"steady"]
    robot = made.reversed()
    assert robot.encode(b"ready") == b"ready\n"
    assert robot.encode(UBX_POLL[2:-2]) == UBX_POLL
