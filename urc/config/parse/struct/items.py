"""Parser for the items of a struct or a reusable type: list → `Item` values.

An `ItemParser` reads the items of one scope; an expression can refer to earlier ids in its scope.
The table `_KEYS` contains the keys of each kind of item. The module `numbers` checks numbers,
constants and enums.
"""

from collections.abc import Mapping
from typing import Final, Literal

from urc.config.node import Node, Problems
from urc.config.parse.struct.leaves import LeafParser, kind_of, parse_content
from urc.config.parse.struct.numbers import check_fits, unknown_type, written_constant
from urc.config.parse.struct.scope import Scope
from urc.model.binary import (
    FRAME_NAMES,
    Extent,
    Item,
    Switch,
    case_key,
    fixed_size,
    least_size,
    number_of,
    width_of,
)

__all__ = ["ItemParser", "Purpose"]

Purpose = Literal["read", "send", "type"]
Items = tuple[Item, ...]

MOST_ITEMS: Final = 2000
"""Maximum number of items in one frame, including the items of its types."""
DEEPEST: Final = 16
"""Maximum nesting depth of types and switches."""
_NUMBER: Final = ("id", "type", "count", "if", "enum", "const", "valid", "scale", "offset", "value")
_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "number": _NUMBER,
    "coded": _NUMBER,
    "packed": ("id", "type", "count", "if", "enum", "valid", "scale", "offset", "order"),
    "bits": ("id", "type", "bits", "order", "if"),
    "bytes": ("id", "type", "size", "count", "if", "const", "pad", "until", "value"),
    "text": ("id", "type", "size", "count", "if", "const", "pad", "until", "value", "encoding"),
    "padding": ("size", "pad", "if"),
    "struct": ("id", "type", "size", "count", "if", "trim", "value"),
    "switch": ("switch", "if"),
}


class ItemParser:
    """Parses the items of one scope."""

    def __init__(
        self,
        problems: Problems,
        types: Mapping[str, Items],
        enums: Mapping[str, tuple[tuple[int, str], ...]],
        purpose: Purpose,
        encoding: str,
    ) -> None:
        self.problems = problems
        self.types = types
        self.enums = enums
        self.purpose = purpose
        self.encoding = encoding
        self.scope = Scope(problems, purpose)
        self.leaves = LeafParser(problems, enums, self.scope)

    def items(self, part: Node) -> Items:
        """Return the valid items of the list at `part`; report the invalid items."""
        found: list[Item | None] = []
        total = 0
        for inner in part.items():
            item = self._item(inner)
            found.append(item)
            total += weight_of(item)
            if total > MOST_ITEMS:
                text = (
                    f"the struct has more than {MOST_ITEMS} items, including the items of its types"
                )
                self.problems.error(inner, "wrong-size", text)
                return ()
        self._check_rest(part, found)
        return tuple(item for item in found if item is not None)

    def _check_rest(self, part: Node, found: list[Item | None]) -> None:
        """Report any item that follows an item extending to the end of the frame."""
        for place, item in enumerate(found[:-1]):
            extents = (item.size, item.times) if item is not None else ()
            if any(extent is not None and extent.kind == "rest" for extent in extents):
                self.problems.error(
                    part.items()[place + 1],
                    "after-rest",
                    "the previous item extends to the end of the frame",
                    hint="give the previous item a size, or move that item to the end",
                )

    def _item(self, part: Node) -> Item | None:
        item = self._short(part) if isinstance(part.data, str) else self._long(part)
        if item is None:
            return None
        if depth_of(item) > DEEPEST:
            text = f"types and switches are nested more than {DEEPEST} levels deep"
            self.problems.error(part, "too-deep", text)
            return None
        self._check_sent(part, item)
        self.scope.add(part, item)
        return item

    def _short(self, part: Node) -> Item | None:
        """Parse an item in short notation, such as ``u8 8``, ``i32be rpm`` or ``header``."""
        word, _, rest = part.data.strip().partition(" ")
        rest = rest.strip()
        items = self.types.get(word)
        if items is not None:
            self.scope.check_name(part, rest)
            return Item("struct", rest, items=items)
        number = number_of(word)
        if number is None:
            unknown_type(part, word, self.types, self.problems)
            return None
        if not rest:
            self.problems.error(
                part,
                "bad-item",
                f"expected a name or a constant after {word!r}",
                hint=f"write '{word} speed', '{word} 8', or {{ size: {number.size} }} to skip the"
                " item",
            )
            return None
        constant = written_constant(rest)
        if constant is None:
            self.scope.check_name(part, rest)
            return Item(kind_of(number), rest, number)
        check_fits(part, number, constant, self.problems)
        return Item(kind_of(number), "", number, const=constant)

    def _long(self, part: Node) -> Item | None:
        """Parse an item that is a mapping."""
        kind = self._kind(part)
        if kind is None:
            return None
        for key in part.data:
            if key not in _KEYS[kind]:
                self.problems.error(
                    part, "misplaced-key", f"'{key}' has no effect for {_NOUNS[kind]}",
                    at=key, key=True,
                )  # fmt: skip
                return None
        condition = part.get("if")
        is_there = self.scope.expression(condition) if condition else None
        item = self._of_kind(kind, part)
        if item is None:
            return None
        item = item._replace(condition=is_there)
        return item if item.times is None else self._array(part, item)

    def _kind(self, part: Node) -> str | None:
        if "switch" in part.data:
            return "switch"
        named = part.get("type")
        if named is None:
            if "size" in part.data and "id" not in part.data and "bits" not in part.data:
                return "padding"
            text = "an item lacks 'type'"
            self.problems.error(part, "missing-key", text, key=True, hint="for example 'type: u8'")
            return None
        if "bits" in part.data:
            return "bits"
        if named.data in ("bytes", "text"):
            return str(named.data)
        if named.data in self.types:
            return "struct"
        number = number_of(named.data)
        if number is None:
            if "count" in part.data and width_of(named.data) is not None:
                return "packed"
            unknown_type(named, named.data, self.types, self.problems)
            return None
        return kind_of(number)

    def _of_kind(self, kind: str, part: Node) -> Item | None:
        name = part.text("id")
        self.scope.check_name(part.get("id") or part, name)
        if kind == "switch":
            return self._switch(part.must("switch"))
        if kind == "bits":
            return self.leaves.bits(part, name)
        if kind in ("number", "coded"):
            return self.leaves.number(part, name, self._extent(part.get("count")))
        if kind == "packed":
            return self.leaves.packed(part, name, self._extent(part.get("count")))
        size = self._extent(part.get("size"))
        times = self._extent(part.get("count"))
        if kind == "padding":
            if size is not None and size.kind == "prefix":
                text = "the size of skipped bytes cannot be a type"
                self.problems.error(part.must("size"), "bad-item", text)
                return None
            return Item("padding", size=size, pad=part.integer("pad") or 0)
        value = self.scope.value(part.get("value"))
        if kind == "struct":
            return self._struct(part, Item("struct", name, size=size, times=times, value=value))
        start = Item("text" if kind == "text" else "bytes", name, size=size, times=times)
        return parse_content(part, start._replace(value=value), self.encoding, self.problems)

    def _struct(self, part: Node, item: Item) -> Item | None:
        items = self.types[part.text("type")]
        trim = part.integer("trim")
        if trim is not None:
            size_is_free = item.size is not None and item.size.kind != "fixed"
            if not size_is_free or fixed_size(_without_rest(items)) is None:
                self.problems.error(
                    part, "misplaced-key", "'trim' needs a fixed-size type and a variable 'size'",
                    at="trim", key=True, hint="write 'size: rest', or 'size' with an item's name",
                )  # fmt: skip
                return None
        if item.value is not None and item.times is None:
            text = "'value' has no effect for a struct without 'count'"
            self.problems.error(part, "misplaced-key", text, at="value", key=True)
        return item._replace(items=items, trim=trim)

    def _array(self, part: Node, item: Item) -> Item | None:
        if not item.id and item.kind not in ("struct", "packed"):
            text = "an array needs an 'id'"
            self.problems.error(
                part, "missing-key", text, key=True, hint="write { size: … } to skip bytes"
            )
            return None
        if item.const is not None:
            text = "'const' has no effect for an array"
            self.problems.error(part, "misplaced-key", text, at="const", key=True)
            return None
        if item.kind == "packed":
            return item
        if least_size((item._replace(times=None, condition=None),)) == 0:
            text = "each item of an array must take at least one byte"
            self.problems.error(part, "bad-item", text, at="count")
            return None
        return item

    def _extent(self, part: Node | None) -> Extent | None:
        """Parse a size or count: a number, ``rest``, a preceding type, or an expression."""
        if part is None:
            return None
        if not isinstance(part.data, str):
            return Extent("fixed", int(part.data))
        if part.data == "rest":
            return Extent("rest")
        prefix = number_of(part.data)
        if prefix is not None:
            if prefix.kind in ("integer", "varint") and not prefix.is_signed:
                return Extent("prefix", prefix=prefix)
            text = f"a size needs an unsigned whole-number type, found {part.data!r}"
            self.problems.error(part, "bad-item", text)
            return None
        expression = self.scope.expression(part)
        return None if expression is None else Extent("expression", expression=expression)

    def _switch(self, part: Node) -> Item | None:
        by = self.scope.expression(part.must("by"))
        cases: list[tuple[int | str, Items]] = []
        subject = self.scope.get(part.text("by"))
        branches = [*part.must("cases").entries().values()]
        default_part = part.get("else")
        before, after = self.scope.known, dict(self.scope.known)
        default: Items | None = None
        for inner in [*branches, *([default_part] if default_part else [])]:
            self.scope.known = dict(before)
            items = self._branch(inner)
            after |= self.scope.known
            if inner is default_part:
                default = items
                continue
            cases.append((case_key(inner.name), items))
            self._check_case(inner, subject)
        self.scope.known = after
        return None if by is None else Item("switch", switch=Switch(by, tuple(cases), default))

    def _branch(self, part: Node) -> Items:
        if isinstance(part.data, list):
            return self.items(part)
        items = self.types.get(part.data)
        if items is None:
            unknown_type(part, part.data, self.types, self.problems, only_types=True)
            return ()
        for name in Scope.names(Item("struct", items=items)):
            self.scope.know(part, name, None)
        return items

    def _check_case(self, part: Node, subject: Item | None) -> None:
        """Report a switch case for a value that the switch's item cannot have."""
        key = case_key(part.name)
        if subject is None or subject.kind not in ("number", "coded"):
            return
        words = [word for _, word in subject.enum]
        if isinstance(key, str) and subject.number.kind == "integer" and key not in words:
            text = f"{key!r} is not a value of {subject.id!r}"
            hint = (
                f"words: {', '.join(words)}"
                if words
                else "the item has no 'enum', so its values have no words"
            )
            self.problems.error(part, "unknown-word", text, key=True, hint=hint)
        elif isinstance(key, int) and key in dict(subject.enum):
            word = dict(subject.enum)[key]
            text = f"{subject.id!r} has the word {word!r} for this value, not {key}"
            self.problems.error(part, "unknown-word", text, key=True, hint=f"write {word}:")
        elif isinstance(key, int) and subject.number.kind == "integer":
            check_fits(part, subject.number, key, self.problems, key=True)

    def _check_sent(self, part: Node, item: Item) -> None:
        """Report an item of a sent struct that has no value, or a size from `_left` or `_size`."""
        if self.purpose == "send" and asks_for_the_end(item):
            self.problems.error(
                part,
                "nothing-to-send",
                "'_left' and '_size' are unknown while a frame is built",
                hint="write 'rest' for the remaining bytes, or give the size in an earlier item",
            )
        if self.purpose != "send" or item.kind not in (
            "number",
            "coded",
            "packed",
            "bytes",
            "text",
        ):
            return
        if not item.id and item.const is None and item.value is None:
            self.problems.error(
                part, "nothing-to-send", "'id', 'const' or 'value' is missing",
                hint="name the argument, or write { size: … } for unused bytes",
            )  # fmt: skip


def _without_rest(items: Items) -> Items:
    """Return the items without a final padding of size ``rest``."""
    is_rest = bool(items) and items[-1].size is not None and items[-1].size.kind == "rest"
    return items[:-1] if is_rest and items[-1].kind == "padding" else items


_NOUNS: Final = {
    "number": "a number",
    "coded": "a number",
    "packed": "an array of bits",
    "bits": "bits",
    "bytes": "bytes",
    "text": "text",
    "padding": "skipped bytes",
    "struct": "a struct",
    "switch": "a switch",
}


def _inner(item: Item) -> list[Items]:
    """Return the item lists inside an item."""
    if item.switch is None:
        return [item.items]
    return [*(case for _, case in item.switch.cases), item.switch.default or ()]


def asks_for_the_end(item: Item) -> bool:
    """Return whether an item's size, count or switch depends on the size of the whole frame."""
    by = None if item.switch is None else item.switch.by
    extents = [extent.expression for extent in (item.size, item.times) if extent is not None]
    if any(one is not None and one.names & FRAME_NAMES for one in (by, *extents)):
        return True
    return any(asks_for_the_end(one) for items in _inner(item) for one in items)


def weight_of(item: Item | None) -> int:
    """Return how many items an item counts as: itself, and all items inside it."""
    if item is None:
        return 0
    return 1 + sum(weight_of(one) for items in _inner(item) for one in items)


def depth_of(item: Item) -> int:
    """Return the nesting depth of types and switches in an item."""
    depths = [depth_of(one) for items in _inner(item) for one in items]
    return max(depths, default=0) + (item.kind in ("struct", "switch"))
