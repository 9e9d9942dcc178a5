"""The datagrams of a camera as a stream of bytes, in the camera's process.

The server has bound the socket (`urc.transports.camera_port`). This process only receives.
"""

import socket
import sys
from base64 import b64decode
from collections.abc import Iterable
from typing import Final

from urc.video_reader import VideoFault

__all__ = ["FIRST_DATAGRAM_S", "DatagramSource", "inherited"]

FIRST_DATAGRAM_S: Final = 14.0
"""Maximum time until the first datagram, in seconds: less than the server waits for an image."""
_LONGEST: Final = 65_536
_TS_PACKET: Final = 188
_TS_SYNC: Final = 0x47


def inherited(shared: str) -> socket.socket:
    """Return the socket that `CameraPort.shared` names."""
    if sys.platform == "win32":
        return socket.fromshare(b64decode(shared))
    return socket.socket(fileno=int(shared))


class DatagramSource:
    """The content of a camera's datagrams as a stream of bytes for the video library."""

    def __init__(self, line: socket.socket, senders: Iterable[str]) -> None:
        """Read `line`; ignore datagrams whose sender is not in `senders`, unless this is empty."""
        self._line = line
        self._senders = frozenset(senders)
        self._buffer = memoryview(bytearray(_LONGEST))
        self._rest = b""

    def format(self) -> str:
        """Wait for the first datagram, and return the name of the library's demuxer for it.

        Raises:
            VideoFault: no datagram came.
        """
        self._line.settimeout(FIRST_DATAGRAM_S)
        try:
            self._rest = first = self._next()
        except TimeoutError as fault:
            sender = f" from {', '.join(sorted(self._senders))}" if self._senders else ""
            port = self._line.getsockname()[1]
            raise VideoFault(
                f"no datagram{sender} has reached udp port {port} within {FIRST_DATAGRAM_S:g} s"
            ) from fault
        self._line.settimeout(None)
        is_ts = len(first) % _TS_PACKET == 0 and first[0] == _TS_SYNC
        # A stream without a container begins with a NAL unit; H.265 has longer headers.
        return "mpegts" if is_ts else "h264"

    def read(self, size: int) -> bytes:
        """Return at most `size` bytes, of one datagram; wait for the next datagram if necessary."""
        data = self._rest or self._next()
        self._rest = data[size:]
        return data[:size]

    def _next(self) -> bytes:
        """Return the next datagram of a permitted sender."""
        while True:
            try:
                if not self._senders:
                    count, is_permitted = self._line.recv_into(self._buffer), True
                else:
                    count, sender = self._line.recvfrom_into(self._buffer)
                    is_permitted = str(sender[0]).partition("%")[0] in self._senders
            except ConnectionError:
                continue  # Windows reports refusals of other programs' datagrams
            if count and is_permitted:
                return bytes(self._buffer[:count])
