"""A binary frame that is being written, and the places in it that are filled in later.

Floor 3, pure.
"""

from typing import Any, NamedTuple

from urc.expressions import Template
from urc.model.binary import Item, Number
from urc.protocol.forms import NotWritable
from urc.protocol.struct_value import number_reader, number_writer, raw_of

__all__ = ["GAP", "LARGEST_FRAME", "Gap", "Pen", "Scope"]

Scope = dict[str, Any]
LARGEST_FRAME = 1 << 20
"""Bytes; as the longest frame of a framing."""


GAP = "gap of "
"""In front of an item's id, which has no space: key of its gap in a scope."""


class Gap(NamedTuple):
    """A number that is filled in later."""

    at: int
    item: Item
    container: Number
    """The bytes that it lies in, at `shift`."""
    shift: int = 0


class Pen:
    """A frame that is being written."""

    __slots__ = ("bytes", "late")

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.late: list[tuple[Gap, Template, Scope]] = []
        """Computed items that need the whole frame."""

    def put(self, data: bytes) -> None:
        """Add bytes; raise `NotWritable` when there are too many."""
        if len(self.bytes) + len(data) > LARGEST_FRAME:
            raise NotWritable(f"the frame would have more than {LARGEST_FRAME} bytes")
        self.bytes += data

    def fill(self, gap: Gap, value: object) -> None:
        """Write `value` into a gap."""
        raw = raw_of(gap.item)(value)
        container, end = gap.container, gap.at + gap.container.size
        if end > len(self.bytes):
            raise NotWritable(f"{gap.item.id or 'a computed number'}: it was trimmed away")
        if container != gap.item.number:
            mask = (1 << gap.item.number.bits) - 1
            raw = number_reader(container)(bytes(self.bytes), gap.at) | (raw & mask) << gap.shift
        self.bytes[gap.at : end] = number_writer(container, gap.item.id)(raw)
