"""The wire format of Protocol Buffers: numbers of variable length, and the parts of a message.

Pure. Source: protobuf.dev, “Encoding”. A message is a sequence of fields. Each field begins with a
tag, which contains the number of the field and one of six kinds of values.
"""

from collections.abc import Iterator
from typing import Final

__all__ = [
    "BYTES",
    "FIXED32",
    "FIXED64",
    "GROUP_END",
    "GROUP_START",
    "VARINT",
    "BadWire",
    "parts_of",
    "read_varint",
    "skip",
    "varint",
]

VARINT, FIXED64, BYTES, GROUP_START, GROUP_END, FIXED32 = range(6)
_MAX_GROUPS: Final = 32
"""Maximum depth of nested groups."""


class BadWire(ValueError):
    """Data that is not a message of Protocol Buffers."""


def varint(value: int) -> bytes:
    """Return a whole number of up to 64 bits as a varint; negative numbers take ten bytes."""
    value &= 0xFFFF_FFFF_FFFF_FFFF
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


def read_varint(data: bytes, at: int) -> tuple[int, int]:
    """Return the varint at `at` as a number of 64 bits without sign, and the offset after it.

    Raises:
        BadWire: the varint has more than ten bytes.
        IndexError: the data ends too early.
    """
    value = data[at]
    at += 1
    if value < 128:
        return value, at
    value &= 127
    shift = 7
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value & 0xFFFF_FFFF_FFFF_FFFF, at
        shift += 7
        if shift > 63:
            raise BadWire("a number has more than ten bytes")


def skip(data: bytes, at: int, tag: int, depth: int = 0) -> int:
    """Return the offset after the value at `at`; raise `BadWire` or `IndexError`."""
    kind = tag & 7
    if kind == VARINT:
        return read_varint(data, at)[1]
    if kind == FIXED64:
        return at + 8
    if kind == FIXED32:
        return at + 4
    if kind == BYTES:
        size, at = read_varint(data, at)
        return at + size
    if kind != GROUP_START or depth > _MAX_GROUPS:
        raise BadWire(f"a field has the unknown kind {kind}")
    while True:
        inner, at = read_varint(data, at)
        if inner & 7 == GROUP_END:
            if inner >> 3 != tag >> 3:
                raise BadWire("a group ends with the number of another field")
            return at
        at = skip(data, at, inner, depth + 1)


def parts_of(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Yield the number and the value of each field in a message; numbers of fixed size as bytes.

    Raises:
        BadWire: the data is not a message, or ends too early.
    """
    at = 0
    try:
        while at < len(data):
            tag, at = read_varint(data, at)
            kind = tag & 7
            if kind == VARINT:
                value, at = read_varint(data, at)
                yield tag >> 3, value
                continue
            start = read_varint(data, at)[1] if kind == BYTES else at
            at = skip(data, at, tag)
            if at > len(data):
                raise BadWire("a field is longer than its message")
            yield tag >> 3, data[start:at]
    except IndexError:
        raise BadWire("the data ends too early") from None
