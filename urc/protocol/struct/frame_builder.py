"""A builder for binary frames; it leaves gaps for numbers that are computed later. Pure."""

from typing import Any, NamedTuple

from urc._number_codec import plain_reader
from urc.expressions import ExpressionError, Template
from urc.model.binary import Item, Number
from urc.protocol.struct.value import number_writer, raw_of
from urc.protocol.values.payload import NotWritable

__all__ = ["GAP", "LARGEST_FRAME", "Backpatch", "FrameBuilder", "Scope", "evaluate", "solved"]

Scope = dict[str, Any]
LARGEST_FRAME = 1 << 20
"""Maximum size of a frame in bytes, equal to the framings' limit."""


GAP = "gap of "
"""Prefix that a gap's key has in the scope, before the item's id; no id contains a space."""


class Backpatch(NamedTuple):
    """A gap in the frame for a number that is computed later."""

    at: int
    item: Item
    container: Number
    """Type of the enclosing number, which contains the missing number at bit `shift`."""
    shift: int = 0


class FrameBuilder:
    """A binary frame under construction."""

    __slots__ = ("bytes", "late")

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.late: list[tuple[Backpatch, Template, Scope]] = []
        """Gaps for computed items that depend on the size of the whole frame."""

    def append(self, data: bytes) -> None:
        """Append bytes; raise `NotWritable` if the frame becomes too long."""
        if len(self.bytes) + len(data) > LARGEST_FRAME:
            raise NotWritable(f"the frame would have more than {LARGEST_FRAME} bytes")
        self.bytes += data

    def insert(self, at: int, data: bytes, scope: Scope) -> None:
        """Insert bytes at offset `at` and move later gaps."""
        self.bytes[at:at] = data
        self.late = [(_moved(gap, at, len(data)), one, inner) for gap, one, inner in self.late]
        for name, value in scope.items():
            if isinstance(value, Backpatch):
                scope[name] = _moved(value, at, len(data))

    def fill(self, gap: Backpatch, value: object) -> None:
        """Write `value` into a gap; raise `NotWritable` if impossible."""
        raw = raw_of(gap.item)(value)
        container, end = gap.container, gap.at + gap.container.size
        if end > len(self.bytes):
            raise NotWritable(f"{gap.item.id or 'a computed number'}: its bytes were trimmed")
        if container != gap.item.number:
            mask = (1 << gap.item.number.bits) - 1
            raw = plain_reader(container)(bytes(self.bytes), gap.at) | (raw & mask) << gap.shift
        self.bytes[gap.at : end] = number_writer(container, gap.item.id)(raw)


def _moved(gap: Backpatch, at: int, by: int) -> Backpatch:
    return gap._replace(at=gap.at + by) if gap.at >= at else gap


def evaluate(template: Template, scope: Scope) -> Any:
    """Evaluate an expression in a scope; raise `NotWritable` on an error."""
    try:
        return template.evaluate(scope)
    except ExpressionError as error:
        raise NotWritable(str(error)) from None


def solved(expression: Template, only: str, number: int, name: str) -> int:
    """Return the value of the variable `only` at which the linear `expression` equals `number`."""
    at_zero = evaluate(expression, {only: 0})
    slope = evaluate(expression, {only: 1}) - at_zero
    solution = round((number - at_zero) / slope) if slope else 0
    if evaluate(expression, {only: solution}) != number:
        raise NotWritable(f"{name}: no {only!r} makes {expression.source!r} equal {number}")
    return solution
