"""Robots for Python programs, with the same interface in this process and over a server.

`open` opens a robot on a server, and `connect` connects to a robot from this process. The module
`urc.client.sync` offers the same functions without ``async``. Names are imported on first use,
because each opening needs different parts of URC.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urc.client.local import ConnectedRobot, connect, load
    from urc.client.remote import RemoteRobot, open
    from urc.client.robot import AccessDenied, ConnectionLost, RobotInterface
    from urc.client.stick import MotionEnded, Stick
    from urc.runtime.command_failed import CommandFailed

__all__ = [
    "AccessDenied",
    "CommandFailed",
    "ConnectedRobot",
    "ConnectionLost",
    "MotionEnded",
    "RemoteRobot",
    "RobotInterface",
    "Stick",
    "connect",
    "load",
    "open",
]

_MODULES = {
    "AccessDenied": "urc.client.robot",
    "CommandFailed": "urc.runtime.command_failed",
    "ConnectedRobot": "urc.client.local",
    "ConnectionLost": "urc.client.robot",
    "MotionEnded": "urc.client.stick",
    "RemoteRobot": "urc.client.remote",
    "RobotInterface": "urc.client.robot",
    "Stick": "urc.client.stick",
    "connect": "urc.client.local",
    "load": "urc.client.local",
    "open": "urc.client.remote",
}


def __getattr__(name: str) -> object:
    if name in _MODULES:
        from importlib import import_module

        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module 'urc.client' has no attribute {name!r}")
