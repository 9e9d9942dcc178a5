"""Layout of a frame: constant bytes, length field, checksum, and the position of the payload.

The loader fills in every default value. A position of 0 or more counts from the first byte of the
frame. A negative position counts back from the end of the frame.
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
"""Notation of a number in a frame: raw bytes, or digits (``HEX``: upper case)."""
Digits = Literal["", "hex", "HEX", "base64"]
"""Notation of the bytes between the start and end markers; "" for raw bytes."""


class ByteRange(NamedTuple):
    """A byte range of a frame, as a Python slice."""

    start: int = 0
    stop: int | None = None


class Salt(NamedTuple):
    """Secret bytes that follow the covered range when the checksum is computed."""

    constant: bytes = b""
    offset: int = 0
    """Position in the frame, in bytes, of the number that selects an entry in `table`."""
    size: int = 1
    is_big: bool = False
    table: Mapping[Any, bytes] = NOTHING
    """Secret bytes for each number that the frame may contain at `offset`."""
    otherwise: Literal["fault", "skip", "pass"] = "fault"
    """Handling of frames whose number is not in `table`: report and drop (``fault``), drop
    silently (``skip``), or accept unchecked (``pass``)."""

    def number(self, frame: bytes | bytearray) -> int | None:
        """Return the number that selects the secret bytes; None if the frame is too short."""
        field = frame[self.offset : self.offset + self.size]
        if len(field) < self.size:
            return None
        return int.from_bytes(field, "big" if self.is_big else "little")


class ChecksumSpec(NamedTuple):
    """A checksum over part of a frame."""

    algorithm: CrcSpec | FoldSpec | str
    """Algorithm parameters, or the name of an algorithm without parameters, such as ``adler32``."""
    bits: int
    over: ByteRange
    at: int
    is_big: bool = True
    spelling: Spelling = "raw"
    salt: Salt = Salt()
    is_from_hex: bool = False
    """Whether the range contains hex digits to decode before the checksum is computed."""
    closes: bool = False
    """Whether a mismatch closes the connection instead of dropping the frame."""
    before: bytes = b""
    """Secret bytes that precede the covered range when the checksum is computed."""

    @property
    def size(self) -> int:
        """Size of the checksum in the frame, in bytes."""
        return spelt_size(self.bits, self.spelling)


class TrailerSpec(NamedTuple):
    """A checksum after variable-length text."""

    checksum: ChecksumSpec
    """Checksum parameters. The range refers to the text without the checksum. The attribute `at` of
    `checksum` is unused."""
    mark: bytes = b""
    """Separator between the text and the checksum."""
    is_padded: bool = True
    """Whether the digits of the checksum have leading zeros."""
    is_optional: bool = False
    """Whether text without a separator and checksum is also valid."""
    each: bytes = b""
    """Line separator of a frame with one checksum per line."""
    skip: int = 0
    """Number of lines without a checksum at the start of the frame."""


class LengthSpec(NamedTuple):
    """A length field: the size of the frame is field × `unit` + `adjust` bytes."""

    offset: int
    size: int
    """Size of the length field in bytes, or in digits for a text notation."""
    is_big: bool = True
    adjust: int = 0
    unit: int = 1
    bits: int = 64
    """Number of low bits of the length field that contain the length; the remaining bits belong to
    the payload."""
    spelling: Spelling = "raw"
    is_counted: bool = False
    """Whether the first `size` digits state the number of digits in the length."""
    until: bytes = b""
    """Terminator of a length field with at most `size` digits; b"" means no terminator."""
    flag_at: int = -1
    """Offset of the byte with the flag bits; -1 means that every frame has a length field."""
    flag_mask: int = 0
    """Mask of the flag bits. A frame has a length field only if at least one of these bits is set.
    A frame without a length field is `adjust` bytes long."""

    @property
    def is_loose(self) -> bool:
        """Whether the length field has a variable size."""
        return self.is_counted or bool(self.until)


class EscapeSpec(NamedTuple):
    """Byte stuffing: escape sequences for bytes with a special meaning in the framing."""

    byte: int = 0
    """Escape byte before a stuffed byte."""
    table: Mapping[Any, int] = NOTHING
    """Replacements that follow the escape byte, keyed by stuffed byte."""
    xor: int | None = None
    """XOR mask for decoding any stuffed byte, because a robot may stuff bytes outside `table`.
    Without an XOR mask, only bytes of `table` may be stuffed."""
    after: bytes = b""
    """Sequence after which the byte `insert` is stuffed; if set, `byte` and `table` are unused."""
    insert: int = 0
    is_of_payload: bool = False
    """Whether the length field and the checksum refer to the stuffed bytes instead of the original
    bytes."""


class FrameLayout(NamedTuple):
    """Positions of all parts of a frame."""

    start: bytes = b""
    end: bytes = b""
    head: int = 0
    """Size of the header before the payload, in bytes."""
    tail: int = 0
    """Size of the trailer after the payload, in bytes."""
    size: int | None = None
    """Size of the whole frame in bytes; None for a variable size."""
    length: LengthSpec | None = None
    checksum: ChecksumSpec | None = None
    """The last checksum, computed after all other checksums."""
    checksums: tuple[ChecksumSpec, ...] = ()
    """Checksums computed before `checksum`."""
    escape: EscapeSpec | None = None
    """Byte stuffing of the payload only; None means no stuffing."""
    trailer: TrailerSpec | None = None
    """Trailing checksum, checked first in a received frame and added last to a sent frame."""
    digits: Digits = ""
    """Notation of the bytes between the start and end markers. All positions and `checksums` refer
    to the decoded bytes."""


def spelt_size(bits: int, spelling: Spelling) -> int:
    """Return the number of bytes that a `bits`-bit number occupies in the frame."""
    size = (bits + 7) // 8
    if spelling == "raw":
        return size
    return 2 * size if spelling != "dec" else len(str((1 << bits) - 1))
