"""The ``keyvalue`` form: key-value pairs, in any order."""

from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec

__all__ = ["parse_read", "place_of"]


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the separators and the field for each key."""
    pairs, separator = part.must("pairs"), part.must("separator")
    if pairs.data == separator.data:
        problems.error(separator, "same-separator", "'pairs' and 'separator' must be different")
        return None
    named = part.named("fields")
    seen: set[str] = set()
    for inner in named.values():
        if inner.data in seen:
            text = f"two keys set the field {inner.data!r}"
            problems.error(inner, "duplicate-name", text)
            return None
        seen.add(inner.data)
    if part.get("fields") is None:
        keys = {name: name for name in sorted(context.signals)}
    else:
        keys = {key: str(inner.data) for key, inner in named.items()}
    bare = tuple(inner.data or "" for inner in part.listed("first"))
    for place, inner in enumerate(part.listed("first")):
        if inner.data and (inner.data in bare[:place] or inner.data in keys.values()):
            text = f"the field {inner.data!r} occurs twice"
            problems.error(inner, "duplicate-name", text)
            return None
    strip = part.get("strip")
    options = {
        "pairs": pairs.data,
        "separator": separator.data,
        "keys": keys,
        "first": bare,
        "strip": str(strip.data) if strip else None,
    }
    return ReadSpec("keyvalue", options, (*filter(None, bare), *keys.values()))


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the field."""
    for inner in [*part.listed("first"), *part.named("fields").values()]:
        if inner.data == field:
            return inner, {}
    return part, {}
