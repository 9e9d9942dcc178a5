"""No stream makes a decoder look at its bytes again and again: the bytes looked at are counted."""

import re
from typing import Any

import pytest

from tests.unit.protocol.framing_samples import MAVLINK, NMEA, UBX, framing
from urc.protocol.framing import checksums, searched
from urc.protocol.framing.receive_buffer import ReceiveBuffer, RescanBudget

SIZE = 1 << 14


class Counter:
    """Bytes that were looked at."""

    def __init__(self) -> None:
        self.bytes = 0


class CountingBytes(bytearray):
    """Counts the bytes that each search and slice goes over."""

    counter = Counter()

    def find(self, mark: Any, start: Any = 0, end: Any = None) -> int:
        stop = len(self) if end is None else min(end, len(self))
        found = super().find(mark, start, stop)
        self.counter.bytes += (found if found >= 0 else stop) - start + 1
        return found

    def rfind(self, mark: Any, start: Any = 0, end: Any = None) -> int:
        stop = len(self) if end is None else min(end, len(self))
        found = super().rfind(mark, start, stop)
        self.counter.bytes += stop - max(found, start) + 1
        return found

    def __getitem__(self, place: Any) -> Any:
        if isinstance(place, slice):
            start, stop, _ = place.indices(len(self))
            self.counter.bytes += max(0, stop - start)
        return super().__getitem__(place)


REGEX = r"{ type: regex, pattern: '\$[^\r\n]+\r\n', max: %d }"
BRACKETS = "{ type: brackets, open: '(', close: ')', max: %d }"
SWITCH = (
    f'{{ type: switch, cases: [{{ first: "$", framing: {NMEA} }},'
    f' {{ first: "0xB562", framing: {UBX} }},'
    f' {{ first: "(", framing: {BRACKETS % SIZE} }}, {{ first: "{{", framing: {{ type: json }} }},'
    " { first: ':', framing: { type: delimiter, tx: LF, rx: LF, max: 15000 } }] }"
)
TWO_BYTES = (
    "{ type: length, start: 0x13, length: { offset: 1, size: 2, adjust: 4 },"
    " checksum: { algorithm: sum8 }, max: 15000 }"
)
HOSTILE = [
    ("{ type: delimiter, tx: CRLF, rx: CRLF }", b"\r"),
    ("{ type: delimiter, tx: LF, rx: LF }", b"\n"),
    ("{ type: fixed, size: 4000, checksum: { algorithm: crc32 } }", b"\x13"),
    ("{ type: fixed, size: 4000, start: 0x13, end: 0x14 }", b"\x13"),
    (TWO_BYTES, b"\x13"),
    (TWO_BYTES, b"\x13\x20\x00"),
    (TWO_BYTES, b"\x13\x01\x00"),
    ("{ type: length, length: { offset: 0, size: 4 } }", b"\xff"),
    (MAVLINK, b"\xfd"),
    (MAVLINK, b"\xfd\xff\x00"),
    ("{ type: slip }", b"\xdb\xdc"),
    ("{ type: cobs }", b"\x01"),
    (REGEX % SIZE, b"$"),
    (REGEX % 2000, b"$a\r"),
    (REGEX % 100, b"\r\n$"),
    (BRACKETS % SIZE, b"("),
    (BRACKETS % 1000, b"("),
    (BRACKETS % 1000, b"(x"),
    (BRACKETS % 1000, b"()"),
    ("{ type: brackets, open: '~', close: '~' }", b"~"),
    ("{ type: xml }", b"<"),
    ("{ type: xml }", b"<a>"),
    ("{ type: xml }", b"<a b='"),
    ("{ type: xml }", b"<!--"),
    ("{ type: xml }", b"<a></b>"),
    ("{ type: json }", b"["),
    ("{ type: json }", b"[{"),
    ("{ type: json }", b'["\\'),
    ("{ type: json }", b"[]"),
    ("{ type: json }", b"[}"),
    (SWITCH, b"$"),
    (SWITCH, b"$\r"),
    (SWITCH, b"\xb5\x62\x01"),
    (SWITCH, b"\xb5"),
    (SWITCH, b"("),
    (SWITCH, b":"),
    (SWITCH, b"({$"),
    (SWITCH, b"{"),
]
MOST = 32
"""Times that each byte may be looked at, on average; a search, its repetition on credit, a copy."""
MOST_SMALL = 300
"""The same where a pattern is tried anew at each byte, while the frame is still small."""


@pytest.mark.parametrize(("text", "piece"), HOSTILE)
@pytest.mark.parametrize(("size", "step"), [(SIZE, SIZE), (SIZE, 1000), (SIZE // 4, 1)])
def test_almost_frames_cost_linear_work(
    text: str, piece: bytes, size: int, step: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """16 KiB of what nearly is a frame, at once and in drips."""
    counter = CountingBytes.counter = Counter()
    count_patterns(counter, monkeypatch)
    decoder = framing(text).decoder(ReceiveBuffer(CountingBytes()))
    stream = (piece * size)[:size]
    for place in range(0, size, step):
        decoder.feed(stream[place : place + step], place / 1e6)
        assert decoder.pending <= 2 * SIZE + 2
    per_byte = (counter.bytes - 3 * RescanBudget.MOST) / size
    assert per_byte < (MOST_SMALL if "regex" in text else MOST)


def count_patterns(counter: Counter, monkeypatch: pytest.MonkeyPatch) -> None:
    """Count what checksums sum up, and what patterns go over."""
    window = checksums.Checksum._window

    def counted(self: checksums.Checksum, frame: bytes | bytearray, place: int) -> bytes:
        data = window(self, frame, place)
        counter.bytes += len(data)
        return data

    monkeypatch.setattr(checksums.Checksum, "_window", counted)
    made = searched._searcher

    def searcher(pattern: str) -> searched.Search:
        search = made(pattern)

        def counting(data: bytes | bytearray, start: int) -> Any:
            found = search(data, start)
            counter.bytes += (found.end() if found else len(data)) - start
            return found

        return counting

    monkeypatch.setattr(searched, "_searcher", searcher)


def test_the_count_sees_a_decoder_that_looks_again_and_again() -> None:
    """The measure itself is tested: a naive search for every byte is far above the limit."""
    counter = CountingBytes.counter = Counter()
    data = CountingBytes()
    for _ in range(2000):
        data += b"("
        data.find(b")")
    assert counter.bytes / len(data) > MOST
    assert re.search(b"x", data) is None
