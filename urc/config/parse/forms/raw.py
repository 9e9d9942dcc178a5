"""The ``raw`` form: one field with the whole frame."""

from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec

__all__ = ["parse_read", "place_of"]


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec:
    """Return the declaration of the only field, which `part` names."""
    return ReadSpec("raw", {"field": part.data}, (part.data,))


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the field."""
    return part, {}
