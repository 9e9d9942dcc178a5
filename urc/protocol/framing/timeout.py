"""Timeouts for any framing, and removal of terminal escape sequences.

Theory of operation. An incomplete frame blocks all later frames. For example, a corrupted length
field may require bytes that never arrive. With a timeout, the decoder stops waiting after a period
of silence. After the timeout, bytes are dropped one by one, until the remaining bytes contain valid
frames. Terminal escape sequences are removed before framing, because they could split a marker or
other text.
"""

import re
from typing import Final, NamedTuple

from urc.protocol.framing.base import SKIPPED, Decoder, FrameFault, Framing
from urc.protocol.framing.delimited import DelimiterFraming
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = ["TimeoutFraming"]

_SEQUENCE: Final = re.compile(
    rb"\x1b(?:\[[0-?]{0,64}[ -/]{0,8}[@-~]|\][^\x07\x1b]{0,256}(?:\x07|\x1b\\)"
    rb"|[ -/]{0,8}[0-Z\\^-~])"
)
"""ECMA-48 escape sequence: a control sequence, an operating system command such as a window title,
or a two-character escape."""
_MOST_TRIES: Final = 4096
"""Maximum number of attempts to find the start of the next frame; each attempt may scan all
remaining bytes."""
_LONGEST: Final = 300
"""Maximum length of an incomplete escape sequence, in bytes."""


class TimeoutFraming(NamedTuple):
    """A framing that adds a timeout for incomplete frames or removes escape sequences."""

    framing: Framing
    timeout_s: float | None
    strips_ansi: bool

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        return self.framing.encode(payload)

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return _PatientDecoder(ReceiveBuffer() if stream is None else stream, self)

    def reversed(self) -> "TimeoutFraming":
        """Return the framing for the other end of the connection."""
        return self._replace(framing=self.framing.reversed())


class _PatientDecoder:
    """A decoder that adds a timeout for incomplete frames to another decoder."""

    def __init__(self, stream: ReceiveBuffer, framing: TimeoutFraming) -> None:
        self._stream = stream
        self._framing = framing
        self._decoder = framing.framing.decoder(stream)
        self._newest: float | None = None
        """Time of the newest byte; None before the first byte."""
        self._told: list[bytes | FrameFault] = []
        """Frames and violations found after the timeout, to be returned by `next`."""
        self._held = b""
        """Received bytes of an incomplete escape sequence."""

    @property
    def pending(self) -> int:
        """Number of buffered bytes of an incomplete frame."""
        return self._decoder.pending + len(self._held)

    @property
    def deadline(self) -> float | None:
        """Time at which an incomplete frame times out, or the inner decoder's earlier deadline."""
        if self._told:
            return float("-inf")
        own, timeout = self._decoder.deadline, self._framing.timeout_s
        if timeout is None or not self.pending or self._newest is None:
            return own
        ends = self._newest + timeout
        return ends if own is None else min(own, ends)

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Append received bytes; return the completed frames and violations in order."""
        self.push(data, now)
        frames: list[bytes | FrameFault] = []
        while (frame := self.next(now)) is not None:
            frames.append(frame)
        return frames

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Append received bytes for `next` to decode."""
        self._discard(now)
        if self._framing.strips_ansi:
            data = self._stripped(data)
        self._decoder.push(data, now)
        self._newest = now

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove and return the next frame or violation; return None if it is incomplete."""
        if self._newest is None and len(self._stream):
            self._newest = now  # bytes left by another decoder
        if self._told:
            return self._told.pop(0)
        return self._decoder.next(now)

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return the frames and violations completed by silence until `now`."""
        frames = self._decoder.tick(now)
        self._discard(now)
        told, self._told = self._told, []
        return told + frames

    def _discard(self, now: float) -> None:
        """Drop the incomplete frame after its timeout; record the frames that follow."""
        timeout, stream = self._framing.timeout_s, self._stream
        if timeout is None or self._newest is None or now < self._newest + timeout:
            return
        self._held = b""
        self._newest = None
        is_lost, left = False, _MOST_TRIES
        while len(stream):
            before = stream.at
            found = self._decoder.next(now) if is_lost else None
            if isinstance(found, bytes):
                self._told.append(found)
                continue
            if found is None:
                left -= 1
                if not left or isinstance(self._framing.framing, DelimiterFraming):
                    before = len(stream.data)  # no later byte can begin a frame
                # No further bytes will arrive, so the buffered bytes are not a frame.
                stream.at = min(max(before + 1, stream.at), len(stream.data))
                if not is_lost:
                    text = f"a frame was incomplete for {timeout:g} s; dropped"
                    self._told.append(FrameFault("frame-timeout", text))
                is_lost = True
                self._decoder = self._framing.framing.decoder(stream)
            elif found.code == SKIPPED and stream.at == before:
                stream.at += 1

    def _stripped(self, data: bytes) -> bytes:
        whole = self._held + data
        self._held = b""
        if b"\x1b" not in whole:
            return whole
        text = _SEQUENCE.sub(b"", whole)
        place = text.find(b"\x1b")
        if place < 0:
            return text
        if len(text) - place <= _LONGEST:
            self._held = text[place:]
            return text[:place]
        return text.replace(b"\x1b", b"")
