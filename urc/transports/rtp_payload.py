"""Payloads of RTP packets with H.264 (RFC 6184) and H.265 (RFC 7798), as parts of NAL units.

Pure. The modes with interleaved packets are not supported, because URC does not offer them.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

__all__ = ["PAYLOADS", "BadPayload", "NalPart", "PayloadFormat"]

_AVC_MOST, _AVC_AGGREGATE, _AVC_FRAGMENT = 23, 24, 28
_HEVC_MOST, _HEVC_AGGREGATE, _HEVC_FRAGMENT = 47, 48, 49
_STARTS, _ENDS = 0x80, 0x40
"""Bits of the header of a fragment."""
_SIZE_BYTES: Final = 2


class BadPayload(ValueError):
    """Raised for a payload that violates its format, or has an unsupported form."""


class NalPart(NamedTuple):
    """A NAL unit, or a part of one."""

    data: bytes
    """Bytes of the NAL unit; the first part begins with the unit's header."""
    is_start: bool = True
    is_end: bool = True


class PayloadFormat(NamedTuple):
    """A codec's functions for payloads and NAL units."""

    parts: Callable[[bytes], list[NalPart]]
    """Return the parts in a payload, which must not be empty; raise `BadPayload` if invalid."""
    kind: Callable[[bytes], int]
    """Return the type of a NAL unit, which must not be empty."""
    slices: range
    """Types of NAL units with encoded pixels."""
    openers: frozenset[int]
    """Types that can only begin an access unit: the delimiter, and the first parameter set."""


def _avc_kind(nal: bytes) -> int:
    return nal[0] & 0x1F


def _hevc_kind(nal: bytes) -> int:
    return nal[0] >> 1 & 0x3F


def _avc_parts(payload: bytes) -> list[NalPart]:
    kind = _avc_kind(payload)
    if 1 <= kind <= _AVC_MOST:
        return [NalPart(payload)]
    if kind == _AVC_AGGREGATE:
        return _aggregated(payload[1:])
    if kind != _AVC_FRAGMENT or len(payload) < 3:
        raise BadPayload(f"the H.264 payload has the unsupported type {kind}")
    flags = payload[1]
    header = bytes([payload[0] & 0xE0 | flags & 0x1F])
    return [_fragment(header, flags, payload[2:])]


def _hevc_parts(payload: bytes) -> list[NalPart]:
    kind = _hevc_kind(payload)
    if kind <= _HEVC_MOST and len(payload) > 2:
        return [NalPart(payload)]
    if kind == _HEVC_AGGREGATE:
        return _aggregated(payload[2:])
    if kind != _HEVC_FRAGMENT or len(payload) < 4:
        raise BadPayload(f"the H.265 payload has the unsupported type {kind}")
    flags = payload[2]
    header = bytes([payload[0] & 0x81 | (flags & 0x3F) << 1, payload[1]])
    return [_fragment(header, flags, payload[3:])]


def _fragment(header: bytes, flags: int, data: bytes) -> NalPart:
    is_start = bool(flags & _STARTS)
    return NalPart(header + data if is_start else data, is_start, bool(flags & _ENDS))


def _aggregated(data: bytes) -> list[NalPart]:
    found = []
    while data:
        end = _SIZE_BYTES + int.from_bytes(data[:_SIZE_BYTES], "big")
        if end == _SIZE_BYTES or end > len(data):
            raise BadPayload("a payload with several NAL units is truncated")
        found.append(NalPart(data[_SIZE_BYTES:end]))
        data = data[end:]
    return found


PAYLOADS: Final = {
    False: PayloadFormat(_avc_parts, _avc_kind, range(1, 6), frozenset((7, 9))),
    True: PayloadFormat(_hevc_parts, _hevc_kind, range(32), frozenset((32, 35))),
}
"""The formats, keyed by whether the codec is H.265 instead of H.264."""
