"""Assembly of encoded images from RTP packets, which may be late, repeated or lost.

Pure. A packet whose predecessors are missing waits for at most `WAIT_S`: the sender may repeat
lost packets. Afterwards, the missing packets count as lost. An image with a lost packet is dropped,
so no decoder ever shows it.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from urc.transports.rtp_payload import PAYLOADS, BadPayload, NalPart
from urc.video import MAX_UNIT_BYTES

__all__ = ["WAIT_S", "RtpImage", "RtpAssembler", "RtpPiece"]

WAIT_S: Final = 0.2
"""Maximum wait for a missing packet, in seconds."""
MOST_WAITING: Final = 1000
"""Maximum number of packets that wait for a missing packet."""
_MOST_LATE: Final = 3000
"""Difference between two numbers above which the sender has restarted its numbers."""
_MOST_AHEAD: Final = 3000
_MOST_MISSING: Final = 100
_NUMBERS: Final = 1 << 16
_START_CODE: Final = b"\x00\x00\x00\x01"


class RtpPiece(NamedTuple):
    """The parts of an RTP packet that matter for an image (RFC 3550, 5.1)."""

    number: int
    """Sequence number, from 0 to 65535."""
    stamp: int
    """Time stamp, the same in all packets of an image, from 0 to 2³² - 1."""
    is_last: bool
    """Marker bit: whether the packet is the last one of its image."""
    payload: bytes
    came_s: float
    """Time of arrival, in seconds."""


class RtpImage(NamedTuple):
    """An encoded image, without a missing packet."""

    data: bytes
    """Access unit with start codes."""
    stamp: int
    """RTP time stamp."""
    came_s: float
    """Time of arrival of the first packet of this image or of a later one, in seconds."""
    is_after_loss: bool
    """Whether images before this one are missing, so that only a keyframe can be decoded."""


class RtpAssembler:
    """The packets of one stream."""

    def __init__(self, *, is_hevc: bool) -> None:
        """Create an assembler without packets, for H.265 instead of H.264 if `is_hevc`."""
        self._format = PAYLOADS[is_hevc]
        self._next = -1
        """Number of the next packet in order, without a wrap at 65536; -1 before the first one."""
        self._waiting: dict[int, RtpPiece] = {}
        """Packets after a missing packet by number, in the order of their arrival."""
        self._image = _Image()
        self._follows_gap = True
        """Whether the packet before the next image's first packet is unknown."""
        self._has_lost = False

    def add(self, piece: RtpPiece) -> list[RtpImage]:
        """Add a packet, and return the images that are now complete, in order."""
        place = self._place(piece.number)
        if place is None or place in self._waiting:
            return []
        self._waiting[place] = piece
        return list(self._complete(piece.came_s))

    def missing(self) -> list[int]:
        """Return the numbers of the missing packets that the sender could repeat."""
        if not self._waiting:
            return []
        places = range(self._next, max(self._waiting))
        lost = [place % _NUMBERS for place in places if place not in self._waiting]
        return lost[:_MOST_MISSING]

    def _place(self, number: int) -> int | None:
        """Return a packet's place in the stream; None for a late or repeated packet."""
        if self._next < 0:
            self._next = number
        ahead = (number - self._next) % _NUMBERS
        if ahead <= _MOST_AHEAD:
            return self._next + ahead
        if ahead >= _NUMBERS - _MOST_LATE:
            return None
        self._waiting.clear()
        self._lose()
        self._next = number
        return number

    def _complete(self, now_s: float) -> Iterator[RtpImage]:
        while self._waiting:
            piece = self._waiting.pop(self._next, None)
            if piece is not None:
                self._next += 1
                yield from self._taken(piece)
                continue
            oldest = next(iter(self._waiting.values()))
            if now_s - oldest.came_s <= WAIT_S and len(self._waiting) < MOST_WAITING:
                return
            self._next = min(self._waiting)
            self._lose()

    def _lose(self) -> None:
        self._image = _Image()
        self._follows_gap = self._has_lost = True

    def _taken(self, piece: RtpPiece) -> Iterator[RtpImage]:
        if not piece.payload:
            return  # padding
        if self._image.stamp not in (None, piece.stamp):
            yield from self._finished()
        image = self._image
        if image.stamp is None:
            image.stamp, image.came_s = piece.stamp, piece.came_s
            image.is_damaged, self._follows_gap = self._follows_gap, False
            image.may_open = image.is_damaged
        image.came_s = min(image.came_s, piece.came_s)
        try:
            for part in self._format.parts(piece.payload):
                self._add_part(image, part)
        except BadPayload:
            image.is_damaged, image.may_open = True, False
        if piece.is_last and image.has_slice:
            yield from self._finished()

    def _add_part(self, image: "_Image", part: NalPart) -> None:
        if part.is_start:
            kind = self._format.kind(part.data)
            if image.may_open and kind in self._format.openers:
                image.is_damaged = False  # nothing of this image came before it
            image.has_slice |= kind in self._format.slices
        image.add(part)

    def _finished(self) -> Iterator[RtpImage]:
        image, self._image = self._image, _Image()
        if image.is_damaged or image.is_open or image.stamp is None:
            self._has_lost = True
            return
        has_lost, self._has_lost = self._has_lost, False
        later = next(iter(self._waiting.values()), None)
        came_s = image.came_s if later is None else min(image.came_s, later.came_s)
        yield RtpImage(bytes(image.data), image.stamp, came_s, has_lost)


class _Image:
    """An image whose packets are still arriving."""

    def __init__(self) -> None:
        self.stamp: int | None = None
        self.came_s = 0.0
        self.data = bytearray()
        self.is_open = False
        """Whether the end of the newest NAL unit is still missing."""
        self.is_damaged = False
        self.may_open = False
        """Whether nothing has arrived after a gap, so that an opener proves a whole image."""
        self.has_slice = False

    def add(self, part: NalPart) -> None:
        self.may_open = False
        if part.is_start == self.is_open:
            self.is_damaged = True
        self.is_open = not part.is_end
        if len(self.data) <= MAX_UNIT_BYTES:  # a longer image is refused by its reader
            self.data += _START_CODE + part.data if part.is_start else part.data
