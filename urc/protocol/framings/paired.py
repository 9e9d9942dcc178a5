"""Two framings on one line: one for each direction."""

from typing import NamedTuple

from urc.protocol.framings.base import Decoder, Framing
from urc.protocol.stream import Stream

__all__ = ["TwoFramings"]


class TwoFramings(NamedTuple):
    """What is sent is framed otherwise than what comes."""

    sent: Framing
    received: Framing

    def encode(self, payload: bytes) -> bytes:
        """Return the bytes of one frame, or raise `FramingError`."""
        return self.sent.encode(payload)

    def decoder(self, stream: Stream | None = None) -> Decoder:
        """Return a fresh decoder."""
        return self.received.decoder(stream)

    def reversed(self) -> "TwoFramings":
        """Return the same framings seen from the other end of the line."""
        return TwoFramings(self.received.reversed(), self.sent.reversed())
