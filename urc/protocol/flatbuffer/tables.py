"""Tables, text and vectors in a FlatBuffer. Pure.

Every offset comes from the data, so it is compared with the data before use. Source: FlatBuffers,
“Internals”.
"""

import struct
from typing import Final

__all__ = ["BadBuffer", "Tables"]

_U16: Final = struct.Struct("<H").unpack_from
_I32: Final = struct.Struct("<i").unpack_from
_U32: Final = struct.Struct("<I").unpack_from


class BadBuffer(ValueError):
    """Data that is not a FlatBuffer, or an offset that leads out of the data."""


class Tables:
    """Access to one buffer; all methods raise `BadBuffer` or `struct.error` for bad offsets."""

    __slots__ = ("data", "size")

    def __init__(self, data: bytes) -> None:
        self.data, self.size = data, len(data)

    def root(self) -> int:
        """Return the place of the outermost table."""
        return self.follow(0)

    def follow(self, at: int) -> int:
        """Return the place to which the offset at `at` leads."""
        place = at + int(_U32(self.data, at)[0])
        if place > self.size - 4:
            raise BadBuffer("an offset leads out of the message")
        return place

    def field(self, table: int, slot: int) -> int:
        """Return the place of a field, or 0 if it is absent.

        Args:
            table: place of the table.
            slot: offset of the field in the table of offsets (vtable): 4 for the first field.
        """
        offsets = table - int(_I32(self.data, table)[0])
        if not 0 <= offsets <= self.size - 4:
            raise BadBuffer("a table of offsets lies outside the message")
        if slot + 2 > _U16(self.data, offsets)[0]:
            return 0
        offset: int = _U16(self.data, offsets + slot)[0]
        return table + offset if offset else 0

    def span(self, at: int, size: int) -> tuple[int, int]:
        """Return the begin and the length of the text or vector to which `at` leads.

        Args:
            at: place of the offset.
            size: size of one element, in bytes.
        """
        place = self.follow(at)
        count: int = _U32(self.data, place)[0]
        if count > (self.size - place - 4) // size:
            raise BadBuffer("a vector is longer than the message")
        return place + 4, count

    def text(self, at: int, most: int) -> str:
        """Return the text to which `at` leads; raise `BadBuffer` above `most` bytes."""
        begin, count = self.span(at, 1)
        if count > most:
            raise BadBuffer(f"a name has more than {most} bytes")
        return self.data[begin : begin + count].decode("utf-8", "replace")
