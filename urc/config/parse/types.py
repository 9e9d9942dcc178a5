"""Parser for a driver's reusable structs under ``types``, in dependency order."""

from collections.abc import Iterator, Mapping
from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.struct.items import ItemParser
from urc.model.binary import Item, number_of

__all__ = ["parse_types"]

Items = tuple[Item, ...]


def parse_types(
    part: Node, enums: Mapping[str, tuple[tuple[int, str], ...]], problems: Problems
) -> Mapping[str, Items]:
    """Return the items of each type in the driver at `part`; an invalid type has no items."""
    parts = part.named("types")
    types: dict[str, Items] = {}
    needed = {name: set(_names(inner.data)) & parts.keys() for name, inner in parts.items()}
    for name, inner in parts.items():
        if number_of(name) is not None or name in ("bytes", "text", "rest"):
            problems.error(inner, "bad-name", f"{name!r} is a built-in type", key=True)
            needed[name] = set()
    for name in parts:
        _parse(name, parts, needed, (), types, enums, problems)
    return types


def _parse(
    name: str,
    parts: Mapping[str, Node],
    needed: Mapping[str, set[str]],
    above: tuple[str, ...],
    types: dict[str, Items],
    enums: Mapping[str, tuple[tuple[int, str], ...]],
    problems: Problems,
) -> None:
    """Parse the dependencies of the type `name`, and then the type itself."""
    if name in types:
        return
    types_above = (*above, name)
    for other in sorted(needed[name]):
        if other in types_above:
            circle = " → ".join((*types_above[types_above.index(other) :], other))
            problems.error(
                parts[name], "recursion", f"a type cannot contain itself: {circle}", key=True
            )
            types[other] = types.get(other, ())
            continue
        _parse(other, parts, needed, types_above, types, enums, problems)
    if name not in types:
        types[name] = ItemParser(problems, types, enums, "type", "").items(parts[name])


def _names(data: Any) -> Iterator[str]:
    """Yield every possible type name in a type's items."""
    for item in data if isinstance(data, list) else ():
        if isinstance(item, str):
            yield item.strip().partition(" ")[0]
            continue
        yield str(item.get("type", ""))
        switch = item.get("switch", {})
        for branch in [*switch.get("cases", {}).values(), switch.get("else", [])]:
            yield from [branch] if isinstance(branch, str) else _names(branch)
