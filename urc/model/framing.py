"""Layout of a frame: constant bytes, length field, checksum, and the place of the payload.

The loader resolves every default. A non-negative place counts from the first byte of the frame, a
negative one from behind its last byte.
"""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from urc._checksum_math import FOLDED, PLAIN_CHECKSUMS, CrcSpec, FoldSpec
from urc.model.values import NOTHING

__all__ = [
    "FOLDED",
    "PLAIN_CHECKSUMS",
    "ChecksumSpec",
    "CrcSpec",
    "Digits",
    "EscapeSpec",
    "FoldSpec",
    "FrameLayout",
    "LengthSpec",
    "Salt",
    "Spelling",
    "TrailerSpec",
    "ByteRange",
    "spelt_size",
]

Spelling = Literal["raw", "hex", "HEX", "dec"]
"""Notation of a number in a frame: raw bytes, or digits (``HEX``: in capitals)."""
Digits = Literal["", "hex", "HEX", "base64"]
"""Notation of the bytes between the start and end markers; "" for raw bytes."""


class ByteRange(NamedTuple):
    """A byte range of a frame, as a Python slice."""

    start: int = 0
    stop: int | None = None


class Salt(NamedTuple):
    """Secret bytes that follow the range in the input of the checksum."""

    constant: bytes = b""
    offset: int = 0
    """Offset of the number that selects from `table`."""
    size: int = 1
    is_big: bool = False
    table: Mapping[Any, bytes] = NOTHING
    """Number → bytes."""
    otherwise: Literal["fault", "skip", "pass"] = "fault"
    """Treatment of a frame with an unknown number: drop and report it, drop it silently, or accept
    it without a check."""

    def number(self, frame: bytes | bytearray) -> int | None:
        """Return the number that selects the row; None when the frame is too short."""
        field = frame[self.offset : self.offset + self.size]
        if len(field) < self.size:
            return None
        return int.from_bytes(field, "big" if self.is_big else "little")


class ChecksumSpec(NamedTuple):
    """A number over part of a frame that detects damage."""

    algorithm: CrcSpec | FoldSpec | str
    """Parameters, or the name of an algorithm without parameters: ``fletcher16``, ``adler32`` …"""
    bits: int
    over: ByteRange
    at: int
    is_big: bool = True
    spelling: Spelling = "raw"
    salt: Salt = Salt()
    is_from_hex: bool = False
    """Whether the range holds hex digits, whose bytes enter the checksum."""
    closes: bool = False
    """Whether a mismatch closes the connection instead of dropping the frame."""
    before: bytes = b""
    """Secret bytes that precede the range in the input of the checksum."""

    @property
    def size(self) -> int:
        """Size of the checksum in the frame, in bytes."""
        return spelt_size(self.bits, self.spelling)


class TrailerSpec(NamedTuple):
    """A checksum behind a text of variable length."""

    checksum: ChecksumSpec
    """Parameters. The range counts in the text without the checksum; `at` is unused."""
    mark: bytes = b""
    """Separator between the text and the checksum."""
    is_padded: bool = True
    """Whether the digits have leading zeros."""
    is_optional: bool = False
    """Whether a text without the separator is valid, too."""
    each: bytes = b""
    """Separator of the lines of a frame, each of which has its own checksum."""
    skip: int = 0
    """Number of first lines without a checksum."""


class LengthSpec(NamedTuple):
    """A length field. The size of the frame is field × `unit` + `adjust` bytes."""

    offset: int
    size: int
    """Bytes of the field, or its digits when it is spelt out."""
    is_big: bool = True
    adjust: int = 0
    unit: int = 1
    bits: int = 64
    """Number of low bits that hold the length; the others belong to the payload."""
    spelling: Spelling = "raw"
    is_counted: bool = False
    """Whether `size` digits give the number of digits that follow, which are the length."""
    until: bytes = b""
    """Terminator of the field, which then has at most `size` digits."""
    flag_at: int = -1
    """Offset of a flag byte that tells whether the field is a length; -1: it always is."""
    flag_mask: int = 0
    """Mask of the flag byte. If any of these bits is set, the field is a length; otherwise the
    frame has `adjust` bytes."""

    @property
    def is_loose(self) -> bool:
        """Whether its own bytes determine its size."""
        return self.is_counted or bool(self.until)


class EscapeSpec(NamedTuple):
    """Byte stuffing: escape sequences for bytes with a meaning in the framing."""

    byte: int = 0
    """Escape byte in front of a stuffed byte."""
    table: Mapping[Any, int] = NOTHING
    """Stuffed byte → its replacement after `byte`."""
    xor: int | None = None
    """XOR mask behind the table. A sender may also stuff other bytes."""
    after: bytes = b""
    """Sequence after which `insert` is stuffed; `byte` and `table` are then unused."""
    insert: int = 0
    is_of_payload: bool = False
    """Whether length and checksum count the stuffed bytes; otherwise, the original ones."""


class FrameLayout(NamedTuple):
    """Places of all parts of a frame."""

    start: bytes = b""
    end: bytes = b""
    head: int = 0
    """Size of the header in front of the payload, in bytes."""
    tail: int = 0
    """Size of the trailer behind the payload, in bytes."""
    size: int | None = None
    """Size of the whole frame, if constant."""
    length: LengthSpec | None = None
    checksum: ChecksumSpec | None = None
    """The last checksum; a sender computes it after all others."""
    checksums: tuple[ChecksumSpec, ...] = ()
    """Those before it."""
    escape: EscapeSpec | None = None
    """Byte stuffing of the payload alone."""
    trailer: TrailerSpec | None = None
    """Trailing checksum, removed before all other checks and added after all others."""
    digits: Digits = ""
    """Notation of the bytes between start and end; places and `checksums` count decoded bytes."""


def spelt_size(bits: int, spelling: Spelling) -> int:
    """Return the number of frame bytes of a number with `bits` bits."""
    size = (bits + 7) // 8
    if spelling == "raw":
        return size
    return 2 * size if spelling != "dec" else len(str((1 << bits) - 1))
