"""What is in a binary frame: its items, in the order of the frame, for both directions.

The loader makes them out of ``struct:`` with every named type put in its place; the readers and
writers of `urc.protocol` compile them. Whatever both must agree on stands here: how the fields of
a nested struct are called, and which items are the sizes of others.
"""

from collections.abc import Iterator, Mapping
from typing import Final, Literal, NamedTuple

from urc._numbers import Number, number_of, width_of
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
"""Names that expressions of a struct know beside its items: the bytes of the whole frame, and the
bytes from the item's own first one to the end."""
OUTER_NAMES: Final = frozenset(("settings", COUNTERS))
"""Names that the values of a type's items know although they stand outside of it."""
WORDS_OF_TYPES: Final = ("bytes", "text")


class Extent(NamedTuple):
    """How many: bytes of a text, items of an array."""

    kind: Literal["fixed", "rest", "prefix", "expression"]
    number: int = 0
    """Of ``fixed``."""
    prefix: Number | None = None
    """Of ``prefix``: the number that stands in front of it."""
    expression: Template | None = None
    """Of ``expression``: over the items before."""


class Item(NamedTuple):
    """One part of a frame."""

    kind: Literal[
        "number", "coded", "packed", "bytes", "text", "padding", "bits", "struct", "switch"
    ]
    """``coded`` are numbers that are no plain bytes, ``packed`` arrays that heed no bytes."""
    id: str = ""
    """Name of the field or argument; "" for what has none."""
    number: Number = Number("integer", 8)
    """Of ``number``, and the container of ``bits``."""
    size: Extent | None = None
    """Of bytes, text, padding; the window of a struct; None when nothing limits it."""
    times: Extent | None = None
    """Of an array: how many follow each other (``count`` is taken: it is every tuple's)."""
    condition: Template | None = None
    """It is there only when this holds."""
    const: int | float | bool | bytes | None = None
    """What must stand here, raw; another value means that the frame is another one."""
    scale: float = 1
    offset: float = 0
    """value = raw · scale + offset"""
    enum: tuple[tuple[int, str], ...] = ()
    """Raw number → word. A number without a word stays a number."""
    valid: tuple[float, float] | None = None
    """Smallest and largest value, scaled; what is outside is a fault."""
    value: Template | None = None
    """What to send, where nobody gives it."""
    encoding: str = ""
    """Of text; "" means the line's."""
    pad: int = 0
    """Byte that fills fixed sizes: behind text and bytes that are shorter."""
    until: bytes = b""
    """What ends bytes or text whose size nobody says."""
    trim: int | None = None
    """A struct's window may leave out this byte at its end, as often as it likes."""
    is_lsb_first: bool = False
    """Of ``bits``: the first one is the least significant."""
    items: tuple["Item", ...] = ()
    """Of ``struct``, and the parts of ``bits``."""
    switch: "Switch | None" = None

    @property
    def is_given(self) -> bool:
        """Whether its value is a field when reading, and comes from outside when sending."""
        return bool(self.id) and self.const is None and self.value is None


class Switch(NamedTuple):
    """What follows depends on what came before."""

    by: Template
    cases: tuple[tuple[int | str, tuple[Item, ...]], ...]
    default: tuple[Item, ...] | None = None
    """None: the frame is another one."""


def packed_size(number: Number, count: Extent) -> int:
    """Return the bytes of a packed array."""
    return number.bits * count.number // 8


def case_key(text: str) -> int | str:
    """Return the key of a case as it is compared: ``0x10`` is 16, ``idle`` a word."""
    try:
        return int(text, 0)
    except ValueError:
        return text


def joined_name(outer: str, inner: str) -> str:
    """Return the name of `inner` in the struct called `outer`; a private one stays private."""
    if not outer:
        return inner
    if inner.startswith("_") and not outer.startswith("_"):
        return f"_{outer}{inner}"
    return f"{outer}_{inner.lstrip('_')}"


def scope_of(items: tuple[Item, ...]) -> Iterator[Item]:
    """Yield every item whose id is known to the others: those of nameless structs and cases too."""
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
        items: of one level.
        sent: leave out what is computed when sending, which nobody gives.
    """
    for item in scope_of(items):
        if not item.id or item.const is not None or (sent and item.value is not None):
            continue
        if item.kind == "struct" and item.times is None:
            yield from (joined_name(item.id, name) for name in names_of(item.items, sent=sent))
        else:
            yield item.id


def least_size(items: tuple[Item, ...]) -> int:
    """Return the bytes that the items take at least."""
    return sum(map(_least, items))


def fixed_size(items: tuple[Item, ...]) -> int | None:
    """Return the bytes that the items always take; None when it depends."""
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
    """Return the items that are the size or count of a later one → how that one says it.

    When sending they are filled in from what they count.
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
