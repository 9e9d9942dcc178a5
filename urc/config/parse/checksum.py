"""Parser for checksums: algorithm, range of bytes, and declared position.

The framing resolves positions that depend on the rest of the frame, such as `at: end` or `over:
payload`.
"""

from typing import Any, Final, NamedTuple

from urc._checksum_math import algorithm_names, algorithm_of
from urc.config.node import Node, Problems
from urc.config.parse.bytes import parse_bytes
from urc.config.spelling_suggestions import did_you_mean
from urc.model.framing import (
    PLAIN_CHECKSUMS,
    ByteRange,
    CrcSpec,
    FoldSpec,
    Salt,
    Spelling,
    spelt_size,
)

__all__ = ["DeclaredChecksum", "parse_checksum", "values_of"]


_TRAIL_KEYS: Final = frozenset(("after", "each", "leading_zeros", "optional", "skip"))
_NEEDED: Final = {
    "after": "such as after: '*', for a mark before the checksum",
    "each": "such as each: LF, for a checksum of each line",
}


class DeclaredTrailer(NamedTuple):
    """The declared position of a checksum after text or after each line of the text."""

    mark: bytes
    is_padded: bool
    is_optional: bool
    each: bytes
    skip: int


class DeclaredChecksum(NamedTuple):
    """A declared checksum, whose position the framing has yet to resolve."""

    part: Node
    algorithm: CrcSpec | FoldSpec | str
    bits: int
    over: ByteRange | str
    """Covered bytes: ``payload``, ``frame``, or a range of the frame."""
    at: int | None
    """Index of the first checksum byte in the frame; None for the end of the frame."""
    is_big: bool
    spelling: Spelling
    salt: Salt
    is_from_hex: bool
    closes: bool
    before: bytes
    trailer: "DeclaredTrailer | None" = None
    """Position of a checksum that follows variable-length text; None for a fixed position."""

    @property
    def size(self) -> int:
        """Size of the checksum in the frame, in bytes."""
        return spelt_size(self.bits, self.spelling)


def parse_checksum(part: Node, encoding: str, problems: Problems) -> DeclaredChecksum | None:
    """Return the checksum at `part`; None if a problem was reported."""
    algorithm = _algorithm(part.must("algorithm"), problems)
    salt = _salt(part.get("salt"), encoding, problems)
    over, at = part.get("over"), part.get("at")
    window: ByteRange | str = "payload"
    if over is not None:
        window = str(over.data) if isinstance(over.data, str) else _window(over, problems)
    spelling: Any = part.text("as", "raw")
    is_big = part.text("endian", "big") == "big"
    is_from_hex = part.flag("from_hex", default=False)
    closes = part.text("on_error", "drop") == "close"
    before = parse_bytes(part.get("before"), encoding, problems)
    trailer = _trailer(part, encoding, problems) if _TRAIL_KEYS & part.data.keys() else None
    if algorithm is None or salt is None:
        return None
    place = None if at is None or isinstance(at.data, str) else int(at.data)
    return DeclaredChecksum(
        part,
        algorithm,
        _bits(algorithm),
        window,
        place,
        is_big,
        spelling,
        salt,
        is_from_hex,
        closes,
        before or b"",
        trailer,
    )


def values_of(algorithm: CrcSpec | FoldSpec | str) -> frozenset[int]:
    """Return the byte values that a binary checksum may contain."""
    every = range(256)
    if not isinstance(algorithm, FoldSpec) or algorithm.bits != 8:
        return frozenset(every)
    mask = 0xFF if algorithm.mask is None else algorithm.mask
    return frozenset((one & mask) + algorithm.added & 0xFF | algorithm.ored for one in every)


def _trailer(part: Node, encoding: str, problems: Problems) -> DeclaredTrailer | None:
    """Return the trailer that the checksum at `part` declares; None for a fixed position."""
    mark = parse_bytes(part.get("after"), encoding, problems) or b""
    each = parse_bytes(part.get("each"), encoding, problems) or b""
    for key, bytes_found in (("after", mark), ("each", each)):
        if key in part.data and part.data[key] in ("", []):
            problems.error(part, "empty-mark", f"'{key}' is empty, so it marks nothing", at=key)
            return None
        if bytes_found and isinstance(part.data.get("at", "end"), int):
            text = f"'at' has no effect with '{key}', which sets the position of the checksum"
            problems.error(part, "misplaced-key", text, at="at", key=True)
    needs = {"optional": "after", "skip": "each", "leading_zeros": "after"}
    for key, needed in needs.items():
        if key in part.data and needed not in part.data:
            text = f"'{key}' needs '{needed}'"
            hint = _NEEDED[needed]
            problems.error(part, "misplaced-key", text, at=key, key=True, hint=hint)
    is_padded = part.flag("leading_zeros", default=True)
    if not is_padded and part.text("as", "raw") == "raw":
        text = "a binary checksum has no leading zeros"
        hint = "add 'as: dec', or 'as: hex'"
        problems.error(part, "misplaced-key", text, at="leading_zeros", key=True, hint=hint)
    if not mark and not each:
        return None
    return DeclaredTrailer(
        mark, is_padded, part.flag("optional", default=False), each, part.integer("skip") or 0
    )


def _bits(algorithm: CrcSpec | FoldSpec | str) -> int:
    if isinstance(algorithm, str):
        return PLAIN_CHECKSUMS[algorithm]
    return algorithm.width if isinstance(algorithm, CrcSpec) else algorithm.bits


def _algorithm(part: Node, problems: Problems) -> CrcSpec | FoldSpec | str | None:
    if isinstance(part.data, str):
        return _named(part, problems)
    return _fold(part, problems) if "fold" in part.data else _crc(part, problems)


def _named(part: Node, problems: Problems) -> CrcSpec | FoldSpec | str | None:
    name: str = part.data
    algorithm = algorithm_of(name)
    if algorithm is not None:
        return algorithm
    hint = did_you_mean(name, algorithm_names())
    if not hint.startswith("did you mean"):
        hint = "for example crc16-modbus, crc32, sum8, xor8, lrc; or give 'width' and 'poly'"
    problems.error(part, "unknown-checksum", f"unknown checksum {name!r}", hint=hint)
    return None


def _crc(part: Node, problems: Problems) -> CrcSpec | None:
    width = part.integer("width") or 8
    numbers = {name: part.integer(name) or 0 for name in ("poly", "init", "xorout")}
    refin, refout = part.flag("refin", default=False), part.flag("refout", default=False)
    is_good = True
    for name, number in numbers.items():
        if number >> width:
            is_good = False
            problems.error(
                part,
                "too-wide",
                f"0x{number:X} has more than {width} bits",
                at=name,
                hint="omit the highest bit of the polynomial" if name == "poly" else "",
            )
    if not is_good:
        return None
    return CrcSpec(width, numbers["poly"], numbers["init"], refin, refout, numbers["xorout"])


def _fold(part: Node, problems: Problems) -> FoldSpec | None:
    operation, complement = part.text("fold"), part.text("complement", "none")
    bits, of = part.integer("bits") or 8, part.integer("of") or 8
    mask, ored = part.integer("mask"), part.integer("or") or 0
    added = part.integer("add") or 0
    is_good = True
    for name, number in (("mask", mask or 0), ("add", added), ("or", ored)):
        if number >> bits:
            is_good = False
            text = f"0x{number:X} has more than {bits} bits"
            problems.error(part, "too-wide", text, at=name)
    if operation == "xor" and of > bits:
        is_good = False
        text = f"numbers of {of} bits do not fit into a result of {bits} bits"
        problems.error(part, "too-wide", text, at="of")
    is_odd_xored = part.text("odd", "zeros") == "xor"
    if "odd" in part.data and of == 8:
        is_good = False
        text = "'odd' needs numbers of more than one byte"
        problems.error(part, "misplaced-key", text, at="odd", key=True, hint="add 'of: 16'")
    if not is_good:
        return None
    return FoldSpec(
        "sum" if operation == "sum" else "xor",
        bits,
        of,
        "ones" if complement == "ones" else "twos" if complement == "twos" else "none",
        mask,
        added,
        ored,
        is_odd_xored,
    )


def _window(part: Node, problems: Problems) -> ByteRange | str:
    start, stop = part.integer("from") or 0, part.integer("to")
    if stop is not None and (start < 0) == (stop < 0) and start >= stop:
        problems.error(
            part,
            "empty-window",
            f"the range from {start} to {stop} is empty",
            hint="positions start at 0; negative positions count back from the end of the frame",
        )
        return "payload"
    return ByteRange(start, stop)


def _salt(part: Node | None, encoding: str, problems: Problems) -> Salt | None:
    if part is None:
        return Salt()
    if not isinstance(part.data, dict):
        constant = parse_bytes(part, encoding, problems)
        return None if constant is None else Salt(constant)
    rows: dict[int, bytes] = {}
    is_good = True
    for name, inner in part.must("table").entries().items():
        row = parse_bytes(inner, encoding, problems)
        if row is None:
            is_good = False
        else:
            rows[int(name, 0)] = row
    offset, size = part.integer("offset") or 0, part.integer("size") or 1
    is_big = part.text("endian", "big") == "big"
    otherwise: Any = part.text("else", "fault")
    return Salt(b"", offset, size, is_big, rows, otherwise) if is_good else None
