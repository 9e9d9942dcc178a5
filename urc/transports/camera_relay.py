"""The relay between the video library and an RTSP connection that URC has opened.

The library would open its connections itself and would follow redirects to other hosts. URC
therefore opens the connection with its own code, which also provides TLS and tunnels. The library
connects to this relay over the loopback interface. The relay accepts one connection.
"""

import asyncio
import re
import socket
from collections.abc import Coroutine
from typing import Any, Final

from urc.transports._faults import one_line
from urc.transports.base import ByteStream, PeerClosed, TransportError
from urc.transports.rtsp_delimiters import UnitDelimiters

__all__ = ["RtspRelay", "RtspWatch"]

_PIECE_BYTES: Final = 65536
_ACCEPT_S: Final = 10.0
_KEPT_BYTES: Final = 16
"""Number of bytes that are searched again with the next data: the length of a status line's
beginning."""
_REDIRECT: Final = re.compile(rb"(?:\A|\n)RTSP/1\.[01] 30[1-8]")
_LOCATION: Final = re.compile(rb"\nLocation[ \t]*:[ \t]*([^\r\n]{1,2000})", re.IGNORECASE)
_PLAIN_LOGIN: Final = re.compile(rb"\nAuthorization[ \t]*:[ \t]*Basic\b", re.IGNORECASE)


class RtspWatch:
    """Finds what a camera must not make the library do, in both directions of a connection."""

    def __init__(self, *, refuses_basic: bool) -> None:
        """Create a watch; `refuses_basic` forbids that the password leaves as plain text."""
        self._refuses_basic = refuses_basic
        self._heard = b""
        self._said = b""

    def received(self, data: bytes) -> str:
        """Return why bytes from the camera must not reach the library; "" if they may."""
        text = self._heard + data
        found = _REDIRECT.search(text)
        if found is not None:
            where = _LOCATION.search(text, found.start())
            target = one_line(where[1].decode("latin-1")) if where else "another address"
            return (
                f"the camera redirects to {target}; URC follows no redirects: write that address"
                " as url if it is yours"
            )
        self._heard = text[-_KEPT_BYTES:]
        return ""

    def sent(self, data: bytes) -> str:
        """Return why bytes from the library must not reach the camera; "" if they may."""
        if not self._refuses_basic:
            return ""
        text = self._said + data
        self._said = text[-64:]
        if _PLAIN_LOGIN.search(text):
            return (
                "the camera asks for the password as plain text, but auth says digest: write"
                " type: basic only if the network is yours"
            )
        return ""


class RtspRelay:
    """The relay of one connection."""

    def __init__(self, stream: ByteStream, watch: RtspWatch) -> None:
        """Initialise the relay, which owns `stream` from now on."""
        self._stream = stream
        self._watch = watch
        self._delimiters = UnitDelimiters()
        self._loop = asyncio.get_running_loop()
        self._listener: socket.socket | None = None
        self._task: asyncio.Task[None] | None = None
        self.fault = ""
        """Why the relay ended; "" if the library ended it."""

    def listen(self) -> int:
        """Open the relay's loopback port and return its number.

        Raises:
            TransportError: the system refuses the socket.
        """
        try:
            self._listener = socket.create_server(("127.0.0.1", 0), backlog=1)
        except OSError as fault:
            raise TransportError(f"no local port for the video library ({fault})") from fault
        self._listener.setblocking(False)
        self._task = asyncio.create_task(self._run(self._listener))
        return int(self._listener.getsockname()[1])

    async def close(self) -> None:
        """Close both sides immediately. The method never raises."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        self._close_listener()
        await self._stream.abort()

    def _close_listener(self) -> None:
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.close()

    async def _run(self, listener: socket.socket) -> None:
        try:
            async with asyncio.timeout(_ACCEPT_S):
                end, _ = await self._loop.sock_accept(listener)
        except (OSError, TimeoutError):
            await self._stream.abort()
            return
        finally:
            self._close_listener()  # one connection only: the library cannot reconnect
        end.setblocking(False)
        try:
            async with asyncio.TaskGroup() as ways:
                outward = ways.create_task(self._until_ended(self._out(end)))
                inward = ways.create_task(self._until_ended(self._back(end)))
                outward.add_done_callback(lambda _: inward.cancel())
                inward.add_done_callback(lambda _: outward.cancel())
        finally:
            end.close()
            await self._stream.abort()

    async def _until_ended(self, way: Coroutine[Any, Any, None]) -> None:
        try:
            await way
        except PeerClosed as fault:
            self.fault = self.fault or str(fault)
        except OSError:
            return  # the library has closed its socket

    async def _out(self, end: socket.socket) -> None:
        while data := await self._loop.sock_recv(end, _PIECE_BYTES):
            if fault := self._watch.sent(data):
                raise PeerClosed(fault)
            await self._stream.write(data)

    async def _back(self, end: socket.socket) -> None:
        while True:
            data = await self._stream.read()
            if fault := self._watch.received(data):
                raise PeerClosed(fault)
            await self._loop.sock_sendall(end, self._delimiters.passed(data))
