"""Parsed options of the text forms; `urc.config` makes them, `urc.protocol` reads them."""

from typing import Literal, NamedTuple

__all__ = ["FieldKind", "PatternField", "JsonPath", "XmlPath", "XmlStep"]

FieldKind = Literal["integer", "number", "word", "text", "rest", "hex"]


class PatternField(NamedTuple):
    """A field in a pattern, and the literal text before it."""

    before: str
    """Literal text; a run of blanks counts as one blank."""
    name: str
    """Name of the field; "" for a skipped one."""
    kind: FieldKind
    width: int = 0
    """Fixed width in characters; 0: variable."""


JsonPath = tuple[str | int, ...]
"""Object keys and array indices, from the root of the document."""


class XmlStep(NamedTuple):
    """One element on the path to a field."""

    tag: str
    """Local name, without its namespace."""
    place: int = 1
    """1-based position among the elements with this name and these attributes."""
    attributes: tuple[tuple[str, str], ...] = ()
    """Name and value of each required attribute."""


class XmlPath(NamedTuple):
    """The path of a field in an XML document."""

    steps: tuple[XmlStep, ...]
    """Elements of the path, from the root."""
    attribute: str = ""
    """Name of the attribute; "" for the text of the element."""
