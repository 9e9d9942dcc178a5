"""The form ``raw``: the whole frame is one field."""

from typing import Any

from urc.config.parse.form import FormContext
from urc.config.part import Findings, Part
from urc.model.codec import ReadSpec

__all__ = ["parse_read", "place_of"]


def parse_read(part: Part, findings: Findings, context: FormContext) -> ReadSpec:
    """Return the field at `part`."""
    return ReadSpec("raw", {"field": part.data}, (part.data,))


def place_of(part: Part, field: str) -> tuple[Part, dict[str, Any]]:
    """Return the place of the field."""
    return part, {}
