"""Items of a binary frame, in the order of the frame, for both directions.

The loader makes them from ``struct:`` and resolves every named type. The readers and writers of
`urc.protocol` compile them. The loader and these readers share the rules of this module: names of
nested fields, and items that give the sizes of others.
"""

from collections.abc import Iterator, Mapping
from typing import Final, Literal, NamedTuple

from urc._number_types import Number, number_of, width_of
from urc.expressions import COUNTERS, Template

__all__ = [
    "FRAME_NAMES",
    "OUTER_NAMES",
    "WORDS_OF_TYPES",
    "Extent",
    "Item",
    "Number",
    "Switch",
    "case_key",
    "derived_sizes",
    "fixed_size",
    "joined_name",
    "least_size",
    "names_of",
    "number_of",
    "packed_size",
    "scope_of",
    "width_of",
]

FRAME_NAMES: Final = frozenset(("_size", "_left"))
"""Names that expressions of a struct know besides its items. `_size` has the bytes of the whole
frame, `_left` the bytes from the first byte of the item to the end."""
OUTER_NAMES: Final = frozenset(("settings", COUNTERS))
"""Outer names that the items of a named type may use, too."""
WORDS_OF_TYPES: Final = ("bytes", "text")


class Extent(NamedTuple):
    """A number of units: bytes of a text, or items of an array."""

    kind: Literal["fixed", "rest", "prefix", "expression"]
    number: int = 0
    """Of ``fixed``."""
    prefix: Number | None = None
    """Length field in front of the data, for ``prefix``."""
    expression: Template | None = None
    """Formula over the items before, for ``expression``."""


class Item(NamedTuple):
    """One part of a binary frame."""

    kind: Literal[
        "number", "coded", "packed", "bytes", "text", "padding", "bits", "struct", "switch"
    ]
    """``coded`` numbers have an encoding of their own. ``packed`` arrays ignore byte boundaries."""
    id: str = ""
    """Name of the field or argument; "" for a nameless item."""
    number: Number = Number("integer", 8)
    """Type of a ``number``, or of the container of ``bits``."""
    size: Extent | None = None
    """Size of bytes, text, padding or the window of a struct; None: unlimited."""
    times: Extent | None = None
    """Length of an array. The name ``count`` is taken: every tuple has a method of that name."""
    condition: Template | None = None
    """Condition for the presence of the item."""
    const: int | float | bool | bytes | None = None
    """Required raw value. A frame with another value is another kind of frame."""
    scale: float = 1
    offset: float = 0
    """value = raw · scale + offset"""
    enum: tuple[tuple[int, str], ...] = ()
    """Raw number → word. A number without a word stays a number."""
    valid: tuple[float, float] | None = None
    """Smallest and largest scaled value; a value outside is a violation."""
    value: Template | None = None
    """Value to send when the caller gives none."""
    encoding: str = ""
    """Encoding of text; "" means that of the connection."""
    pad: int = 0
    """Padding byte after text or bytes that are shorter than a fixed size."""
    until: bytes = b""
    """Terminator of bytes or text without a declared size."""
    trim: int | None = None
    """Padding byte that the window of a struct may omit at its end, any number of times."""
    is_lsb_first: bool = False
    """Whether the first one of ``bits`` is the least significant."""
    items: tuple["Item", ...] = ()
    """Items of a ``struct``, or the parts of ``bits``."""
    switch: "Switch | None" = None

    @property
    def is_given(self) -> bool:
        """Whether its value is a field when reading, and an argument when sending."""
        return bool(self.id) and self.const is None and self.value is None


class Switch(NamedTuple):
    """A choice of items by the value of an expression over earlier items."""

    by: Template
    cases: tuple[tuple[int | str, tuple[Item, ...]], ...]
    default: tuple[Item, ...] | None = None
    """Items for any other value; None: another value means another kind of frame."""


def packed_size(number: Number, count: Extent) -> int:
    """Return the size of a packed array, in bytes."""
    return number.bits * count.number // 8


def case_key(text: str) -> int | str:
    """Return a key of ``cases`` as a value: ``0x10`` is 16, ``idle`` a word."""
    try:
        return int(text, 0)
    except ValueError:
        return text


def joined_name(outer: str, inner: str) -> str:
    """Return the name of `inner` in the struct called `outer`; a private name stays private."""
    if not outer:
        return inner
    if inner.startswith("_") and not outer.startswith("_"):
        return f"_{outer}{inner}"
    return f"{outer}_{inner.lstrip('_')}"


def scope_of(items: tuple[Item, ...]) -> Iterator[Item]:
    """Yield every item whose id is in scope, including those of nameless structs and cases."""
    for item in items:
        if item.switch is not None:
            for _, case in item.switch.cases:
                yield from scope_of(case)
            yield from scope_of(item.switch.default or ())
        elif item.kind == "struct" and not item.id:
            yield from scope_of(item.items)
        elif item.kind == "bits":
            yield from (part._replace(id=joined_name(item.id, part.id)) for part in item.items)
        else:
            yield item


def names_of(items: tuple[Item, ...], *, sent: bool = False) -> Iterator[str]:
    """Yield the names of all fields, nested ones included, in the order of the frame.

    Args:
        items: items of one level.
        sent: leave out the values that URC computes when it sends.
    """
    for item in scope_of(items):
        if not item.id or item.const is not None or (sent and item.value is not None):
            continue
        if item.kind == "struct" and item.times is None:
            yield from (joined_name(item.id, name) for name in names_of(item.items, sent=sent))
        else:
            yield item.id


def least_size(items: tuple[Item, ...]) -> int:
    """Return the least number of bytes that the items take."""
    return sum(map(_least, items))


def fixed_size(items: tuple[Item, ...]) -> int | None:
    """Return the number of bytes of the items; None when it varies."""
    sizes = [_fixed(item) for item in items]
    return None if None in sizes else sum(size for size in sizes if size)


def _fixed(item: Item) -> int | None:
    if item.kind == "coded" and item.number.is_variable:
        return None
    extents = [extent for extent in (item.size, item.times) if extent is not None]
    if item.condition is not None or item.switch is not None or item.until:
        return None
    if item.trim is not None or any(extent.kind != "fixed" for extent in extents):
        return None
    if item.kind == "struct" and item.size is None and fixed_size(item.items) is None:
        return None
    if item.kind in ("bytes", "text") and item.size is None:
        return None
    return _least(item)


def _least(item: Item) -> int:
    if item.condition is not None or item.switch is not None:
        return 0
    if item.times is not None:
        prefix = item.times.prefix.size if item.times.prefix else 0
        if item.times.kind != "fixed":
            return prefix
        if item.kind == "packed":
            return packed_size(item.number, item.times)
        return item.times.number * _least(item._replace(times=None))
    if item.kind in ("number", "coded", "bits"):
        return item.number.size
    if item.size is not None:
        if item.size.kind == "fixed" and item.trim is None:
            return item.size.number
        return item.size.prefix.size if item.size.prefix else 0
    return least_size(item.items) if item.kind == "struct" else len(item.until)


def derived_sizes(items: tuple[Item, ...]) -> Mapping[str, Template]:
    """Return the items that hold the size or count of a later one → formula in that later item.

    When a frame is sent, URC computes their values from the data.
    """
    given = {
        one.id
        for one in scope_of(items)
        if one.kind == "number" and one.is_given and one.number.kind == "integer"
    }
    found: dict[str, Template] = {}
    for item in _with_extents(items):
        for extent in (item.size, item.times):
            if extent is None or extent.expression is None:
                continue
            (name, *others) = extent.expression.names or ("",)
            if not others and name in given:
                found.setdefault(name, extent.expression)
    return found


def _with_extents(items: tuple[Item, ...]) -> Iterator[Item]:
    """Yield the items of one scope, the nameless structs themselves included."""
    for item in items:
        yield item
        if item.switch is not None:
            for _, case in item.switch.cases:
                yield from _with_extents(case)
            yield from _with_extents(item.switch.default or ())
        elif item.kind == "struct" and not item.id and item.times is None:
            yield from _with_extents(item.items)
