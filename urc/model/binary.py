"""Items of a binary frame, in frame order, for reading and writing.

The loader creates the items from ``struct:`` and resolves every named type. The readers and writers
in `urc.protocol` compile the items. The loader, the readers and the writers share the rules in this
module, such as the naming of nested fields.
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
"""Names that a struct's expressions can use in addition to its items. `_size` is the size of the
whole frame in bytes. `_left` is the number of bytes from the start of the item to the end of the
frame."""
OUTER_NAMES: Final = frozenset(("settings", COUNTERS))
"""Names from outside a named type that the expressions in its items can use."""
WORDS_OF_TYPES: Final = ("bytes", "text")


class Extent(NamedTuple):
    """The size of an item in bytes, or the number of elements of an array."""

    kind: Literal["fixed", "rest", "prefix", "expression"]
    number: int = 0
    """Size in bytes or number of elements, for the kind ``fixed``."""
    prefix: Number | None = None
    """Number type of the length field before the data, for the kind ``prefix``."""
    expression: Template | None = None
    """Formula for the size or number, using earlier items, for the kind ``expression``."""


class Item(NamedTuple):
    """One item of a binary frame, such as a number, a text or a struct."""

    kind: Literal[
        "number", "coded", "packed", "bytes", "text", "padding", "bits", "struct", "switch"
    ]
    """The kind ``coded`` is a number with a special encoding. The kind ``packed`` is an array of
    numbers that are not byte-aligned."""
    id: str = ""
    """Name of the field or argument; "" for a nameless item."""
    number: Number = Number("integer", 8)
    """Number type of a ``number``, or of the number that contains the ``bits``."""
    size: Extent | None = None
    """Size of bytes, text, padding or the section that a struct occupies; None means unlimited."""
    times: Extent | None = None
    """Number of elements of an array. The attribute cannot be named ``count``, because tuples have
    a ``count`` method."""
    condition: Template | None = None
    """Condition under which the item is present; None means always present."""
    const: int | float | bool | bytes | None = None
    """Required raw value; a frame with a different value does not match. None means that any value
    matches."""
    scale: float = 1
    offset: float = 0
    """Number to add after scaling: value = raw · scale + offset."""
    enum: tuple[tuple[int, str], ...] = ()
    """Pairs of a raw number and its word; a number without a word stays a number."""
    valid: tuple[float, float] | None = None
    """Valid range of the scaled value; a value outside the range is a violation."""
    value: Template | None = None
    """Formula for the value to send; None means that the caller provides the value."""
    encoding: str = ""
    """Text encoding; "" means the connection's encoding."""
    pad: int = 0
    """Padding byte for text or bytes that are shorter than the fixed size."""
    until: bytes = b""
    """Terminator of bytes or text without a declared size."""
    trim: int | None = None
    """Padding byte of a trimmed struct. Any number of these bytes may be missing at the end of the
    struct."""
    is_lsb_first: bool = False
    """Whether the first item of ``bits`` contains the least significant bits."""
    items: tuple["Item", ...] = ()
    """Items inside a ``struct``, or the bit fields of ``bits``."""
    switch: "Switch | None" = None

    @property
    def is_given(self) -> bool:
        """Whether the item is a field when reading and an argument when sending."""
        return bool(self.id) and self.const is None and self.value is None


class Switch(NamedTuple):
    """A choice between lists of items, made by an expression over earlier items."""

    by: Template
    cases: tuple[tuple[int | str, tuple[Item, ...]], ...]
    default: tuple[Item, ...] | None = None
    """Items for values without a case; if None, frames with these values do not match."""


def packed_size(number: Number, count: Extent) -> int:
    """Return the size of a packed array, in bytes."""
    return number.bits * count.number // 8


def case_key(text: str) -> int | str:
    """Return a key of ``cases`` as a number or a word: 16 for ``0x10``, ``idle`` for ``idle``."""
    try:
        return int(text, 0)
    except ValueError:
        return text


def joined_name(outer: str, inner: str) -> str:
    """Return the name of field `inner` in the struct `outer`; a private name stays private."""
    if not outer:
        return inner
    if inner.startswith("_") and not outer.startswith("_"):
        return f"_{outer}{inner}"
    return f"{outer}_{inner.lstrip('_')}"


def scope_of(items: tuple[Item, ...]) -> Iterator[Item]:
    """Yield every item in scope, including the items of nameless structs and of cases."""
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
    """Yield the names of all fields, including nested fields, in frame order.

    Args:
        items: the items of a frame or of a struct, in order.
        sent: whether to omit fields whose values URC computes for a sent frame.
    """
    for item in scope_of(items):
        if not item.id or item.const is not None or (sent and item.value is not None):
            continue
        if item.kind == "struct" and item.times is None:
            yield from (joined_name(item.id, name) for name in names_of(item.items, sent=sent))
        else:
            yield item.id


def least_size(items: tuple[Item, ...]) -> int:
    """Return the minimum size of the items, in bytes."""
    return sum(map(_least, items))


def fixed_size(items: tuple[Item, ...]) -> int | None:
    """Return the size of the items in bytes; None for a variable size."""
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
    """Return the formula of each size or count that an item states, keyed by that item's name.

    URC computes sizes and counts from the data to send.
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
    """Yield the items of one scope, including the nameless structs."""
    for item in items:
        yield item
        if item.switch is not None:
            for _, case in item.switch.cases:
                yield from _with_extents(case)
            yield from _with_extents(item.switch.default or ())
        elif item.kind == "struct" and not item.id and item.times is None:
            yield from _with_extents(item.items)
