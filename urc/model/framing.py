"""What a frame is made of: its constant bytes, length field, checksum, and where the payload is.

The loader resolves every default, so that a place here is a place: counted from the frame's first
byte, or, when it is negative, from behind its last one.
"""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from urc._sums import FOLDED, PLAIN_CHECKSUMS, CrcSpec, FoldSpec
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
    "TrailSpec",
    "Window",
    "spelt_size",
]

Spelling = Literal["raw", "hex", "HEX", "dec"]
"""How a number stands in a frame: as bytes, or as digits (``HEX``: in capitals)."""
Digits = Literal["", "hex", "HEX", "base64"]
"""How a frame spells its bytes, between its marks: "" as they are."""


class Window(NamedTuple):
    """Part of a frame, as Python slices it."""

    start: int = 0
    stop: int | None = None


class Salt(NamedTuple):
    """Bytes that only the two ends know, fed to the checksum behind the window."""

    constant: bytes = b""
    offset: int = 0
    """Place of the number that chooses among `table`."""
    size: int = 1
    is_big: bool = False
    table: Mapping[Any, bytes] = NOTHING
    """Number → bytes."""
    otherwise: Literal["fault", "skip", "pass"] = "fault"
    """What becomes of a frame whose number is not in the table: it is told and dropped, dropped
    without a word, or taken with its checksum unchecked."""

    def number(self, frame: bytes | bytearray) -> int | None:
        """Return the number that chooses the row; None when the frame is too short."""
        field = frame[self.offset : self.offset + self.size]
        if len(field) < self.size:
            return None
        return int.from_bytes(field, "big" if self.is_big else "little")


class ChecksumSpec(NamedTuple):
    """A number over part of a frame that shows whether the frame is whole."""

    algorithm: CrcSpec | FoldSpec | str
    """A word stands for an algorithm without parameters: ``fletcher16``, ``adler32`` …"""
    bits: int
    over: Window
    at: int
    is_big: bool = True
    spelling: Spelling = "raw"
    salt: Salt = Salt()
    is_from_hex: bool = False
    """Whether the window spells, in hex digits, the bytes that are summed up."""
    closes: bool = False
    """Whether a wrong one ends the connection instead of the frame alone."""
    before: bytes = b""
    """Bytes that only the two ends know, fed to the checksum in front of the window."""

    @property
    def size(self) -> int:
        """Bytes that it takes in the frame."""
        return spelt_size(self.bits, self.spelling)


class TrailSpec(NamedTuple):
    """A checksum behind a text, in a place that only the text shows."""

    checksum: ChecksumSpec
    """Its window is counted in the text without the checksum; `at` means nothing."""
    mark: bytes = b""
    """Stands between the text and the checksum."""
    is_padded: bool = True
    """Whether its digits have leading zeros."""
    is_optional: bool = False
    """Whether a text without the mark is good, too."""
    each: bytes = b""
    """Separates the lines of a frame, each of which has a checksum of its own."""
    skip: int = 0
    """First lines that have none."""


class LengthSpec(NamedTuple):
    """A number in the frame that says how long the frame is: field x `unit` + `adjust` bytes."""

    offset: int
    size: int
    """Bytes that the number takes: digits, when it is spelt out."""
    is_big: bool = True
    adjust: int = 0
    unit: int = 1
    bits: int = 64
    """Lowest bits of the number that are the length; the others are the payload's."""
    spelling: Spelling = "raw"
    is_counted: bool = False
    """`size` digits say how many digits follow, and those are the number."""
    until: bytes = b""
    """What ends the number, which then has `size` digits at most."""
    flag_at: int = -1
    """Place of a byte that says whether the number is a length; -1: it always is."""
    flag_mask: int = 0
    """It is one where any of these bits is set; else the frame has `adjust` bytes."""

    @property
    def is_loose(self) -> bool:
        """Whether its size is known from its own bytes alone."""
        return self.is_counted or bool(self.until)


class EscapeSpec(NamedTuple):
    """How bytes that mean something to the framing are hidden in its frames."""

    byte: int = 0
    """Stands before a byte that is hidden."""
    table: Mapping[Any, int] = NOTHING
    """Byte that is hidden → byte that stands for it behind `byte`."""
    xor: int | None = None
    """Mask that made the table: whoever sends may hide other bytes, too."""
    after: bytes = b""
    """Behind this sequence `insert` is put in; `byte` and `table` then mean nothing."""
    insert: int = 0
    is_of_payload: bool = False
    """Length and checksum count what is stuffed; otherwise, what it stands for."""


class FrameLayout(NamedTuple):
    """Where everything is in a frame."""

    start: bytes = b""
    end: bytes = b""
    head: int = 0
    """Bytes before the payload."""
    tail: int = 0
    """Bytes behind the payload."""
    size: int | None = None
    """Of the whole frame, where it is always the same."""
    length: LengthSpec | None = None
    checksum: ChecksumSpec | None = None
    """The last one: what is sent carries it when all others stand."""
    checksums: tuple[ChecksumSpec, ...] = ()
    """Those before it."""
    escape: EscapeSpec | None = None
    """Stuffing of the payload alone."""
    trail: TrailSpec | None = None
    """Checksum that is taken off before all others are looked at, and put on behind them."""
    digits: Digits = ""
    """How what is between start and end is spelt; places and `checksums` count the bytes."""


def spelt_size(bits: int, spelling: Spelling) -> int:
    """Return how many bytes of a frame a number of `bits` bits takes."""
    size = (bits + 7) // 8
    if spelling == "raw":
        return size
    return 2 * size if spelling != "dec" else len(str((1 << bits) - 1))
