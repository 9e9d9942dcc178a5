"""Parsed options of the text forms, written by `urc.config` and read by `urc.protocol`."""

from typing import Literal, NamedTuple

__all__ = ["FieldKind", "PatternField", "JsonPath", "XmlPath", "XmlStep"]

FieldKind = Literal["integer", "number", "word", "text", "rest", "hex"]


class PatternField(NamedTuple):
    """A field in a pattern, with the preceding literal text."""

    before: str
    """Literal text before the field; consecutive blanks match like a single blank."""
    name: str
    """Name of the field; "" for a skipped field."""
    kind: FieldKind
    width: int = 0
    """Fixed width of the field in characters; 0 means variable width."""


JsonPath = tuple[str | int, ...]
"""Path in a JSON document: object keys and array indices, from the root."""


class XmlStep(NamedTuple):
    """One step of the path to a field: an element of the XML document."""

    tag: str
    """Local name of the element, without namespace."""
    place: int = 1
    """1-based position among the elements with the same name and attributes."""
    attributes: tuple[tuple[str, str], ...] = ()
    """Required attributes of the element, as pairs of name and value."""


class XmlPath(NamedTuple):
    """The path to a field in an XML document."""

    steps: tuple[XmlStep, ...]
    """Elements on the path, from the root."""
    attribute: str = ""
    """Name of an attribute of the last element; "" means the element's text."""
