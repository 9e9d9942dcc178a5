"""How messages for a page become text: the base of their shapes, and what is cut or mended.

Floor 5.
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
"""Longest text value sent to a page; a longer one is cut and ends in an ellipsis."""

_encode = msgspec.json.Encoder().encode


class Outbound(msgspec.Struct, tag_field="t", omit_defaults=True, frozen=True):
    """A message to a page."""


def encoded(message: msgspec.Struct) -> str:
    """Return the JSON text of a message."""
    return encoded_bytes(message).decode()


def encoded_bytes(message: msgspec.Struct) -> bytes:
    """Return it in UTF-8."""
    try:
        return _encode(message)
    except UnicodeEncodeError:
        # A lone surrogate in a robot's text; it must not stop everybody's values.
        return _encode(repaired(msgspec.to_builtins(message)))


def repaired(tree: object) -> object:
    """Return what can be encoded: with a question mark for each lone surrogate."""
    if isinstance(tree, str):
        return tree.encode("utf-8", "replace").decode()
    if isinstance(tree, (list, tuple)):
        return [repaired(item) for item in tree]
    if isinstance(tree, dict):
        return {repaired(key): repaired(value) for key, value in tree.items()}
    return tree


def cut(text: str) -> str:
    """Return a text that is not longer than a page is sent."""
    return text if len(text) <= TEXT_CHARACTERS else text[: TEXT_CHARACTERS - 1] + "…"


def milliseconds(seconds: float) -> int:
    """Return the nearest whole number of milliseconds."""
    return round(seconds * 1000)
