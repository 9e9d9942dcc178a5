"""Parser for items without inner items: numbers, bits, packed arrays, text and bytes."""

from collections.abc import Mapping
from typing import Literal

from urc.config.node import Node, Problems
from urc.config.parse.bytes import parse_bytes
from urc.config.parse.struct.numbers import NumberParser, parse_enum, parse_valid
from urc.config.parse.struct.scope import Scope
from urc.model.binary import Extent, Item, Number, number_of, width_of

__all__ = ["LeafParser", "kind_of", "parse_content"]


def kind_of(number: Number) -> Literal["number", "coded"]:
    """Return the kind of the item for a number: ``number`` or ``coded``."""
    return "coded" if number.is_coded else "number"


class LeafParser:
    """Parses items without inner items."""

    def __init__(
        self, problems: Problems, enums: Mapping[str, tuple[tuple[int, str], ...]], scope: Scope
    ) -> None:
        self.problems = problems
        self.enums = enums
        self.scope = scope

    def number(self, part: Node, name: str, times: Extent | None) -> Item:
        """Parse a number or an array of numbers."""
        parser = NumberParser(part, self.problems)
        number = number_of(part.text("type"))
        assert number is not None  # noqa: S101  # checked by `_kind`
        return Item(
            kind_of(number),
            name,
            number,
            times=times,
            const=parser.constant(number),
            scale=parser.scale(),
            offset=part.number("offset") or 0,
            enum=parse_enum(part, number, self.enums, self.problems),
            valid=parse_valid(part, self.problems),
            value=self.scope.value(part.get("value")),
        )

    def packed(self, part: Node, name: str, times: Extent | None) -> Item | None:
        """Parse an array of numbers whose width is not a whole number of bytes, such as ``u11``."""
        parser, number, count = (
            NumberParser(part, self.problems),
            width_of(part.text("type")),
            part.must("count"),
        )
        assert number is not None  # noqa: S101  # checked by `_kind`
        if times is None or times.kind != "fixed" or number.bits * times.number % 8:
            text = f"numbers of {number.bits} bits need a count that fills whole bytes"
            self.problems.error(count, "wrong-size", text, hint="such as 8, 16 or 24")
            return None
        return Item(
            "packed",
            name,
            number,
            times=times,
            scale=parser.scale(),
            offset=part.number("offset") or 0,
            enum=parse_enum(part, number, self.enums, self.problems),
            valid=parse_valid(part, self.problems),
            is_lsb_first=part.text("order", "msb") == "lsb",
        )

    def bits(self, part: Node, name: str) -> Item | None:
        """Parse the bit fields of a whole number."""
        named = part.must("type")
        number = number_of(named.data)
        if number is None or number.kind != "integer" or number.is_signed or number.is_coded:
            text = f"bit fields need an unsigned whole-number type, found {named.data!r}"
            self.problems.error(named, "bad-item", text, hint="such as u8 or u16be")
            return None
        parts = [self._bit(inner) for inner in part.listed("bits")]
        widths = sum(one.number.bits for one in parts)
        if widths != number.bits:
            self.problems.error(
                part.must("bits"),
                "wrong-size",
                f"the bit fields have {widths} bits in total, but {named.data} has {number.bits}",
                hint="declare reserved bits with { width: … }" if widths < number.bits else "",
            )
            return None
        is_lsb_first = part.text("order", "msb") == "lsb"
        return Item("bits", name, number, is_lsb_first=is_lsb_first, items=tuple(parts))

    def _bit(self, part: Node) -> Item:
        if isinstance(part.data, str):
            self.scope.check_name(part, part.data)
            return Item("number", part.data, Number("integer", 1))
        parser = NumberParser(part, self.problems)
        name = part.text("id")
        self.scope.check_name(part.get("id") or part, name)
        number = parser.width()
        return Item(
            "number",
            name,
            number,
            const=parser.constant(number),
            scale=parser.scale(),
            offset=part.number("offset") or 0,
            enum=parse_enum(part, number, self.enums, self.problems),
            valid=parse_valid(part, self.problems),
            value=self.scope.value(part.get("value")),
        )


def parse_content(part: Node, item: Item, encoding: str, problems: Problems) -> Item | None:
    """Return an item of text or bytes with its constant, padding and end marker."""
    own = part.text("encoding")
    until = _bytes(part.get("until"), own or encoding, problems)
    const = _bytes(part.get("const"), own or encoding, problems)
    if const is not None:
        for key in ("size", "until", "pad", "value", "count"):
            if key in part.data:
                text = f"'{key}' has no effect for a constant"
                problems.error(part, "misplaced-key", text, at=key, key=True)
                return None
        return item._replace(const=const, size=Extent("fixed", len(const)), encoding=own)
    if "const" in part.data:
        return None  # already reported
    if (item.size is None) == (until is None):
        if item.size is None and ("size" in part.data or "until" in part.data):
            return None  # already reported
        key = "until" if until is not None else ""
        problems.error(
            part,
            "misplaced-key" if key else "missing-key",
            "'size' and 'until' both define the end of the item"
            if key
            else "'size' or 'until' is missing",
            at=key,
            key=True,
            hint="write 'size: 8', 'size: u8' for a preceding length, 'size: rest', or 'until:"
            " NUL'",
        )
        return None
    is_fixed = item.size is not None and item.size.kind == "fixed"
    if "pad" in part.data and not is_fixed:
        text = "'pad' needs a fixed size"
        problems.error(part, "misplaced-key", text, at="pad", key=True)
        return None
    return item._replace(until=until or b"", pad=part.integer("pad") or 0, encoding=own)


def _bytes(part: Node | None, encoding: str, problems: Problems) -> bytes | None:
    found = parse_bytes(part, encoding, problems) if part is not None else None
    if part is not None and found == b"":
        problems.error(part, "wrong-size", "expected at least one byte")
        return None
    return found
