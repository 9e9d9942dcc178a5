"""Encoding of messages to a page: their base type, and the repair of texts.

Layer 5.
"""

import msgspec

__all__ = [
    "TEXT_CHARACTERS",
    "Outbound",
    "cut",
    "encoded",
    "encoded_bytes",
    "milliseconds",
    "repaired",
]

TEXT_CHARACTERS = 4096
"""Longest text value for a page; a longer one is cut and ends in an ellipsis."""

_encode = msgspec.json.Encoder().encode


class Outbound(msgspec.Struct, tag_field="t", omit_defaults=True, frozen=True):
    """A message to a page."""


def encoded(message: msgspec.Struct) -> str:
    """Return the JSON text of a message."""
    return encoded_bytes(message).decode()


def encoded_bytes(message: msgspec.Struct) -> bytes:
    """Return the JSON text of a message in UTF-8."""
    try:
        return _encode(message)
    except UnicodeEncodeError:
        # A robot's text may hold a lone surrogate; all other values must still arrive.
        return _encode(repaired(msgspec.to_builtins(message)))


def repaired(tree: object) -> object:
    """Return a tree of values with a question mark for each lone surrogate."""
    if isinstance(tree, str):
        return tree.encode("utf-8", "replace").decode()
    if isinstance(tree, (list, tuple)):
        return [repaired(item) for item in tree]
    if isinstance(tree, dict):
        return {repaired(key): repaired(value) for key, value in tree.items()}
    return tree


def cut(text: str) -> str:
    """Return a text, cut to the longest that a page gets."""
    return text if len(text) <= TEXT_CHARACTERS else text[: TEXT_CHARACTERS - 1] + "…"


def milliseconds(seconds: float) -> int:
    """Return the nearest whole number of milliseconds."""
    return round(seconds * 1000)
