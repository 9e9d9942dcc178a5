"""Transports that carry messages instead of bytes, and the forms that each allows.

Transports of packages are not listed here and have no such limits.
"""

from typing import Final, NamedTuple

__all__ = ["BYTE_LINES", "CARRIERS", "MESSAGING", "MessageTransportRules"]


class MessageTransportRules(NamedTuple):
    """The allowed forms of one transport type."""

    verbs: tuple[str, ...]
    """Forms of sent messages."""
    listen: tuple[str, ...]
    """Additional keys under ``subscribe``, next to ``topic``."""


MESSAGING: Final = {
    "ros": MessageTransportRules(
        ("publish", "call", "goal", "cancel"), ("type", "throttle", "queue_length", "compression")
    ),
    "mqtt": MessageTransportRules(("publish",), ("qos",)),
    "http": MessageTransportRules(("request",), ("stream", "every")),
}
BYTE_LINES: Final = frozenset(("tcp", "udp", "serial", "ssh", "telnet", "websocket"))
CARRIERS: Final = frozenset(("ssh",))
"""Transport types that can be tunnels."""
