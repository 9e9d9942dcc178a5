"""Number types in binary data, such as ``u16be``, ``bcd24le`` or ``f32cdab``.

``struct:`` items and expression filters use the same type names.
"""

import re
from typing import Final, Literal, NamedTuple

__all__ = ["NUMBER_NAMES", "Number", "number_of", "width_of"]

_NUMBER = re.compile(r"(?:([ui]|bcd)(8|16|24|32|40|48|56|64)|f(16|32|64))(be|le)?")
_SWAPPED = re.compile(r"([uif])(?:32(cdab|badc)|64(ghefcdab|badcfehg))")
_SEPTETS = re.compile(r"([ui])(14|21|28|35|42|49|56|63)by7(be|le)")
_WIDTH = re.compile(r"([ui])([1-9]|[1-5][0-9]|6[0-3])")


class Number(NamedTuple):
    """The encoding of a number in bytes or bits."""

    kind: Literal["integer", "float", "boolean", "varint", "zigzag", "bcd"]
    bits: int
    """Width of the number in bits.

    The width is 1 to 64 in ``bits:`` and packed arrays, and 14 to 63 in steps of 7 with
    `is_by_seven`. Otherwise, the width is 8 to 64 in steps of 8.
    """
    is_signed: bool = False
    endian: Literal["big", "little"] = "big"
    are_words_swapped: bool = False
    """Whether the 16-bit words are in reverse order; `endian` is the byte order within each word.
    """
    is_by_seven: bool = False
    """Whether each byte contains seven bits of the number below a zero bit."""

    @property
    def size(self) -> int:
        """Size of the number in bytes, or minimum size of a variable-size number."""
        if self.is_by_seven:
            return self.bits // 7
        return 1 if self.is_variable else self.bits // 8

    @property
    def is_coded(self) -> bool:
        """Whether the encoding is varint, BCD, swapped words or seven bits per byte."""
        is_odd = self.is_variable or self.kind == "bcd"
        return is_odd or self.are_words_swapped or self.is_by_seven

    @property
    def is_variable(self) -> bool:
        """Whether the size of the number depends on its value."""
        return self.kind in ("varint", "zigzag")

    @property
    def least(self) -> int:
        """Smallest whole number that this type can represent."""
        return -(1 << self.bits - 1) if self.is_signed else 0

    @property
    def most(self) -> int:
        """Largest whole number that this type can represent."""
        if self.kind == "boolean":
            return 1
        if self.kind == "bcd":
            return int(10 ** (self.bits // 4)) - 1
        return (1 << self.bits - self.is_signed) - 1


def number_of(name: str) -> Number | None:
    """Return the number type of a name such as ``u16be``; None for an invalid name."""
    if name == "bool":
        return Number("boolean", 8)
    if name in ("varint", "zigzag"):
        return Number("zigzag" if name == "zigzag" else "varint", 64, name == "zigzag")
    found = _NUMBER.fullmatch(name)
    if found is None:
        return _odd_number(name)
    bits = int(found[2] or found[3])
    if (bits == 8) == bool(found[4]):
        return None
    kind: Literal["integer", "float", "bcd"] = "integer" if found[1] else "float"
    if found[1] == "bcd":
        kind = "bcd"
    return Number(kind, bits, found[1] not in ("u", "bcd"), "little" if found[4] == "le" else "big")


def _odd_number(name: str) -> Number | None:
    """Return the number type for a name such as ``f32cdab`` or ``u14by7le``; None for others."""
    found = _SWAPPED.fullmatch(name)
    if found is not None:
        letters: str = found[2] or found[3]
        kind: Literal["integer", "float"] = "float" if found[1] == "f" else "integer"
        endian: Literal["big", "little"] = "little" if letters.startswith("b") else "big"
        # In "badc", the words are in normal order and each word has its low byte first, so the
        # reverse is little-endian.
        return Number(kind, 8 * len(letters), found[1] == "i", endian, are_words_swapped=True)
    found = _SEPTETS.fullmatch(name)
    if found is None:
        return None
    order: Literal["big", "little"] = "little" if found[3] == "le" else "big"
    return Number("integer", int(found[2]), found[1] == "i", order, is_by_seven=True)


def width_of(name: str) -> Number | None:
    """Return the type of a packed array's numbers, such as ``u11``; None for an unknown name."""
    found = _WIDTH.fullmatch(name)
    return None if found is None else Number("integer", int(found[2]), found[1] == "i")


def _names() -> tuple[str, ...]:
    sizes = (16, 24, 32, 40, 48, 56, 64)
    plain = [f"{kind}{bits}{order}" for kind in ("u", "i", "bcd") for bits in sizes
             for order in ("be", "le")]  # fmt: skip
    floats = [f"f{bits}{order}" for bits in (16, 32, 64) for order in ("be", "le")]
    swapped = [
        f"{kind}{letters}"
        for kind in "uif"
        for letters in ("32cdab", "32badc", "64ghefcdab", "64badcfehg")
    ]
    septets = [f"{kind}{bits}by7{order}" for kind in "ui" for bits in range(14, 64, 7)
               for order in ("be", "le")]  # fmt: skip
    words = ["u8", "i8", "bcd8", "bool", "varint", "zigzag"]
    return (*words, *plain, *floats, *swapped, *septets)


NUMBER_NAMES: Final = _names()
"""Names of all number types, valid for `number_of`."""
