"""Events and lines are cut out of a body however it comes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.transports.http_events import Event, EventStreamParser, LineSplitter

# The examples are those of the HTML standard, section 9.2.6.
STREAMS = {
    "several lines of data": (
        b"data: YHOO\ndata: +2\ndata: 10\n\n",
        [Event("", b"YHOO\n+2\n10", "")],
    ),
    "comments, ids, and an event without its end": (
        b": test stream\n\ndata: first event\nid: 1\n\ndata:second event\nid\n\ndata:  third event",
        [Event("", b"first event", "1"), Event("", b"second event", "")],
    ),
    "empty data": (b"data\n\ndata\ndata\n\ndata:", [Event("", b"", ""), Event("", b"\n", "")]),
    "one space is no part of it": (b"data:test\n\ndata: test\n\n", [Event("", b"test", "")] * 2),
    "names": (
        b"event: add\ndata: 73\n\ndata: 1\n\n",
        [Event("add", b"73", ""), Event("", b"1", "")],
    ),
    "an event without data is none": (b"event: add\n\ndata: 1\n\n", [Event("", b"1", "")]),
    "CR LF": (b"data: 1\r\n\r\ndata: 2\r\n\r\n", [Event("", b"1", ""), Event("", b"2", "")]),
    "CR": (b"data: 1\r\rdata: 2\r\r", [Event("", b"1", ""), Event("", b"2", "")]),
    "a mark at the beginning": (b"\xef\xbb\xbfdata: 1\n\n", [Event("", b"1", "")]),
    "unknown fields": (b"foo: bar\ndata: 1\nbar\n\n", [Event("", b"1", "")]),
    "an id with NUL is none": (b"id: a\0b\ndata: 1\n\n", [Event("", b"1", "")]),
}


@pytest.mark.parametrize(("stream", "events"), STREAMS.values(), ids=STREAMS)
@pytest.mark.parametrize("size", [1, 2, 3, 1000])
def test_events_are_read_as_the_standard_says(
    stream: bytes, events: list[Event], size: int
) -> None:
    """Whole and in pieces."""
    cutter = EventStreamParser(1000)
    pieces = [stream[start : start + size] for start in range(0, len(stream), size)]
    assert [event for piece in pieces for event in cutter.feed(piece)] == events


def test_retry_and_last_id_are_kept() -> None:
    """They are what the next connection goes by; an id counts with its event's end."""
    cutter = EventStreamParser(1000, "7")
    assert cutter.last_id == "7"
    cutter.feed(b"id: 8\ndata: x\n")
    assert cutter.last_id == "7"
    assert cutter.feed(b"\nretry: 250\nretry: soon\n\n") == [Event("", b"x", "8")]
    assert (cutter.last_id, cutter.retry_s) == ("8", 0.25)


def test_event_that_is_too_long_is_left_out() -> None:
    """The next one is read again."""
    cutter = EventStreamParser(10)
    events = cutter.feed(b"data: 12345\ndata: 67890\n\ndata: 1234567890\n\ndata: " + b"x" * 500)
    assert events == [Event("", b"1234567890", "")]
    assert cutter.feed(b"x\ndata: y\n\ndata: ok\n\n") == [Event("", b"ok", "")]
    assert cutter.left_out == 2


def test_lines_end_as_they_like() -> None:
    """CR LF, LF and CR; the last one needs no end."""
    cutter = LineSplitter(100)
    assert cutter.feed(b"one\r") == [b"one"]
    assert cutter.feed(b"\ntwo\nthree\rfour\n\nfi") == [b"two", b"three", b"four", b""]
    assert cutter.feed(b"ve") == []
    assert cutter.end() == b"five"


def test_line_that_is_too_long_is_left_out() -> None:
    """Whatever is before and after it comes."""
    cutter = LineSplitter(5)
    assert cutter.feed(b"a\n123456\nb\n12345") == [b"a", b"b"]
    assert cutter.feed(b"6") == []
    assert cutter.feed(b"7\nc\n") == [b"c"]
    assert cutter.left_out == 2


@given(st.binary(max_size=80), st.lists(st.integers(1, 9), min_size=1))
def test_pieces_make_no_difference(body: bytes, sizes: list[int]) -> None:
    """Any bytes, cut anywhere."""
    whole, pieced = LineSplitter(20), LineSplitter(20)
    expected = [*whole.feed(body), whole.end()]
    found: list[bytes] = []
    turn = 0
    while body:
        size = sizes[turn % len(sizes)]
        found += pieced.feed(body[:size])
        body, turn = body[size:], turn + 1
    assert [*found, pieced.end()] == expected
    assert pieced.left_out == whole.left_out
