"""The two directions of a line: numbered bytes, and how many of them may be on the way.

Layer 4. Pure. The receiver confirms the bytes that its protocol has processed. The sender keeps at
most `WINDOW_BYTES` unconfirmed bytes on the way, so a slow receiver stops the sender, and nothing
grows without bound.
"""

from typing import Final

from urc.fleet.bus import MAX_MESSAGE_BYTES

__all__ = ["PART_BYTES", "WINDOW_BYTES", "Incoming", "LineBroken", "Outgoing"]

PART_BYTES: Final = MAX_MESSAGE_BYTES - 64
"""Maximum number of bytes in one message; the rest is for its head."""
WINDOW_BYTES: Final = 64 * 1024
"""Maximum number of unconfirmed bytes. More would become outdated on the way to a slow receiver."""
_CONFIRM_BYTES: Final = WINDOW_BYTES // 8
"""Number of processed bytes after which the receiver confirms them."""


class LineBroken(Exception):
    """Bytes were lost, or the other site does not follow the rules; the message is one line."""


class Outgoing:
    """The bytes of one direction, as their sender sees them."""

    def __init__(self) -> None:
        self._waiting = bytearray()
        self._sent = 0
        self._confirmed = 0

    @property
    def waiting(self) -> int:
        """Number of bytes that the window keeps back."""
        return len(self._waiting)

    @property
    def unconfirmed(self) -> int:
        """Number of bytes on the way."""
        return self._sent - self._confirmed

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Append bytes."""
        self._waiting += data

    def take(self) -> tuple[int, bytes] | None:
        """Return the position and bytes of the next message; None if nothing may be sent."""
        count = min(len(self._waiting), WINDOW_BYTES - self.unconfirmed, PART_BYTES)
        if count <= 0:
            return None
        part = bytes(self._waiting[:count])
        del self._waiting[:count]
        at, self._sent = self._sent, self._sent + count
        return at, part

    def confirm(self, total: int) -> None:
        """Process a confirmation of the first `total` bytes.

        Raises:
            LineBroken: the receiver confirms bytes that were not sent.
        """
        if total > self._sent:
            raise LineBroken(f"{total} bytes are confirmed, but only {self._sent} were sent")
        self._confirmed = max(self._confirmed, total)


TWO_SERVERS: Final = (
    "two servers use the certificate of the site; end one of them, or revoke the site"
)
"""Why a byte arrives twice: the network delivers each message at most once."""


class Incoming:
    """The bytes of one direction, as their receiver sees them."""

    def __init__(self) -> None:
        self._received = 0
        self._processed = 0
        self._confirmed = 0

    def receive(self, at: int, data: bytes) -> None:
        """Process a message's position and bytes.

        Raises:
            LineBroken: bytes before the message are missing or arrive twice, or the window is
                exceeded.
        """
        if at < self._received:
            raise LineBroken(TWO_SERVERS)
        if at != self._received:
            raise LineBroken(f"{at - self._received} bytes are missing")
        self._received += len(data)
        if self._received - self._confirmed > WINDOW_BYTES:
            raise LineBroken(f"more than {WINDOW_BYTES} unconfirmed bytes arrived")

    def process(self, count: int) -> None:
        """Record that the protocol has processed `count` more bytes."""
        self._processed += count

    @property
    def is_due(self) -> bool:
        """Whether a confirmation should be sent immediately."""
        return self._processed - self._confirmed >= _CONFIRM_BYTES

    def confirmation(self) -> int | None:
        """Return the number of processed bytes for a confirmation; None if it is known already."""
        if self._processed == self._confirmed:
            return None
        self._confirmed = self._processed
        return self._confirmed
