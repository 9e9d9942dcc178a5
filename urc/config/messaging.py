"""Message transports and the message forms that they allow.

`MESSAGING` contains only built-in transports. A transport from a package allows every message form.
"""

from typing import Final, NamedTuple

__all__ = ["BYTE_LINES", "CARRIERS", "MESSAGING", "VIDEO_TYPES"]
__all__ += ["MessageTransportRules"]


class MessageTransportRules(NamedTuple):
    """The allowed message forms of one transport type."""

    verbs: tuple[str, ...]
    """Allowed keys under ``send``, such as ``publish``."""
    listen: tuple[str, ...]
    """Allowed keys under ``subscribe``, in addition to ``topic``."""


MESSAGING: Final = {
    "ros": MessageTransportRules(
        ("publish", "call", "goal", "cancel"), ("type", "throttle", "queue_length", "compression")
    ),
    "mqtt": MessageTransportRules(("publish",), ("qos",)),
    "zenoh": MessageTransportRules(("publish", "get"), ("liveliness",)),
    "http": MessageTransportRules(("request",), ("stream", "every")),
}
BYTE_LINES: Final = frozenset(("tcp", "udp", "serial", "ssh", "telnet", "websocket", "camera"))
VIDEO_TYPES: Final = {
    "foxglove.CompressedVideo",
    "ffmpeg_image_transport_msgs/FFMPEGPacket",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket",
}
"""Types of messages over ``ros`` that contain an access unit of a video."""
CARRIERS: Final = frozenset(("ssh",))
"""Transport types that can be tunnels."""
