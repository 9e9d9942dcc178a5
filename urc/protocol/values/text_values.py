"""Text notation of values, for all forms that write text."""

import re
from collections.abc import Mapping

from urc.expressions import quoted
from urc.protocol.values.convert import spelt
from urc.protocol.values.payload import NotWritable

__all__ = ["counter_in", "encoded", "field_text", "written_differently"]

_COUNTER = re.compile(r"\s*seq\s*\(\s*['\"]([a-z][a-z0-9_]*)['\"][^()]*\)\s*")


def counter_in(expression: str) -> str:
    """Return the counter's name if an expression is only a counter, else ""."""
    found = _COUNTER.fullmatch(expression)
    return found[1] if found else ""


def field_text(value: object) -> str:
    """Return a value as text: ``true``, ``3``, ``2.5``; list elements are separated by spaces."""
    if value is None:
        return ""
    if isinstance(value, (list, tuple)):
        return " ".join(map(field_text, value))
    return spelt(value)


def encoded(text: str, encoding: str) -> bytes:
    """Return the text in the given encoding; raise `NotWritable` if impossible."""
    try:
        return text.encode(encoding)
    except UnicodeEncodeError as error:
        raise NotWritable(f"{quoted(error.object)} cannot be encoded in {encoding}") from None


def written_differently(fields: Mapping[str, object], found: Mapping[str, object] | None) -> str:
    """Return the first field whose value differs when the frame is read back; "" if none does."""
    for name, value in fields.items():
        if found is None or field_text(found.get(name)) != field_text(value):
            return name
    return ""
