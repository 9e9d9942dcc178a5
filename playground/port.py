"""The server's end of a page's WebSocket, over a message port instead of a network.

`PortSocket` is both the socket and the flow control of a `BrowserClient`. The page's end is
`port_server.js`.
"""

import asyncio
from collections.abc import Callable, Iterator
from typing import Protocol

from starlette.types import Message

__all__ = ["Port", "PortSocket", "frames"]

_TEXT = 0x1


class Port(Protocol):
    """The functions of the page's end, called with one message each."""

    def text(self, data: str) -> None:
        """Pass a text message to the page."""

    def binary(self, data: bytes) -> None:
        """Pass a binary message to the page."""

    def closed(self, code: int, reason: str) -> None:
        """Report the end of the socket to the page; called once."""


class PortSocket:
    """An accepted socket, with messages of the page from `take`."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._arrived: asyncio.Queue[Message] = asyncio.Queue()
        self._sink: Callable[[bytes], bool] | None = None
        self._is_closed = False

    # -- the page's side

    def take(self, text: str) -> None:
        """Handle a text message of the page."""
        if self._sink is None or not self._arrived.empty() or not self._sink(text.encode()):
            self._arrived.put_nowait({"type": "websocket.receive", "text": text})

    def hang_up(self, code: int = 1005) -> None:
        """Handle the end of the page, or of its socket."""
        self._is_closed = True
        self._arrived.put_nowait({"type": "websocket.disconnect", "code": code})

    # -- the socket of a client

    async def receive(self) -> Message:
        """Return the next message of the page."""
        return await self._arrived.get()

    async def send_text(self, data: str) -> None:
        """Send one text message."""
        if not self._is_closed:
            self._port.text(data)

    async def close(self, code: int = 1000, reason: str | None = None) -> None:
        """End the socket with a reason."""
        if not self._is_closed:
            self._port.closed(code, reason or "")
            self.hang_up(code)

    # -- its flow control

    def is_free(self) -> bool:
        """Return True, because a port takes everything."""
        return True

    async def drained(self) -> None:
        """Let the page's messages in, because a port takes everything."""
        await asyncio.sleep(0)

    def write(self, frame: bytes) -> None:
        """Send whole WebSocket frames."""
        if self._is_closed:
            return
        for is_text, data in frames(frame):
            if is_text:
                self._port.text(data.decode())
            else:
                self._port.binary(data)

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        """Pass each message of the page to `sink` first."""
        self._sink = sink

    def notify(self, freed: Callable[[], None]) -> None:
        """Do nothing, because a port never pauses."""

    def hold_back(self, is_held: bool) -> None:
        """Do nothing: the page samples its input once a frame, and a worker keeps up with that."""

    def abort(self) -> None:
        """End the socket at once."""
        if not self._is_closed:
            self._port.closed(1006, "")
            self.hang_up(1006)


def frames(data: bytes) -> Iterator[tuple[bool, bytes]]:
    """Yield kind and content of unmasked, unfragmented WebSocket frames (RFC 6455, section 5.2)."""
    at = 0
    while at < len(data):
        is_text, size = data[at] & 0x0F == _TEXT, data[at + 1]
        at += 2
        if size >= 126:
            length = 2 if size == 126 else 8
            size = int.from_bytes(data[at : at + length], "big")
            at += length
        yield is_text, data[at : at + size]
        at += size
