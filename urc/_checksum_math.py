"""Parameters of checksum algorithms, and functions that compute checksums of bytes.

`zlib` and `binascii` compute the CRCs in `_BUILT_IN`, and `anycrc` computes all other CRCs. A sum
or XOR checksum needs only one call to a C function.
"""

import binascii
import operator
import zlib
from collections.abc import Callable, Iterable, Mapping
from functools import cache, reduce
from itertools import accumulate
from typing import Any, Final, Literal, NamedTuple

__all__ = [
    "FOLDED",
    "NAMED",
    "PLAIN_CHECKSUMS",
    "CrcSpec",
    "FoldSpec",
    "algorithm_of",
    "algorithm_names",
    "build_algorithm",
    "sum_of",
]

Compute = Callable[[bytes], int]
MAX_BYTES: Final = 65536


class CrcSpec(NamedTuple):
    """The Rocksoft parameters of a cyclic redundancy check (CRC)."""

    width: int
    poly: int
    init: int = 0
    refin: bool = False
    refout: bool = False
    xorout: int = 0


class FoldSpec(NamedTuple):
    """Parameters of a checksum that adds or XORs all numbers in the data."""

    operation: Literal["sum", "xor"]
    bits: int = 8
    """Width of the checksum, in bits."""
    of: int = 8
    """Width of the numbers in bits; the last number is padded with zeros."""
    complement: Literal["none", "ones", "twos"] = "none"
    mask: int | None = None
    """Mask that selects the bits of the result; None selects all bits."""
    added: int = 0
    """Number to add to the result after masking."""
    ored: int = 0
    """Bits that the last step sets to 1 in the result."""
    is_odd_xored: bool = False
    """Whether a trailing byte that does not fill a whole number is XORed into the result."""


FOLDED: Final = {
    "sum8": FoldSpec("sum"),
    "sum16": FoldSpec("sum", 16),
    "sum32": FoldSpec("sum", 32),
    "xor8": FoldSpec("xor"),
    "lrc": FoldSpec("sum", complement="twos"),
}
"""Parameters of common sum and XOR checksums, by name."""
PLAIN_CHECKSUMS: Final = {
    "adler32": 32,
    "fletcher8": 8,
    "fletcher16": 16,
    "fletcher16-mod256": 16,
    "fletcher32": 32,
    "internet": 16,
}
"""Result width, in bits, of each algorithm without parameters, by name."""


def algorithm_of(name: str) -> CrcSpec | FoldSpec | str | None:
    """Return the checksum algorithm with this name; None for an unknown name."""
    if name in PLAIN_CHECKSUMS:
        return name
    if name in FOLDED:
        return FOLDED[name]
    from anycrc import aliases, models  # takes 14 ms, so only drivers with a CRC import it

    upper = name.upper()
    model = models.get(aliases.get(upper, upper)) if name == name.lower() else None
    return None if model is None else CrcSpec(*model[:6])


def algorithm_names() -> Iterable[str]:
    """Return the names of all checksum algorithms."""
    from anycrc import aliases, models

    return {one.lower() for one in (*models, *aliases)} | FOLDED.keys() | PLAIN_CHECKSUMS.keys()


@cache  # there are few algorithm names
def _named(name: str) -> Compute:
    algorithm = algorithm_of(name)
    if algorithm is None:
        raise ValueError(f"there is no checksum {name[:40]!r}")
    return build_algorithm(algorithm)


def sum_of(value: Any, name: Any) -> int:
    """Return the checksum of bytes, or of text as UTF-8."""
    data = value.encode("utf-8", "surrogatepass") if isinstance(value, str) else value
    if not isinstance(data, bytes):
        raise TypeError(f"expected text or bytes, found {repr(value)[:40]}")
    if len(data) > MAX_BYTES:
        raise ValueError(f"the text has more than {MAX_BYTES} bytes")
    if not isinstance(name, str):
        raise TypeError(f"expected the name of a checksum, found {repr(name)[:40]}")
    return _named(name)(data)


def build_algorithm(spec: CrcSpec | FoldSpec | str, *, is_big: bool = True) -> Compute:
    """Return a function that computes the checksum of bytes.

    Args:
        spec: parameters or name of the checksum algorithm.
        is_big: whether numbers are big-endian; without effect on numbers of one byte.
    """
    if isinstance(spec, str):
        return NAMED[spec]
    if isinstance(spec, FoldSpec):
        return _fold(spec, is_big)
    builtin = _BUILT_IN.get(spec)
    if builtin is not None:
        return builtin
    from anycrc import CRC  # takes 14 ms, so only drivers with another CRC import it

    compute: Compute = CRC(*spec).calc
    return compute


def _fold(spec: FoldSpec, is_big: bool) -> Compute:
    full = (1 << spec.bits) - 1
    mask = full if spec.mask is None else spec.mask & full
    flip, minus = spec.complement == "ones", spec.complement == "twos"
    is_sum, size, order = spec.operation == "sum", spec.of // 8, "big" if is_big else "little"
    is_odd_xored = spec.is_odd_xored

    def compute(data: bytes) -> int:
        last = 0
        if is_odd_xored and len(data) % size:
            data, last = data[:-1], data[-1]
        numbers = data if size == 1 else _numbers(data, size, order)
        value = sum(numbers) if is_sum else reduce(operator.xor, numbers, 0)
        if flip:
            value = ~value
        elif minus:
            value = -value
        return (value & mask) + spec.added & full ^ last | spec.ored

    return compute


def _numbers(data: bytes, size: int, order: str) -> list[int]:
    filled = data + bytes(-len(data) % size)
    is_big = order == "big"
    return [
        int.from_bytes(filled[place : place + size], "big" if is_big else "little")
        for place in range(0, len(filled), size)
    ]


def _fletcher(modulus: int, bits: int, size: int = 1) -> Compute:
    """Return the Fletcher checksum of little-endian numbers of `size` bytes each."""

    def compute(data: bytes) -> int:
        numbers = data if size == 1 else _numbers(data, size, "little")
        second = sum(accumulate(numbers))
        return second % modulus << bits | sum(numbers) % modulus

    return compute


def _internet(data: bytes) -> int:
    """Return the checksum of RFC 1071: the ones' complement of the ones' complement sum."""
    total = sum(_numbers(data, 2, "big"))
    while total > 0xFFFF:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


NAMED: Final[Mapping[str, Compute]] = {
    "adler32": zlib.adler32,
    "fletcher8": _fletcher(15, 4),
    "fletcher16": _fletcher(255, 8),
    "fletcher16-mod256": _fletcher(256, 8),
    "fletcher32": _fletcher(65535, 16, 2),
    "internet": _internet,
}
"""Functions for the checksum algorithms without parameters, by algorithm name."""

_BUILT_IN: Final[Mapping[CrcSpec, Compute]] = {
    CrcSpec(32, 0x04C11DB7, 0xFFFFFFFF, True, True, 0xFFFFFFFF): zlib.crc32,
    CrcSpec(16, 0x1021): lambda data: binascii.crc_hqx(data, 0),
    CrcSpec(16, 0x1021, 0xFFFF): lambda data: binascii.crc_hqx(data, 0xFFFF),
}
