"""An emulated camera's video in UDP datagrams, to the port on which the driver listens.

The datagrams contain H.264 without a container, as those of drones do.
"""

import asyncio
import logging
import socket
from typing import Final

from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.udp import reachable
from urc.simulator.servers.video_encoder import EncodedUnit

__all__ = ["PROBE", "DatagramReceiver"]

_DATAGRAM: Final = 1460
"""Maximum number of bytes in a datagram, as sent by the Tello."""
PROBE: Final = b"\0\0\0\1\x09\xf0"
"""An access unit delimiter, which decoders skip (ITU-T H.264, 7.3.2.4)."""

log = logging.getLogger(__name__)


class DatagramReceiver:
    """The port to which a camera sends; the host is the robot's last peer.

    The system reports a refused datagram only with the next call. While datagrams are refused, the
    camera therefore sends probes, and no image is encoded.
    """

    def __init__(self, context: ServerContext, port: int) -> None:
        self.needs_key = True
        self._context = context
        self._port = port
        self._line = context.line()
        self._target = ""
        """Host to which the socket is connected; "" before the first probe."""
        self._socket: socket.socket | None = None

    def is_ready(self) -> bool:
        """Return whether a program listens on the port, as far as the system knows."""
        host = reachable(self._context.host)
        if self._context.last_peer is not None and self._context.last_peer.host:
            host = self._context.last_peer.host
        if self._socket is None or host != self._target:
            self._connect(host)
        elif not self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            return True
        self.needs_key = True
        self._send(PROBE)
        return False

    def take(self, image: EncodedUnit) -> None:
        """Send an image, after the injected delay and without the datagrams that a fault drops."""
        if self._line.delay_s:
            loop = asyncio.get_running_loop()
            loop.call_later(self._line.delay_s, self._send_image, image.data)
        else:
            self._send_image(image.data)

    def close(self) -> None:
        """Close the socket; the method may be called twice."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _connect(self, host: str) -> None:
        self.close()
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._target, self._socket = host, socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((self._context.host, 0))
            self._socket.connect((host, self._port))
        except OSError as fault:
            self.close()
            log.info("transport %s: no way to %s (%s)", self._context.name, host, fault)

    def _send_image(self, data: bytes) -> None:
        if len(data) % _DATAGRAM == 0:
            data += b"\0"  # programs take a shorter datagram for the end of an image
        for start in range(0, len(data), _DATAGRAM):
            if not self._line.loses:
                self._send(data[start : start + _DATAGRAM])

    def _send(self, data: bytes) -> None:
        try:
            if self._socket is not None:
                self._socket.send(data)
        except OSError:
            self.needs_key = True  # refused, or lost on this computer, as UDP permits
