"""Delimiter framing: every table is fed whole, byte by byte, and with more behind it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import FrameFault, Framing, FramingError
from urc.protocol.framing.table import build_framing


def framing(tx: bytes = b"\n", rx: bytes = b"\n", limit: int = 16) -> Framing:
    """A small delimiter framing."""
    return build_framing(FramingSpec("delimiter", {"tx": tx, "rx": rx}, limit))


TABLE = [
    (b"\n", b"42\n", [b"42"]),
    (b"\n", b"\n\n", [b"", b""]),
    (b"\r\n", b"a\rb\nc\r\nd", [b"a\rb\nc"]),
    (b"\r\n", b"\r\r\n", [b"\r"]),
    (b"ab", b"aaabxab", [b"aa", b"x"]),
    (b"\x00", bytes(range(1, 9)) + b"\x00", [bytes(range(1, 9))]),
]


@pytest.mark.parametrize(("rx", "stream", "expected"), TABLE)
def test_frames_are_the_same_however_the_bytes_arrive(
    rx: bytes, stream: bytes, expected: list[bytes]
) -> None:
    """A stream has no packets: TCP cuts it where it likes."""
    whole = framing(rx=rx).decoder().feed(stream)
    drip = framing(rx=rx).decoder()
    dripped = [frame for byte in stream for frame in drip.feed(bytes((byte,)))]
    followed = framing(rx=rx).decoder().feed(stream + rx + b"tail")
    assert whole == dripped == expected
    assert followed[: len(expected)] == expected


@pytest.mark.parametrize(
    "chunks",
    [
        [b"x" * 17 + b"\nok\n"],
        [b"x" * 10, b"x" * 10, b"x" * 10, b"\nok\n"],
        [b"x" * 100, b"x" * 1000, b"\no", b"k\n"],
    ],
)
def test_a_frame_that_is_too_long_is_dropped_once_and_the_stream_goes_on(
    chunks: list[bytes],
) -> None:
    """An endless line costs one fault and no memory."""
    decoder = framing().decoder()
    frames = []
    for chunk in chunks:
        frames += decoder.feed(chunk)
        assert decoder.pending <= 17
    faults = [frame for frame in frames if isinstance(frame, FrameFault)]
    assert [fault.code for fault in faults] == ["frame-too-long"]
    assert frames[-1] == b"ok"


def test_a_payload_with_the_delimiter_in_it_is_refused() -> None:
    """It would reach the robot as two frames, the second one of somebody's choosing."""
    with pytest.raises(FramingError, match="would be sent as two frames"):
        framing().encode(b"go\nDISARM")


def test_the_other_end_reads_what_this_end_sends() -> None:
    """The emulated robot is the same declaration turned round."""
    here = framing(tx=b"\r", rx=b"\r\n")
    assert here.reversed().decoder().feed(here.encode(b"MV 1")) == [b"MV 1"]
    assert here.decoder().feed(here.reversed().encode(b"OK")) == [b"OK"]


@given(st.lists(st.binary(max_size=40), max_size=20), st.sampled_from([b"\n", b"\r\n", b"\x00ab"]))
def test_arbitrary_bytes_never_raise_and_never_pile_up(chunks: list[bytes], rx: bytes) -> None:
    """However they are cut, the frames are those of the joined stream."""
    drip, whole = framing(rx=rx).decoder(), framing(rx=rx).decoder()
    dripped = [frame for chunk in chunks for frame in drip.feed(chunk)]
    assert drip.pending <= 16 + len(rx)
    assert dripped == whole.feed(b"".join(chunks))
