"""The framings ``idle`` (silence ends a frame) and ``datagram`` (each block is a frame)."""

from typing import NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import (
    Decoder,
    FrameFault,
    StreamDecoder,
    encode_frame,
    frame_codec_of,
)
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = ["DatagramFraming", "IdleFraming"]


class IdleFraming(NamedTuple):
    """Frames that end after `gap_s` seconds of silence."""

    gap_s: float
    codec: FrameCodec | None
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "IdleFraming":
        """Return the framing for the option ``gap_s``."""
        return cls(cast("float", spec.options["gap_s"]), frame_codec_of(spec), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        return encode_frame(self.codec, payload, self.max_bytes)

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return _IdleDecoder(stream, self)

    def reversed(self) -> "IdleFraming":
        """Return the framing for the other end of the connection."""
        return self


class DatagramFraming(NamedTuple):
    """Framing for transports that deliver complete frames: each received block is one frame."""

    codec: FrameCodec | None
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "DatagramFraming":
        """Return the framing."""
        return cls(frame_codec_of(spec), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        return encode_frame(self.codec, payload, self.max_bytes)

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return _WholeDecoder(stream, self.codec, self.max_bytes)

    def reversed(self) -> "DatagramFraming":
        """Return the framing for the other end of the connection."""
        return self


class _WholeDecoder(StreamDecoder):
    """A decoder that returns each received block of bytes as one frame."""

    def __init__(
        self, stream: ReceiveBuffer | None, codec: FrameCodec | None, max_bytes: int
    ) -> None:
        super().__init__(stream, max_bytes)
        self._codec = codec

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        stream = self._stream
        if not len(stream):
            return None
        frame = bytes(stream.data[stream.at :])
        stream.at = len(stream.data)
        if len(frame) > self._max_bytes:
            text = f"a frame has {len(frame)} bytes, more than {self._max_bytes}; dropped"
            return FrameFault("frame-too-long", text)
        try:
            return frame if self._codec is None else self._codec.open(frame)
        except BadFrame as error:
            return self._refused(error)


class _IdleDecoder(_WholeDecoder):
    """A decoder for frames that end with silence.

    The argument `now` of `push` is the time at which the bytes were received. If `push` gets no
    time, only `tick` ends frames.
    """

    def __init__(self, stream: ReceiveBuffer | None, framing: IdleFraming) -> None:
        super().__init__(stream, framing.codec, framing.max_bytes)
        self._gap_s = framing.gap_s
        self._newest: float | None = None
        """Time of the newest received byte; None if the buffer is empty."""
        self._done: list[bytes | FrameFault] = []
        self._is_too_long = False

    @property
    def deadline(self) -> float | None:
        if self._done:
            return float("-inf")
        return None if self._newest is None else self._newest + self._gap_s

    def push(self, data: bytes, now: float = 0.0) -> None:
        self._end(now)
        if not data:
            return
        stream = self._stream
        stream.push(data)
        self._newest = now
        if len(stream) > self._max_bytes:
            # Discard the bytes of a frame that is too long, but still wait for its end.
            stream.at = len(stream.data)
            if not self._is_too_long:
                self._is_too_long = True
                text = f"a frame has more than {self._max_bytes} bytes without a pause; dropped"
                self._done.append(FrameFault("frame-too-long", text))

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        self._end(now)
        return self._done.pop(0) if self._done else None

    def tick(self, now: float) -> list[bytes | FrameFault]:
        self._end(now)
        frames, self._done = self._done, []
        return frames

    def _end(self, now: float) -> None:
        """Complete the frame if `now` is at least `gap_s` seconds after the newest byte."""
        if self._newest is None:
            if len(self._stream):
                self._newest = now  # bytes left by another decoder
            return
        if now < self._newest + self._gap_s:
            return
        self._newest = None
        if self._is_too_long:
            self._is_too_long = False
            self._stream.at = len(self._stream.data)
            return
        frame = super().next(now)
        if frame is not None:
            self._done.append(frame)
