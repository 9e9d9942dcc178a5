"""The form ``xml``: fields at element paths in a document.

The form uses the standard library's parser. Documents with a document type declaration are rejected
before parsing. XML entities therefore cannot expand, and external resources are never loaded.
"""

from collections.abc import Iterator, Mapping
from typing import cast
from xml.etree import ElementTree

from urc.expressions import quoted
from urc.model.payload import Payload, ReadSpec
from urc.model.text import XmlPath, XmlStep
from urc.protocol.values.payload import CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import encoded, field_text, written_differently

__all__ = ["XmlReader"]

_MAX_DEPTH = 100
"""Maximum nesting depth of XML elements."""


class XmlReader:
    """A reader for the text and attributes of XML elements; it also writes XML documents."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._paths = dict(cast("Mapping[str, XmlPath]", spec.options["paths"]))
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields found; None for an invalid document or a document without fields."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        root = _parsed(text)
        if root is None:
            return None
        found: dict[str, object] = {}
        for name, path in self._paths.items():
            value = _find(root, path)
            if value is not None:
                found[name] = value.strip() or None
        return found or None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return an XML document with `fields` at their paths."""
        root: ElementTree.Element | None = None
        for name, value in fields.items():
            path = self._paths.get(name)
            if path is None:
                continue
            if root is None:
                root = ElementTree.Element(path.steps[0].tag, dict(path.steps[0].attributes))
            _put(root, path, field_text(value))
        if root is None:
            raise NotWritable("an XML document needs at least one of the declared fields")
        text = ElementTree.tostring(root, encoding="unicode")
        wrong = written_differently(fields, self._read(text))
        if wrong:
            raise NotWritable(f"{wrong}: {quoted(fields[wrong])} cannot be written as XML")
        return encoded(text, self._encoding)


def _parsed(text: str) -> ElementTree.Element | None:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        return None
    parser: ElementTree.XMLPullParser[ElementTree.Element]
    parser = ElementTree.XMLPullParser(("start", "end"))
    depth = 0
    try:
        parser.feed(text)
        parser.close()
        events = cast("Iterator[tuple[str, ElementTree.Element]]", parser.read_events())
        root = None
        for event, element in events:
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            if depth > _MAX_DEPTH:
                return None
    except (ElementTree.ParseError, ValueError):
        return None
    return root


def _local(tag: object) -> str:
    """Return an ElementTree name, such as ``{namespace}name``, without the namespace."""
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def _child(element: ElementTree.Element, step: XmlStep) -> ElementTree.Element | None:
    same = (child for child in element if _is_meant(child, step))
    for place, child in enumerate(same, 1):
        if place == step.place:
            return child
    return None


def _is_meant(element: ElementTree.Element, step: XmlStep) -> bool:
    if _local(element.tag) != step.tag:
        return False
    if not step.attributes:
        return True
    found = {_local(name): value for name, value in element.attrib.items()}
    return all(found.get(name) == value for name, value in step.attributes)


def _find(root: ElementTree.Element, path: XmlPath) -> str | None:
    if not _is_meant(root, path.steps[0]):
        return None
    element: ElementTree.Element | None = root
    for step in path.steps[1:]:
        element = _child(element, step) if element is not None else None
    if element is None:
        return None
    if not path.attribute:
        return element.text or ""
    for name, value in element.attrib.items():
        if _local(name) == path.attribute:
            return value
    return None


def _put(root: ElementTree.Element, path: XmlPath, text: str) -> None:
    element = root
    for step in path.steps[1:]:
        child = _child(element, step)
        while child is None:
            ElementTree.SubElement(element, step.tag, dict(step.attributes))
            child = _child(element, step)
        element = child
    if path.attribute:
        element.set(path.attribute, text)
    else:
        element.text = text
