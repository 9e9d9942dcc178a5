"""The ``struct`` form: binary items, for received and sent frames."""

from collections.abc import Iterable, Iterator
from typing import Any, cast

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.config.parse.struct.items import ItemParser
from urc.expressions import Template
from urc.model.binary import (
    FRAME_NAMES,
    Item,
    derived_sizes,
    fixed_size,
    joined_name,
    least_size,
    names_of,
)
from urc.model.driver import FramingSpec
from urc.model.framing import FrameLayout
from urc.model.payload import ReadSpec, WriteSpec

__all__ = ["parse_read", "parse_write", "place_of", "templates"]

Uses = tuple[tuple[tuple[str | int, ...], Template], ...]


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the items at `part`; their ids are the fields of the frame."""
    before = len(problems.problems)
    parser = ItemParser(problems, context.types, context.enums, "read", context.encoding)
    items = parser.items(part)
    if len(problems.problems) == before:  # an unknown type has no known size
        _check_size(part, items, context.framing, problems)
    if len(problems.problems) > before:
        return None
    return ReadSpec("struct", {"items": items}, tuple(dict.fromkeys(names_of(items))))


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the items at `part`; ids without a computed value are arguments."""
    before = len(problems.problems)
    parser = ItemParser(problems, context.types, context.enums, "send", context.encoding)
    items = parser.items(part)
    framing = context.framing
    if len(problems.problems) == before:
        _check_size(part, items, framing and (framing.sent or framing), problems)
    if len(problems.problems) > before:
        return None
    derived = derived_sizes(items).keys()
    given = set(names_of(items, sent=True)) - derived
    own = (set(names_of(items)) | FRAME_NAMES) - given
    uses: list[tuple[tuple[str | int, ...], Template]] = []
    for place, template in parser.scope.uses:
        names = template.names - own
        if names:
            path = place.path[len(part.path) :]
            used = Template(template.source, template.python, names, template.settings)
            uses.append((path, used))
    names = frozenset().union(*(template.names for _, template in uses))
    settings = frozenset().union(*(template.settings for _, template in uses))
    return WriteSpec("struct", {"items": items, "uses": tuple(uses)}, names, settings)


def _check_size(
    part: Node, items: tuple[Item, ...], framing: FramingSpec | None, problems: Problems
) -> None:
    """Report a struct whose size does not fit the frames of the transport's framing."""
    if framing is None:
        return
    layout = framing.options.get("layout")
    least, size = least_size(items), fixed_size(items)
    around = layout.head + layout.tail if isinstance(layout, FrameLayout) else 0
    if isinstance(layout, FrameLayout) and layout.size is not None:
        room = layout.size - around
        if least > room or (size is not None and size < room):
            over = f"write {{ size: {room - least} }} for unused bytes"
            hint = over if least < room else ""
            text = (
                f"the items take {least} bytes, but a frame of this transport has room for {room}"
            )
            problems.error(part, "does-not-fit", text, hint=hint)
    elif least + around > framing.max_bytes:
        text = f"the items take {least} bytes, but the framing allows {framing.max_bytes}"
        problems.error(part, "does-not-fit", text + " at most", hint="increase its 'max'")


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return every argument and expression with its position."""
    for path, template in cast("Uses", spec.options.get("uses", ())):
        inner = part
        for step in path:
            inner = Node(inner.document, (*inner.path, step), inner.data[step])
        if isinstance(inner.data, dict):
            inner = inner.must("id") if "id" in inner.data else inner
        yield inner, template


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the item that sets `field`."""
    nearest = part
    for place, name in _named(part, ""):
        if name == field:
            return place, _inside(place, name)
        if not name or field.startswith(joined_name(name, "")):
            nearest = place
    return nearest, _inside(nearest, "")


def _inside(place: Node, name: str) -> dict[str, Any]:
    if isinstance(place.data, str) and name and " " in place.data:
        return {"offset": place.data.rfind(name), "length": len(name)}
    return {}


def _named(part: Node, outer: str) -> Iterator[tuple[Node, str]]:
    """Yield the node and the name of every item with a name or a type; the name may be ""."""
    for item in part.items():
        if isinstance(item.data, str):
            _, _, name = item.data.strip().partition(" ")
            yield item, joined_name(outer, name.strip()) if name else ""
            continue
        name = joined_name(outer, item.data["id"]) if "id" in item.data else ""
        if name or "type" in item.data:
            yield item.get("id") or item, name
        if "bits" in item.data:
            yield from _bits(item.must("bits"), name or outer)
        switch = item.get("switch")
        branches = list(switch.must("cases").entries().values()) if switch else []
        branches += [switch.must("else")] if switch and "else" in switch.data else []
        for branch in branches:
            if isinstance(branch.data, list):
                yield from _named(branch, outer)
            else:
                yield branch, ""


def _bits(part: Node, outer: str) -> Iterator[tuple[Node, str]]:
    for item in part.items():
        if isinstance(item.data, str):
            yield item, joined_name(outer, item.data)
        elif "id" in item.data:
            yield item.must("id"), joined_name(outer, item.data["id"])
