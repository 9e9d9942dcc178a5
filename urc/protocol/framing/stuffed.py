"""Byte stuffing: ``slip`` (RFC 1055) and ``cobs`` (Cheshire and Baker, 1999).

Both framings end each frame with one byte value, and replace this value in the payload.
"""

import re
from collections.abc import Callable
from typing import Final, NamedTuple

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import Decoder, FramingError, encode_frame, frame_codec_of
from urc.protocol.framing.delimited import DelimiterDecoder
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = ["CobsFraming", "SlipFraming"]

_END, _ESCAPE = b"\xc0", b"\xdb"
_ESCAPED_END, _ESCAPED_ESCAPE = b"\xdb\xdc", b"\xdb\xdd"
_BAD_ESCAPE: Final = re.compile(rb"\xdb(?![\xdc\xdd])")
_BLOCK: Final = 254
"""Maximum number of non-zero bytes after one COBS code byte."""


class SlipFraming(NamedTuple):
    """SLIP frames, which end with END (0xC0) and escape END in the payload."""

    codec: FrameCodec | None
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "SlipFraming":
        """Return the framing."""
        return cls(frame_codec_of(spec), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        frame = encode_frame(self.codec, payload, self.max_bytes)
        if not frame:
            raise FramingError("SLIP cannot send an empty frame")
        return frame.replace(_ESCAPE, _ESCAPED_ESCAPE).replace(_END, _ESCAPED_END) + _END

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        most = 2 * self.max_bytes
        opened = _opener(_from_slip, self.codec, self.max_bytes)
        return DelimiterDecoder(stream, _END, most, opened, skips_empty=True)

    def reversed(self) -> "SlipFraming":
        """Return the framing for the other end of the connection."""
        return self


class CobsFraming(NamedTuple):
    """COBS frames, which end with a zero byte and contain no other zero byte."""

    codec: FrameCodec | None
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "CobsFraming":
        """Return the framing."""
        return cls(frame_codec_of(spec), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        return _to_cobs(encode_frame(self.codec, payload, self.max_bytes)) + b"\0"

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        most = self.max_bytes + self.max_bytes // _BLOCK + 1
        opened = _opener(_from_cobs, self.codec, self.max_bytes)
        return DelimiterDecoder(stream, b"\0", most, opened, skips_empty=True)

    def reversed(self) -> "CobsFraming":
        """Return the framing for the other end of the connection."""
        return self


def _opener(
    unstuffed: Callable[[bytes], bytes], codec: FrameCodec | None, max_bytes: int
) -> Callable[[bytes], bytes]:
    def opened(stuffed: bytes) -> bytes:
        frame = unstuffed(stuffed)
        if len(frame) > max_bytes:
            raise BadFrame("frame-too-long", f"a frame has more than {max_bytes} bytes; dropped")
        return frame if codec is None else codec.open(frame)

    return opened


def _from_slip(stuffed: bytes) -> bytes:
    bad = _BAD_ESCAPE.search(stuffed)
    if bad is not None:
        shown = stuffed[bad.start() : bad.start() + 2].hex(" ")
        raise BadFrame("bad-stuffing", f"{shown} is not a SLIP escape; the frame is dropped")
    return stuffed.replace(_ESCAPED_END, _END).replace(_ESCAPED_ESCAPE, _ESCAPE)


def _to_cobs(data: bytes) -> bytes:
    pieces: list[bytes] = []
    blocks = data.split(b"\0")
    for place, block in enumerate(blocks):
        # A full block does not end with a zero, so the remaining bytes follow in another block.
        at = 0
        while len(block) - at >= _BLOCK:
            pieces.append(b"\xff" + block[at : at + _BLOCK])
            at += _BLOCK
        if at and at == len(block) and place == len(blocks) - 1:
            break
        pieces.append(bytes((len(block) - at + 1,)) + block[at:])
    return b"".join(pieces)


def _from_cobs(stuffed: bytes) -> bytes:
    pieces: list[bytes] = []
    at = 0
    while at < len(stuffed):
        code = stuffed[at]
        block = stuffed[at + 1 : at + code]
        if len(block) != code - 1:
            raise BadFrame(
                "bad-stuffing", f"the COBS code {code:02x} points beyond the frame; dropped"
            )
        pieces.append(block)
        at += code
        if code <= _BLOCK and at < len(stuffed):
            pieces.append(b"\0")
    return b"".join(pieces)
