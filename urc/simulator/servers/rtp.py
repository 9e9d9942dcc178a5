"""Packets of RTP with H.264, and the sender reports that tell the camera's clock.

Pure. Sources: RFC 3550 (5.1: packets, 6.4.1: sender reports) and RFC 6184 (5.6: single NAL unit
packets, 5.8: FU-A fragments).
"""

import struct
from collections.abc import Iterator
from typing import Final

from urc._h264 import nal_units

__all__ = ["CLOCK_HZ", "PAYLOAD_TYPE", "RtpStream"]

CLOCK_HZ: Final = 90_000
"""Units of an RTP time stamp in a second, for all video formats."""
PAYLOAD_TYPE: Final = 96
"""First dynamic payload type (RFC 3551, 6)."""
MAX_PAYLOAD: Final = 1400
"""Maximum number of bytes after the RTP header; a packet then fits into an Ethernet frame."""
_VERSION: Final = 0x80
_MARKER: Final = 0x80
_HEADER: Final = struct.Struct(">BBHII")
_FU_A: Final = 28
_START, _END = 0x80, 0x40
_SENDER_REPORT: Final = 200
_REPORT: Final = struct.Struct(">BBHIIIIII")
_NTP_EPOCH_S: Final = 2_208_988_800
"""Seconds from 1900 to 1970."""


class RtpStream:
    """The packets of one receiver.

    Args:
        source: identifier of the stream's source, 32 bits.
        sequence: number of the first packet, 16 bits.
    """

    def __init__(self, source: int, sequence: int) -> None:
        self._source = source
        self._sequence = sequence
        self._packets = 0
        self._octets = 0

    def packets(self, unit: bytes, time_s: float) -> Iterator[bytes]:
        """Yield the packets of one access unit.

        Args:
            unit: access unit with start codes.
            time_s: time of the image, in seconds since the epoch.
        """
        nals = list(nal_units(unit))
        stamp = _stamp(time_s)
        for place, nal in enumerate(nals):
            is_last = place == len(nals) - 1
            if len(nal) <= MAX_PAYLOAD:
                yield self._packet(nal, stamp, is_last=is_last)
                continue
            head, step = nal[0], MAX_PAYLOAD - 2
            for start in range(1, len(nal), step):
                piece, is_end = nal[start : start + step], start + step >= len(nal)
                marks = (_START if start == 1 else 0) | (_END if is_end else 0)
                fragment = bytes((head & 0xE0 | _FU_A, marks | head & 0x1F)) + piece
                yield self._packet(fragment, stamp, is_last=is_last and is_end)

    def report(self, time_s: float) -> bytes:
        """Return a sender report: the camera's time of day and the matching RTP time stamp.

        `time_s` is in seconds since the epoch.
        """
        seconds, fraction = divmod(time_s + _NTP_EPOCH_S, 1.0)
        ntp = int(seconds) & 0xFFFFFFFF, int(fraction * 2**32)
        counts = self._packets & 0xFFFFFFFF, self._octets & 0xFFFFFFFF
        words = _REPORT.size // 4 - 1
        head = _VERSION, _SENDER_REPORT, words
        return _REPORT.pack(*head, self._source, *ntp, _stamp(time_s), *counts)

    def _packet(self, payload: bytes, stamp: int, *, is_last: bool) -> bytes:
        kind = PAYLOAD_TYPE | (_MARKER if is_last else 0)
        packet = _HEADER.pack(_VERSION, kind, self._sequence, stamp, self._source) + payload
        self._sequence = self._sequence + 1 & 0xFFFF
        self._packets += 1
        self._octets += len(payload)
        return packet


def _stamp(time_s: float) -> int:
    return round(time_s * CLOCK_HZ) & 0xFFFFFFFF
