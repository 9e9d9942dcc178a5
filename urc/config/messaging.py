"""Transports that carry messages instead of bytes, and what may be said on them.

A kind of transport that a package adds is not in here: of those nothing is refused.
"""

from typing import Final, NamedTuple

__all__ = ["BYTE_LINES", "CARRIERS", "MESSAGING", "Messaging"]


class Messaging(NamedTuple):
    """What one kind of transport takes."""

    verbs: tuple[str, ...]
    """Forms of what is sent."""
    listen: tuple[str, ...]
    """Keys beside ``topic`` under ``subscribe``."""


MESSAGING: Final = {
    "rosbridge": Messaging(
        ("publish", "call", "goal", "cancel"), ("type", "throttle", "queue_length", "compression")
    ),
    "mqtt": Messaging(("publish",), ("qos",)),
    "http": Messaging(("request",), ("stream", "every")),
}
BYTE_LINES: Final = frozenset(("tcp", "udp", "serial", "ssh", "telnet", "websocket"))
CARRIERS: Final = frozenset(("ssh",))
"""Kinds that others may go through."""
