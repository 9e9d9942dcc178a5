"""Every framing: samples of public documents, cut in every way, and made again byte for byte."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from tests.unit.protocol.framing_samples import (
    ARM,
    GGA,
    HEARTBEAT,
    MAVLINK,
    NMEA,
    RMC,
    SAMPLES,
    UBX_POLL,
    Sample,
    framing,
    spec,
    wire,
)
from urc.protocol.framing.base import Decoder, FrameFault, FramingError
from urc.protocol.framing.receive_buffer import ReceiveBuffer
from urc.protocol.framing.table import build_framing
from urc.testing.framing import feed_three_ways

EACH = pytest.mark.parametrize("sample", SAMPLES, ids=[one.name for one in SAMPLES])
STREAMED = [one for one in SAMPLES if "datagram" not in one.text]
FIRST = {one.name: one for one in SAMPLES}


def faults(found: list[bytes | FrameFault]) -> list[str]:
    return [one.code for one in found if isinstance(one, FrameFault)]


def frames(found: list[bytes | FrameFault]) -> list[bytes]:
    return [one for one in found if isinstance(one, bytes)]


def finish(decoder: Decoder) -> list[bytes | FrameFault]:
    """Let silence complete what is held back."""
    return decoder.tick(1e9)


@EACH
def test_sample_is_cut_the_same_way_however_it_arrives(sample: Sample) -> None:
    """Whole, byte by byte, and with the begin of another frame behind it."""
    made = framing(sample.text)
    if "datagram" in sample.text:
        assert made.decoder().feed(sample.wire) == sample.payloads
    else:
        begin = sample.wire[:1]
        assert feed_three_ways(made.decoder, sample.wire, begin) == sample.payloads


@EACH
def test_payloads_become_the_sample_again(sample: Sample) -> None:
    """One declaration, both directions; and the other end of the line does the same."""
    made = framing(sample.text)
    assert b"".join(made.encode(payload) for payload in sample.payloads) == sample.wire
    other = made.reversed()
    assert b"".join(other.encode(payload) for payload in sample.payloads) == sample.wire
    for payload in sample.payloads:
        assert other.decoder().feed(made.encode(payload)) == [payload]


@pytest.mark.parametrize("sample", STREAMED, ids=[one.name for one in STREAMED])
def test_a_decoder_goes_on_where_another_has_stopped(sample: Sample) -> None:
    """So a reply may bring its own framing: what it leaves is still there."""
    stream = ReceiveBuffer()
    stream.push(sample.wire + sample.wire)
    made = framing(sample.text)
    found = []
    for _ in range(2 * len(sample.payloads)):
        decoder = made.decoder(stream)
        found.append(decoder.next())
    assert found == sample.payloads * 2
    assert len(stream) == 0


RESYNC = [
    "create 2 stream",
    "mavlink",
    "ubx",
    "vesc",
    "dynamixel 1 ping",
    "dynamixel 2 ping",
    "regex",
    "brackets",
    "json",
    "xml elements without a root",
    "nmea and ubx",
    "remregs replies",
    "decimal checksum",
]


@pytest.mark.parametrize("name", RESYNC)
def test_garbage_is_counted_once_and_the_next_frame_is_found(name: str) -> None:
    """A run of bytes that are no frame is one fault, however long it is and however it drips."""
    sample = FIRST[name]
    garbage = b"\x80\x81\x80" * 7
    stream = garbage + sample.wire + garbage + sample.wire
    whole = framing(sample.text).decoder().feed(stream)
    drip = framing(sample.text).decoder()
    dripped = [one for byte in stream for one in drip.feed(bytes((byte,)))]
    assert frames(whole) == frames(dripped) == sample.payloads * 2
    assert faults(whole) == faults(dripped) == ["no-frame", "no-frame"]


@pytest.mark.parametrize("name", ["create 2 stream", "mavlink", "ubx", "vesc", "dynamixel 2 ping"])
def test_a_frame_inside_a_false_one_is_found(name: str) -> None:
    """Start bytes in the garbage, with a length that swallows the true frame, cost only a fault."""
    sample = FIRST[name]
    begin = sample.wire[:1] + b"\x13\x13\x13" if name == "create 2 stream" else sample.wire[:5]
    found = framing(sample.text).decoder().feed(begin + sample.wire * 6)
    assert frames(found)[-len(sample.payloads) :] == sample.payloads
    assert len(frames(found)) >= 5 * len(sample.payloads)
    assert len(faults(found)) == 1


def corrupted(sample: Sample, place: int) -> bytes:
    return sample.wire[:place] + bytes((sample.wire[place] ^ 0x10,)) + sample.wire[place + 1 :]


@pytest.mark.parametrize(
    "name",
    [
        one.name
        for one in SAMPLES
        if "checksum" in one.text
        and "optional" not in one.text
        and "$" not in str(one.payloads[0][:1])
    ],
)
def test_a_flipped_bit_never_passes_a_checksum(name: str) -> None:
    """Whichever byte it is in, the frame does not come through. (NMEA leaves its ``$`` out.)"""
    sample = FIRST[name]
    for place in range(len(sample.wire)):
        decoder = framing(sample.text).decoder()
        found = frames(decoder.feed(corrupted(sample, place)))
        assert len(found) < len(sample.payloads)
        assert all(one in sample.payloads for one in found), place


def test_nmea_checksum_may_come_in_small_letters() -> None:
    """What is read is taken in either case; what is written is as declared."""
    assert framing(NMEA).decoder().feed(RMC + b"6a\r\n") == [RMC]


def test_wrong_checksum_says_what_would_be_right() -> None:
    """The profile author sees both numbers."""
    [fault] = framing(NMEA).decoder().feed(GGA + b"48\r\n")
    assert fault == FrameFault(
        "bad-checksum", "the frame has the checksum '48', expected '47'; dropped"
    )


def test_wrong_checksum_may_close_the_line() -> None:
    """`on_error: close` is told to whoever holds the connection."""
    text = "{ type: datagram, checksum: { algorithm: sum8, on_error: close } }"
    [fault] = framing(text).decoder().feed(b"ab")
    assert isinstance(fault, FrameFault)
    assert fault.closes


def test_salt_of_an_unknown_message_drops_it() -> None:
    """MAVLink's CRC needs a number out of the message's definition; without it nothing is sure."""
    unknown = HEARTBEAT[:7] + b"\x07" + HEARTBEAT[8:]
    [fault] = framing(MAVLINK).decoder().feed(unknown)
    assert isinstance(fault, FrameFault)
    assert (fault.code, fault.message) == (
        "no-salt", "the salt table of the checksum has no row 7",
    )  # fmt: skip
    with pytest.raises(FramingError, match="no row 7"):
        framing(MAVLINK).encode(unknown[2:-2])
    assert framing(MAVLINK).decoder().feed(unknown + ARM)[-1] == ARM[2:-2]


REFUSED = [
    ("{ type: fixed, size: 3 }", b"ab", "expected 3 bytes of payload, found 2"),
    ("{ type: length, length: { offset: 0, size: 1, adjust: 1 }, max: 1000 }", bytes(256),
     "the length field cannot hold 256"),
    ("{ type: length, length: { offset: 0, size: 2, as: dec, adjust: 2 } }", bytes(100),
     "the length field cannot hold 100"),
    ("{ type: length, length: { offset: 0, size: 1, unit: 4, adjust: 1 } }", bytes(3),
     "the frame's size must be a multiple of 4 bytes; 3 left over"),
    ("{ type: length, length: { offset: 0, size: 1, adjust: 5 } }", b"",
     "1 bytes are too few for this kind of frame"),
    ("{ type: slip }", b"", "SLIP cannot send an empty frame"),
    ("{ type: slip, max: 4 }", b"12345", "a frame of 5 bytes exceeds the limit of 4"),
    ("{ type: cobs, max: 4 }", b"12345", "a frame of 5 bytes exceeds the limit of 4"),
    ("{ type: brackets, open: '<', close: '>' }", b"a>b",
     "b'a>b' contains b'>', a marker of the framing"),
    ("{ type: brackets, open: '~', close: '~' }", b"",
     "an empty frame cannot be sent between two equal markers"),
    ("{ type: json }", b'{"a": 1', "b'{\"a\": 1' is not a single JSON object or array"),
    ("{ type: json }", b"{}{}", "b'{}{}' is not a single JSON object or array"),
    ("{ type: xml }", b"<a/><b/>", "b'<a/><b/>' is not a single XML element"),
    ("{ type: xml }", b"<a></b>", "b'<a></b>' is not a single XML element"),
    ("{ type: xml }", b"go", "b'go' is not a single XML element"),
    ("{ type: regex, pattern: '[a-z]+;' }", b"ab;c;",
     "b'ab;c;' does not match the pattern of the framing"),
    ("{ type: regex, pattern: '[a-z]+;', tx: LF }", b"a\nb", "b'a\\nb' contains b'\\n', so it"
     " would be sent as two frames"),
    ("{ type: switch, cases: [{ first: 1, framing: { type: fixed, size: 2 } }] }", b"\x02\x03",
     "no case of the framing matches b'\\x02\\x03'"),
    (NMEA, b"$A\r\nB*", "b'$A\\r\\nB*' contains the delimiter b'\\r\\n', so it would"
     " be sent as two frames"),
    ("{ type: datagram, checksum: { algorithm: sum8, from_hex: true } }", b"xy",
     "the checksum covers hex digits, found other bytes"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "payload", "message"), REFUSED)
def test_payload_that_would_make_no_frame_is_refused(
    text: str, payload: bytes, message: str
) -> None:
    """It would reach the robot as something else."""
    with pytest.raises(FramingError) as caught:
        framing(text).encode(payload)
    assert str(caught.value) == message


BAD = [
    ("{ type: slip }", wire("01 DB 05 C0 02 C0"), ["bad-stuffing"], [b"\x02"]),
    ("{ type: slip, max: 4 }", b"12345\xc0ab\xc0", ["frame-too-long"], [b"ab"]),
    ("{ type: cobs }", wire("05 01 00 02 02 00"), ["bad-stuffing"], [b"\x02"]),
    ("{ type: length, length: { offset: 0, size: 1 } }", wire("00 00 02 01"),
     ["bad-length"], [b"\x01"]),
    ("{ type: length, start: A, length: { offset: 1, size: 2, as: dec } , max: 99 }", b"Ax1A04.",
     ["bad-length"], [b"."]),
    ("{ type: fixed, size: 3, end: ';' }", b"xab;cd;", ["no-frame"], [b"ab", b"cd"]),
    ("{ type: brackets, open: '<', close: '>' }", b"<ab<cd>", ["no-frame"], [b"cd"]),
    ("{ type: brackets, open: '<', close: '>', max: 6 }", b"<" + b"x" * 40 + b"><cd>",
     ["frame-too-long"], [b"cd"]),
    ("{ type: json }", b'{"a]}\n{"b":1}', ["bad-json"], [b'{"b":1}']),
    ("{ type: json }", b"{]{}", ["bad-json"], [b"{}"]),
    ("{ type: json, max: 8 }", b'{"a":"12345"}{}', ["frame-too-long"], [b"{}"]),
    ("{ type: json }", b"[" * 300 + b"]{}", ["bad-json"], None),
    ("{ type: xml }", b"<?xml v='1'?>\n<!-- a --> <a/>\r\n<b/>", [], [b"<a/>", b"<b/>"]),
    ("{ type: xml }", b"<a><b></a></b><c/>", ["bad-xml"], None),
    ("{ type: xml }", b"<a <b/><c/>", ["bad-xml"], [b"<b/>", b"<c/>"]),
    ("{ type: xml }", b"</a><c/>", ["bad-xml"], [b"<c/>"]),
    ("{ type: xml }", b"<!DOCTYPE a><c/>", ["bad-xml"], [b"<c/>"]),
    ("{ type: xml, max: 8 }", b"<a>12345</a><c/>", ["frame-too-long"], None),
    ("{ type: xml }", b"<a>" * 101 + b"<c/>", ["bad-xml"], [b"<c/>"]),
    ("{ type: regex, pattern: '[a-z]{4,}\\n', max: 8 }", b"a" * 40 + b"\nabcd\n",
     ["frame-too-long"], [b"abcd\n"]),
    ("{ type: datagram, max: 2 }", b"abc", ["frame-too-long"], []),
    ("{ type: datagram, checksum: { algorithm: crc32 } }", b"abc", ["short-frame"], []),
]  # fmt: skip


@pytest.mark.parametrize(("text", "stream", "codes", "payloads"), BAD)
def test_bytes_that_are_no_frame_are_a_fault(
    text: str, stream: bytes, codes: list[str], payloads: list[bytes] | None
) -> None:
    """Told once, by a code; what follows is read."""
    found = framing(text).decoder().feed(stream)
    assert faults(found) == codes
    if payloads is not None:
        assert frames(found) == payloads


def test_silence_ends_a_frame() -> None:
    """The clock is passed in; a frame may come in pieces that are closer than the gap."""
    decoder = framing("{ type: idle, gap: 20ms }").decoder()
    assert decoder.deadline is None
    assert decoder.feed(b"ab", 1.0) == []
    assert decoder.feed(b"c", 1.015) == []
    assert decoder.deadline == pytest.approx(1.035)
    assert decoder.tick(1.03) == []
    assert decoder.tick(1.036) == [b"abc"]
    assert decoder.deadline is None
    assert decoder.feed(b"d", 2.0) == []
    assert decoder.feed(b"e", 2.5) == [b"d"]
    assert decoder.pending == 1


def test_frame_without_a_pause_is_dropped_once() -> None:
    """A robot that never pauses costs one fault and no memory."""
    decoder = framing("{ type: idle, gap: 20ms, max: 4 }").decoder()
    found = [one for place in range(50) for one in decoder.feed(b"x" * 3, place / 1000)]
    assert faults(found) == ["frame-too-long"]
    assert decoder.pending <= 4
    assert decoder.tick(1.0) == []
    assert decoder.feed(b"ok", 2.0) == []
    assert decoder.tick(3.0) == [b"ok"]


def test_regex_finds_long_frames_at_the_latest_when_it_is_quiet() -> None:
    """Long frames are not searched anew at every byte, so silence is what finds the last one."""
    decoder = framing("{ type: regex, pattern: '<[^>]*>' }").decoder()
    long = b"<" + b"x" * 1000 + b">"
    found = [one for byte in long for one in decoder.feed(bytes((byte,)), 1.0)]
    assert found == []
    assert decoder.deadline == pytest.approx(1.005)
    assert decoder.tick(1.01) == [long]
    assert decoder.deadline is None


def test_commands_may_end_otherwise_than_what_a_pattern_cuts() -> None:
    """With `tx`, the robot's side cuts at `tx`, and what it says must fit the pattern."""
    here = framing("{ type: regex, pattern: '[0-9]+;', tx: CR }")
    there = here.reversed()
    assert here.encode(b"PING") == b"PING\r"
    assert there.decoder().feed(b"PING\rPONG\r") == [b"PING", b"PONG"]
    assert here.decoder().feed(there.encode(b"42;")) == [b"42;"]
    with pytest.raises(FramingError):
        there.encode(b"none")
    assert there.reversed() == here


def test_xml_commands_may_end_with_a_mark() -> None:
    """As some servers want it, though an element ends by itself."""
    here = framing("{ type: xml, tx: NUL }")
    assert here.encode(b"<go/>") == b"<go/>\0"
    assert here.reversed().decoder().feed(b"<go/>\0<stop/>\0") == [b"<go/>", b"<stop/>"]
    assert here.decoder().feed(here.reversed().encode(b"<ok/>")) == [b"<ok/>"]


def test_json_commands_may_end_with_a_line_feed() -> None:
    """The robot's side takes it for a blank."""
    here = framing("{ type: json, tx: ';' }")
    assert here.encode(b"{}") == b"{};"
    assert here.reversed().decoder().feed(b"{};[];") == [b"{}", b"[]"]


def test_mid_sentence_start_is_one_fault() -> None:
    """A receiver is switched on when it is; the first half sentence is garbage."""
    sample = FIRST["nmea and ubx"]
    found = framing(sample.text).decoder().feed(b"1,08,0.9*47\r\n" + sample.wire + UBX_POLL[3:])
    assert frames(found) == sample.payloads
    assert faults(found) == ["no-frame", "no-frame"]


# ---- properties


HOLDS_LENGTH = (
    "thorlabs apt",
    "ubx",
    "dynamixel 1 ping",
    "dynamixel 2 ping",
    "flags beside the length",
    "nmea and ubx",
    "dynamixel 2, stuffed",
    "min",
    "two checksums",
)
A_FEW = settings(max_examples=examples(25), deadline=None)
"""For each of some thirty samples."""


@EACH
@A_FEW
@given(data=st.data())
def test_what_is_encoded_is_decoded(sample: Sample, data: st.DataObject) -> None:
    """decode(encode(x)) = x for every payload that is not refused, three in a row."""
    made = framing_of(sample)
    seeds = st.binary(max_size=600) | st.sampled_from(sample.payloads)
    payloads = data.draw(st.lists(seeds, min_size=1, max_size=3))
    taken, stream, decoder = [], b"", made.reversed().decoder()
    found: list[bytes | FrameFault] = []
    for payload in payloads:
        try:
            frame = made.encode(payload)
        except FramingError:
            continue
        if sample.name in HOLDS_LENGTH:  # what stood in the place of the length is not kept
            [payload] = made.decoder().feed(frame)
            assert made.encode(payload) == frame
        taken.append(payload)
        stream += frame
        found += decoder.feed(frame)
    assert found + finish(decoder) == taken
    if "datagram" not in sample.text:
        assert made.decoder().feed(stream) == taken


@EACH
@A_FEW
@given(data=st.data())
def test_arbitrary_bytes_never_raise_and_never_pile_up(sample: Sample, data: st.DataObject) -> None:
    """However they are cut; and the frames are those of the joined stream."""
    made = framing_of(sample)
    piece = st.binary(max_size=60) | st.sampled_from([sample.wire, sample.wire[:3], b"\x00" * 90])
    chunks = data.draw(st.lists(piece, max_size=12))
    drip, whole = made.decoder(), made.decoder()
    dripped = [one for chunk in chunks for one in drip.feed(chunk)]
    assert drip.pending <= sum(map(len, chunks))
    if "datagram" not in sample.text:
        joined = whole.feed(b"".join(chunks))
        assert frames(dripped + finish(drip)) == frames(joined + finish(whole))


@pytest.mark.parametrize("sample", STREAMED, ids=[one.name for one in STREAMED])
@A_FEW
@given(data=st.data())
def test_what_is_held_back_is_bounded(sample: Sample, data: st.DataObject) -> None:
    """By the longest frame, and what stuffing adds to it."""
    small = spec(sample.text)._replace(max_bytes=16)
    if small.type == "switch":
        return  # each case has its own bound
    decoder = build_framing(small).decoder()
    for chunk in data.draw(
        st.lists(st.binary(max_size=40) | st.just(sample.wire[:8]), max_size=30)
    ):
        decoder.feed(chunk)
        assert decoder.pending <= 2 * 16 + 4


_MADE = {one.name: framing(one.text) for one in SAMPLES}


def framing_of(sample: Sample):  # type: ignore[no-untyped-def]
    return _MADE[sample.name]
