"""The encoding of message bodies on transports whose messages contain bytes."""

import msgspec

from urc.transports.base import TransportError

__all__ = ["body_bytes"]

_encode = msgspec.json.Encoder().encode


def body_bytes(body: object) -> bytes:
    """Encode a message body: bytes stay unchanged, and all other values become JSON.

    Raises:
        TransportError: the value cannot be written as JSON.
    """
    if isinstance(body, bytes):
        return body
    if body is None:
        return b""
    try:
        return _encode(body)
    except (TypeError, ValueError, OverflowError) as problem:
        raise TransportError(f"the value cannot be sent as JSON ({problem})") from problem
