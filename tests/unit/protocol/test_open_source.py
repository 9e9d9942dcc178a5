"""Frames opened by generated code and by the general way: the same payload, the same words."""

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.model.framing import FOLDED, ByteRange, ChecksumSpec, CrcSpec, FrameLayout
from urc.protocol.framing.frame import BadFrame, FrameCodec

CRCS = [
    CrcSpec(16, 0x1021),
    CrcSpec(16, 0x1021, 0xFFFF),
    CrcSpec(16, 0x8005, 0xFFFF, True, True),
    CrcSpec(32, 0x04C11DB7, 0xFFFFFFFF, True, True, 0xFFFFFFFF),
]


@st.composite
def layouts(draw: st.DrawFn) -> FrameLayout:
    """Checksums of all sizes near the end, over several windows, with bytes behind them."""
    end = draw(st.integers(0, 2))
    head = draw(st.integers(0, 3))
    algorithm = draw(st.sampled_from([*CRCS, FOLDED["sum8"], FOLDED["xor8"], "adler32"]))
    bits = 32 if algorithm == "adler32" else getattr(algorithm, "width", 8)
    size = bits // 8
    at = -size - end
    stop = draw(st.sampled_from([at, at - 1]))
    spec = ChecksumSpec(
        algorithm, bits, ByteRange(draw(st.sampled_from([0, head])), stop), at, draw(st.booleans())
    )
    return FrameLayout(
        end=b"\3\4"[:end], head=head, tail=size + end, checksum=draw(st.sampled_from([spec, None]))
    )


@given(layouts(), st.binary(min_size=1, max_size=20), st.binary(max_size=4), st.data())
@settings(max_examples=examples(300), deadline=None)
def test_generated_and_general_agree(
    layout: FrameLayout, payload: bytes, noise: bytes, data: st.DataObject
) -> None:
    """Of whole frames, of frames with a changed byte, of short ones and of noise."""
    codec = FrameCodec(layout)
    frame = codec.close(payload)
    assert codec.open(frame) == payload
    place = data.draw(st.integers(0, len(frame) - 1))
    changed = frame[:place] + bytes((frame[place] ^ 1,)) + frame[place + 1 :]
    for one in (frame, changed, frame[:place], noise):
        assert outcome(codec, one, is_general=False) == outcome(codec, one, is_general=True)


def outcome(codec: FrameCodec, frame: bytes, *, is_general: bool) -> bytes | str:
    """Return the payload, or the words of the refusal."""
    try:
        return codec._open(frame) if is_general else codec.open(frame)
    except BadFrame as error:
        return str(error)
