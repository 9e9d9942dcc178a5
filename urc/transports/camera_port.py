"""The local UDP port of a camera, which the server binds and the camera's process reads.

The process inherits the socket, so no datagram costs the server's event loop. It only receives:
see `urc.transports.datagram_source`.
"""

import asyncio
import socket
import sys
from base64 import b64encode
from contextlib import suppress
from typing import Final, NamedTuple

from urc.transports._faults import explain, place_of, reason
from urc.transports._lookup import AddressLookup
from urc.transports.base import ConnectFailed
from urc.transports.camera_options import CameraOptions

__all__ = ["CameraPort", "listen"]

_WAITING_BYTES: Final = 1_048_576
"""Wanted size of the system's buffer: datagrams wait there while the process starts."""


class CameraPort(NamedTuple):
    """A bound socket, and the permitted senders."""

    line: socket.socket
    senders: tuple[str, ...]
    """IP addresses; empty if any sender is permitted."""

    def shared(self, process: int) -> str:
        """Return the words with which a process finds the socket (`datagram_source.inherited`)."""
        if sys.platform == "win32":
            return b64encode(self.line.share(process)).decode("ascii")
        return str(self.line.fileno())


async def listen(options: CameraOptions, timeout_s: float) -> CameraPort:
    """Bind the local port of a camera whose scheme is ``udp``.

    Raises:
        ConnectFailed: the sender is unknown, or the system refuses the port.
    """
    bind, port, sender = options.place.host, options.place.port, options.sender
    family, senders = socket.AF_INET6 if ":" in bind else socket.AF_INET, frozenset[str]()
    if sender:
        try:
            async with asyncio.timeout(timeout_s):
                rows = await AddressLookup(sender, 0, socket.SOCK_DGRAM).addresses()
        except TimeoutError as fault:
            raise ConnectFailed(f"no answer to the address lookup of {sender}") from fault
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(explain(sender, sender, fault)) from fault
        if not bind:
            family = min((one for one, _ in rows), key=lambda one: one != socket.AF_INET)
        senders = frozenset(str(address[0]).partition("%")[0] for _, address in rows)
    return CameraPort(_bound(family, bind, port), tuple(sorted(senders)))


def _bound(family: socket.AddressFamily, bind: str, port: int) -> socket.socket:
    bind = bind or ("::" if family == socket.AF_INET6 else "0.0.0.0")  # noqa: S104
    line = socket.socket(family, socket.SOCK_DGRAM)
    try:
        with suppress(OSError):  # a smaller buffer works, too
            line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _WAITING_BYTES)
        line.bind((bind, port))
    except OSError as fault:
        line.close()
        raise ConnectFailed(
            f"cannot listen on udp {place_of(bind, port)} ({reason(fault)})"
        ) from fault
    return line
