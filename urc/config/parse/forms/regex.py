"""The ``regex`` form: a regular expression with a named group for each field."""

from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec

__all__ = ["parse_read", "place_of"]


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the pattern at `part` with its groups."""
    pattern = problems.pattern(part)
    if pattern is None:
        return None
    return ReadSpec("regex", {"pattern": pattern}, pattern.groups)


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the group `field` in the pattern."""
    return part, {"offset": str(part.data).find(f"<{field}>") + 1, "length": len(field)}
