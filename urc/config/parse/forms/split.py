"""The ``split`` form: fields between separators."""

from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec

__all__ = ["parse_read", "place_of"]

_MORE = "..."


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the declaration at `part`: the separator, and the name of each part."""
    names: list[str] = []
    has_more = is_good = True
    tail = ""
    items = part.listed("fields")
    has_more = items[-1].data == _MORE
    for inner in items[:-1] if has_more else items:
        name = inner.data or ""
        if name.endswith(_MORE) and name != _MORE and inner is items[-1]:
            name, tail = name.removesuffix(_MORE), name.removesuffix(_MORE)
        if name.endswith(_MORE):
            text = "'...' is allowed only in the last name"
            problems.error(inner, "bad-name", text)
            is_good = False
        elif name in names and name:
            problems.error(inner, "duplicate-name", f"the field {name!r} occurs twice")
            is_good = False
        names.append(name)
    strip = part.get("strip")
    options = {
        "by": part.text("by"),
        "names": tuple(names),
        "has_more": has_more,
        "tail": tail,
        "strip": str(strip.data) if strip else None,
    }
    return ReadSpec("split", options, tuple(filter(None, names))) if is_good else None


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the field."""
    for inner in part.listed("fields"):
        if inner.data in (field, field + _MORE):
            return inner, {}
    return part, {}
