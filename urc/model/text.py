"""What the text forms make of their options; parsed by `urc.config`, read by `urc.protocol`."""

from typing import Literal, NamedTuple

__all__ = ["FieldKind", "Hole", "JsonPath", "XmlPath", "XmlStep"]

FieldKind = Literal["integer", "number", "word", "text", "rest", "hex"]


class Hole(NamedTuple):
    """A place in a pattern of fields, and the literal text before it."""

    before: str
    """Literal text; a run of blanks is one blank."""
    name: str
    """Of the field; "" for one that is skipped."""
    kind: FieldKind
    width: int = 0
    """Characters that it always takes; 0: as many as belong to it."""


JsonPath = tuple[str | int, ...]
"""Names and list places, from the top of the document on."""


class XmlStep(NamedTuple):
    """One element on the way."""

    tag: str
    """Local name, without its namespace."""
    place: int = 1
    """Which one of that name and these attributes, from 1."""
    attributes: tuple[tuple[str, str], ...] = ()
    """Name and value of each attribute that it must have."""


class XmlPath(NamedTuple):
    """Where a field is in an XML document."""

    steps: tuple[XmlStep, ...]
    """From the root element on."""
    attribute: str = ""
    """Name of the attribute; "" for the text of the element."""
