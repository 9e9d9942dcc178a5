"""The table of transport types in documents; each type is imported only when used."""

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
        "ros": "urc.transports.ros.choice:from_setup",
        "mqtt": "urc.transports.mqtt:from_setup",
        "zenoh": "urc.transports.zenoh:from_setup",
        "camera": "urc.transports.camera:from_setup",
    },
)
"""Factories by transport type; each factory returns a `Transport` for a
`urc.transports.base.TransportSetup`.
"""
