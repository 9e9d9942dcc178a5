"""Which of the bytes of a WebSocket are one whole text, and which are left to the library."""

from random import Random

import pytest
from websockets.frames import Frame, Opcode

from urc.web.serve.frames import WebSocketFrames, text_of


def masked(text: bytes, opcode: Opcode = Opcode.TEXT, *, fin: bool = True) -> bytes:
    """Return a frame as browsers send it, made by the library."""
    return Frame(opcode, text, fin=fin).serialize(mask=True)


@pytest.mark.parametrize("size", [0, 1, 3, 4, 125, 126, 4000, 65535])
def test_a_whole_text_is_found(size: int) -> None:
    text = bytes(Random(size).randbytes(size))  # noqa: S311 - it is no secret
    frames = WebSocketFrames()
    assert frames.whole(masked(text)) == text
    assert frames.whole(b"\x81\x80\0\0\0\0") == b""


@pytest.mark.parametrize(
    "data",
    [
        masked(b"x" * 65536),
        masked(b"x", Opcode.BINARY),
        masked(b"x", Opcode.PING),
        masked(b"x", Opcode.CLOSE),
        masked(b"one") + masked(b"two"),
        masked(b"half")[:-1],
        Frame(Opcode.TEXT, b"not masked").serialize(mask=False),
        b"\xc1" + masked(b"compressed")[1:],
        b"\x81",
        b"",
    ],
    # The masks are random, and names of tests are not.
    ids=[
        *("long", "binary", "ping", "close", "two"),
        *("half", "plain", "compressed", "cut", "none"),
    ],
)
def test_what_is_anything_else_is_left_to_the_library(data: bytes) -> None:
    assert WebSocketFrames().whole(data) is None


def test_a_text_within_a_message_of_parts_is_not_taken() -> None:
    """It breaks the protocol: the library must see it."""
    frames = WebSocketFrames()
    assert frames.whole(masked(b"part", fin=False)) is None
    assert frames.whole(masked(b"ping", Opcode.PING)) is None
    assert frames.whole(masked(b"text")) is None
    assert frames.whole(masked(b"end", Opcode.CONT)) is None


def test_texts_that_came_together_are_found_up_to_what_is_none() -> None:
    """A page that floods is read seldom, and then brings many at once."""
    frames = WebSocketFrames()
    texts = [b"one", b"two" * 100, b""]
    data = b"".join(map(masked, texts))
    rest = masked(b"ping", Opcode.PING) + masked(b"three") + masked(b"half")[:3]
    assert frames.whole(data + rest) is None
    found = [data[begin:end] for begin, end in frames.spans]
    assert [text_of(frame) for frame in found] == texts
    assert b"".join(found) == data
    assert frames.whole(masked(b"half")[3:] + masked(b"four")) is None
    assert frames.spans == [], "what comes first is the end of another one"
    assert frames.whole(masked(b"five")) == b"five"


def test_however_the_stream_is_cut_only_frames_that_came_whole_are_found() -> None:
    """And what is in the middle of another is never taken for one."""
    dice = Random(7)  # noqa: S311 - it is no secret
    hidden = masked(b"hidden in a payload")
    for _ in range(300):
        pieces = [
            masked(dice.choice([b"a", b"tick" * 40, b"{}" * 100]))
            if dice.random() < 0.6
            else masked(hidden * dice.randrange(1, 5), dice.choice([Opcode.BINARY, Opcode.TEXT]))
            for _ in range(20)
        ]
        stream, ends = b"".join(pieces), {0}
        for piece in pieces:
            ends.add(max(ends) + len(piece))
        frames, at = WebSocketFrames(), 0
        while at < len(stream):
            nearest = min(end for end in ends if end > at)
            step = nearest - at if dice.random() < 0.5 else dice.randrange(1, 400)
            found = frames.whole(stream[at : at + step])
            is_whole = at in ends and min(at + step, len(stream)) == nearest
            is_text = is_whole and stream[at] == 0x81
            assert (found is not None) is is_text
            at += step
