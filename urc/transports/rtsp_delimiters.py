"""Ends each image of an RTSP stream as soon as its last packet arrives.

The video library delivers an image when it finds the beginning of the next one. Each image would
wait for one interval, which is 33 ms at 30 images a second. RTP marks the last packet of an image
(RFC 6184, 5.1, and RFC 7798, 4.1). After this packet, `UnitDelimiters` adds a packet with an
*access unit delimiter*, which every H.264 and H.265 parser knows as the beginning of an image. The
later packets get higher sequence numbers, so that nothing seems lost. `without_delimiter` removes
the delimiter again: its header has a layer that cameras must not use for it.

Packets over UDP do not pass through URC, so their images wait.
"""

import re
import struct
from typing import Final

__all__ = ["UnitDelimiters", "without_delimiter"]

_H264: Final = b"\x29\xf0"
"""Delimiter with `nal_ref_idc` 1; the standard demands 0 (ITU-T H.264, 7.4.1)."""
_H265: Final = b"\x46\x07\x50"
"""Delimiter of sub-layer 6; a camera's image begins in sub-layer 0 (ITU-T H.265, 7.4.2.2)."""
_DELIMITERS: Final = {b"H264": _H264, b"H265": _H265}
_OURS: Final = re.compile(rb"\A\x00{2,3}\x01(?:\x29\xf0|\x46\x07\x50)")
_CODEC: Final = re.compile(rb"a=rtpmap:(\d{1,3}) (H26[45])/", re.IGNORECASE)
_END: Final = re.compile(rb"\r?\n\r?\n")
_LENGTH: Final = re.compile(rb"\ncontent-length[ \t]*:[ \t]*(\d{1,6})", re.IGNORECASE)
_DOLLAR: Final = 0x24
_FRAME: Final = struct.Struct(">BBH")
"""Mark, channel and length of a packet between RTSP messages (RFC 2326, 10.12)."""
_RTP: Final = struct.Struct(">BBHII")
_MOST_TEXT_BYTES: Final = 65536
"""Longest RTSP message that is read; after a longer one, all data pass unchanged."""
_TRUSTED_ENDS: Final = 30
"""Number of images whose marks must be right before the first delimiter is added."""


def without_delimiter(unit: bytes) -> bytes:
    """Return an access unit as the camera has sent it."""
    found = _OURS.match(unit)
    return unit if found is None else unit[found.end() :]


class _Channel:
    """The RTP packets of one video."""

    def __init__(self) -> None:
        self._added = 0
        self._ended: int | None = None
        """Time stamp of the last image that a mark has ended."""
        self._ends = 0
        self._is_trusted = True

    def passed(self, number: int, packet: bytearray, codecs: dict[int, bytes]) -> bytes:
        """Return the frame of a packet, followed by the frame of a delimiter if one is due."""
        first, second, sequence, stamp, source = _RTP.unpack_from(packet)
        delimiter = codecs.get(second & 0x7F)
        if delimiter is None or first >> 6 != 2:
            return _framed(number, packet)
        struct.pack_into(">H", packet, 2, sequence + self._added & 0xFFFF)
        if stamp == self._ended:
            self._is_trusted = False  # some cameras mark each part of an image
        if second < 0x80 or not self._is_trusted:
            return _framed(number, packet)
        self._ended = stamp
        self._ends += 1
        if self._ends <= _TRUSTED_ENDS:
            return _framed(number, packet)
        self._added += 1
        head = _RTP.pack(0x80, second & 0x7F, sequence + self._added & 0xFFFF, stamp, source)
        return _framed(number, packet) + _framed(number, head + delimiter)


class UnitDelimiters:
    """Passes on the bytes from a camera, with delimiters."""

    def __init__(self) -> None:
        self._kept = bytearray()
        self._codecs: dict[int, bytes] = {}
        self._channels: dict[int, _Channel] = {}
        self._gives_up = False

    def passed(self, data: bytes) -> bytes:
        """Return what the library gets for the next bytes; the rest of a message comes later."""
        if self._gives_up:
            return data
        kept, out, at = self._kept, bytearray(), 0
        kept += data
        while at < len(kept):
            size = self._message_bytes(at)
            if size == 0 or at + size > len(kept):
                break
            out += self._message(kept[at : at + size])
            at += size
        del kept[:at]
        if len(kept) > _MOST_TEXT_BYTES + _FRAME.size:
            self._gives_up = True
            out += kept
            kept.clear()
        return bytes(out)

    def _message_bytes(self, at: int) -> int:
        """Return the size of the message that begins at a place; 0 if its end is unknown."""
        kept = self._kept
        if kept[at] == _DOLLAR:
            if len(kept) - at < _FRAME.size:
                return 0
            return _FRAME.size + int(_FRAME.unpack_from(kept, at)[2])
        head = _END.search(kept, at)
        if head is None:
            return 0
        length = _LENGTH.search(kept, at, head.start())
        return head.end() - at + (int(length[1]) if length else 0)

    def _message(self, message: bytearray) -> bytes:
        if message[0] != _DOLLAR:
            for kind, name in _CODEC.findall(message):
                self._codecs[int(kind)] = _DELIMITERS[name.upper()]
            return bytes(message)
        number, packet = message[1], message[_FRAME.size :]
        if len(packet) < _RTP.size:
            return bytes(message)
        return self._channels.setdefault(number, _Channel()).passed(number, packet, self._codecs)


def _framed(number: int, packet: bytes | bytearray) -> bytes:
    return _FRAME.pack(_DOLLAR, number, len(packet)) + packet
