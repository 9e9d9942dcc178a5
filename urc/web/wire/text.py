"""Encoding of messages to pages: the base type and the repair of invalid text.

Layer 5.
"""

import msgspec

__all__ = [
    "TEXT_CHARACTERS",
    "close_reason",
    "cut",
    "encoded",
    "encoded_bytes",
    "milliseconds",
    "repaired",
]

TEXT_CHARACTERS = 4096
"""Maximum length of a text value, in characters; longer text is cut and ends with an ellipsis."""
CLOSE_BYTES = 123
"""Maximum length of the reason in a WebSocket's close frame, in bytes."""

_encode = msgspec.json.Encoder().encode


def encoded(message: msgspec.Struct) -> str:
    """Return the JSON text of a message."""
    return encoded_bytes(message).decode()


def encoded_bytes(message: msgspec.Struct) -> bytes:
    """Return the JSON text of a message in UTF-8."""
    try:
        return _encode(message)
    except UnicodeEncodeError:
        # A robot's text may contain a lone surrogate; all other values must still arrive.
        return _encode(repaired(msgspec.to_builtins(message)))


def repaired(tree: object) -> object:
    """Return nested values in which a question mark replaces each lone surrogate."""
    if isinstance(tree, str):
        return tree.encode("utf-8", "replace").decode()
    if isinstance(tree, (list, tuple)):
        return [repaired(item) for item in tree]
    if isinstance(tree, dict):
        return {repaired(key): repaired(value) for key, value in tree.items()}
    return tree


def cut(text: str) -> str:
    """Return text, cut to `TEXT_CHARACTERS` characters."""
    return text if len(text) <= TEXT_CHARACTERS else text[: TEXT_CHARACTERS - 1] + "…"


def close_reason(text: str) -> str:
    """Return the reason of a closed socket, cut to the bytes of a close frame (RFC 6455, 5.5)."""
    return text.encode()[:CLOSE_BYTES].decode(errors="ignore")


def milliseconds(seconds: float) -> int:
    """Convert a time in seconds to milliseconds, rounded to a whole number."""
    return round(seconds * 1000)
