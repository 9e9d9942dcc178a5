"""The kind and address of a robot's connection, as one short text for the robot's card.

Layer 5. Pure. The text comes from the settings, because the menu connects to no robot.
"""

from collections.abc import Mapping
from typing import Final
from urllib.parse import urlsplit

from urc.expressions import ExpressionError
from urc.model.driver import TransportSpec
from urc.model.values import Value
from urc.protocol.forms.json_text import filled
from urc.web.fleet.robots import Robot

__all__ = ["robot_address"]

_KINDS: Final = {
    "tcp": "TCP",
    "udp": "UDP",
    "serial": "Serial",
    "ssh": "SSH",
    "telnet": "Telnet",
    "http": "HTTP",
    "websocket": "WebSocket",
    "ros": "ROS",
    "mqtt": "MQTT",
    "zenoh": "Zenoh",
    "camera": "Camera",
}
"""Displayed name of each type of transport; a third-party type has its own name."""


def robot_address(robot: Robot) -> str:
    """Return the kind and address of a robot's first connection, such as ``TCP 10.0.0.5:6789``.

    The address of an emulated robot is left out, because URC doesn't connect to this address. An
    address with a missing or secret setting is left out, too. A robot without a transport has no
    text.
    """
    specs = robot.profile.driver.transports.values()
    spec = next((one for one in specs if not one.tunnel), None)
    if spec is None:
        return ""
    kind = _KINDS.get(spec.type, spec.type)
    if robot.is_emulated:
        return kind
    declared = robot.profile.settings
    known = {
        name: value
        for name, value in robot.settings.items()
        if name not in declared or not declared[name].is_secret
    }
    return f"{kind} {_place(spec, known)}".strip()


def _place(spec: TransportSpec, settings: Mapping[str, Value]) -> str:
    host, port = (_text(spec, name, settings) for name in ("host", "port"))
    url = _text(spec, "url", settings)
    if url and not host:
        return _host_of(url)
    if host and port:
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    return host or port


def _text(spec: TransportSpec, name: str, settings: Mapping[str, Value]) -> str:
    """Return an option as text; "" if it is missing or depends on a missing setting."""
    try:
        value = filled(spec.options.get(name), {"settings": settings})
    except ExpressionError:
        return ""
    return str(value) if isinstance(value, (str, int)) else ""


def _host_of(url: str) -> str:
    """Return the host and port of a URL, without a user, a path or a query."""
    try:
        return urlsplit(url).netloc.rpartition("@")[2]
    except ValueError:
        return ""
