"""The types of transports in documents, imported only on use."""

from urc.registry import Table

__all__ = ["TRANSPORTS"]

TRANSPORTS = Table(
    "urc.transports",
    {
        "tcp": "urc.transports.tcp:from_setup",
        "udp": "urc.transports.udp:from_setup",
        "serial": "urc.transports.serial:from_setup",
        "ssh": "urc.transports.ssh:from_setup",
        "telnet": "urc.transports.telnet:from_setup",
        "http": "urc.transports.http:from_setup",
        "websocket": "urc.transports.websocket:from_setup",
        "ros": "urc.transports.ros.rosbridge:from_setup",
        "mqtt": "urc.transports.mqtt:from_setup",
    },
)
"""Type → factory, which takes a `urc.transports.base.TransportSetup` and returns a `Transport`."""
