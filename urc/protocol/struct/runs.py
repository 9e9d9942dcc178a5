"""Runs of fixed struct items, each unpacked by one `struct.Struct`.

Pure. The generators `urc.protocol.struct.read_source` and `urc.protocol.struct.write_source` use
the runs.
"""

from collections.abc import Iterator
from struct import Struct
from typing import Literal, NamedTuple

from urc._number_codec import format_of
from urc.model.binary import Item, joined_name
from urc.protocol.struct.read import BitPart, bit_parts

__all__ = ["FixedField", "FixedRun", "runs_of"]

MOST_IN_A_RUN = 256
"""Maximum number of values in one `struct.Struct`; closures read longer arrays."""


class FixedField(NamedTuple):
    """An item of fixed size in a run, with its field name and format characters."""

    item: Item
    name: str
    """Name of the field, including the names of outer structs; "" if the item has no field."""
    outer: str
    """Names of the outer structs, joined to one prefix; "" outside structs."""
    code: str
    """Format characters for `struct`; "x" means that the item has no value."""
    endian: Literal["", "big", "little"] = ""
    values: int = 1

    def bit_parts(self) -> list[BitPart]:
        """Return the parts of a ``bits`` item with their field names."""
        outer = self.outer
        return [
            (part._replace(id=joined_name(outer, part.id) if part.id else ""), at, mask, sign, told)
            for part, at, mask, sign, told in bit_parts(self.item)
        ]


class FixedRun(NamedTuple):
    """A run of consecutive fixed items with the same byte order."""

    leaves: tuple[FixedField, ...]

    @property
    def struct(self) -> Struct:
        """The `struct.Struct` that unpacks the run."""
        endian = next((leaf.endian for leaf in self.leaves if leaf.endian), "big")
        codes = "".join(leaf.code for leaf in self.leaves)
        return Struct(("<" if endian == "little" else ">") + codes)


def _leaves(item: Item, outer: str) -> list[FixedField] | None:
    """Return the parts of a fixed item; None for other items."""
    if item.condition is not None or item.switch is not None:
        return None
    name = joined_name(outer, item.id) if item.id else ""
    number = item.number
    if item.kind == "struct":
        if item.times is not None or item.size is not None:
            return None
        return _all_leaves(item.items, name or outer)
    if item.kind in ("number", "bits"):
        code = format_of(number) or f"{number.size}s"
        count = 1
        if item.times is not None:
            count = item.times.number
            if item.times.kind != "fixed" or count > MOST_IN_A_RUN or not format_of(number):
                return None
            code = f"{count}{code}"
        is_ordered = number.size > 1 and bool(format_of(number))
        return [FixedField(item, name, outer, code, number.endian if is_ordered else "", count)]
    if item.times is not None or item.until or item.size is None or item.size.kind != "fixed":
        return None
    if item.kind == "padding":
        return [FixedField(item, "", outer, f"{item.size.number}x", values=0)]
    return [FixedField(item, name, outer, f"{item.size.number}s")]


def _all_leaves(items: tuple[Item, ...], outer: str) -> list[FixedField] | None:
    found: list[FixedField] = []
    for item in items:
        leaves = _leaves(item, outer)
        if leaves is None:
            return None
        found += leaves
    return found


def runs_of(items: tuple[Item, ...]) -> Iterator[FixedRun | Item]:
    """Yield the runs of fixed items and all other items, in order."""
    run: list[FixedField] = []
    endian = ""
    for item in items:
        leaves = _leaves(item, "")
        for leaf in leaves or ():
            if run and leaf.endian and endian and leaf.endian != endian:
                yield FixedRun(tuple(run))
                run = []
            if not run:
                endian = ""
            endian = leaf.endian or endian
            run.append(leaf)
        if leaves is None:
            if run:
                yield FixedRun(tuple(run))
            run, endian = [], ""
            yield item
    if run:
        yield FixedRun(tuple(run))
