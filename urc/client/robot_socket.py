"""The WebSocket of a server's robot, reopened after each loss, with one writer.

Layer 5. Theory of operation. `run` reopens the socket after increasing delays with jitter, so that
many programs do not reconnect at the same moment. Pings detect a dead connection within 4 s, but
motion does not rely on pings. The writer sends a message only after the kernel has accepted the
previous message. Meanwhile, a newer tick of the same command replaces the waiting tick.
"""

import asyncio
import random
import ssl
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import (
    ConnectionClosed,
    InvalidHandshake,
    InvalidStatus,
    WebSocketException,
)

from urc import __version__
from urc.client.address import ServerAddress
from urc.client.robot import AccessDenied, ConnectionLost
from urc.problems import printable
from urc.wire.server_messages import CLOSE_BAD_MESSAGES, CLOSE_NO_ROBOT, CLOSE_NOT_LET_IN

__all__ = ["RobotSocket"]

_FIRST_WAIT_S: Final = 0.25
_LONGEST_WAIT_S: Final = 5.0
_JITTER: Final = (0.8, 1.2)
_PING_S: Final = 1.0
_SILENT_S: Final = 3.0
_MOST_BYTES: Final = 16 * 1024 * 1024
"""Longest accepted message, in bytes; the longest messages are images."""
_GOODBYE_S: Final = 1.0
_FOR_GOOD: Final = (CLOSE_BAD_MESSAGES, CLOSE_NO_ROBOT, CLOSE_NOT_LET_IN)
_DENIED: Final = (401, 403)
_encode = msgspec.json.Encoder().encode


class RobotSocket:
    """The WebSocket to a server's robot, which is reopened after each loss."""

    def __init__(
        self,
        address: ServerAddress,
        robot: str,
        token: str,
        context: ssl.SSLContext | None,
        *,
        timeout_s: float,
    ) -> None:
        """Prepare the socket.

        Args:
            address: the server.
            robot: the robot's name; "" for the server's only robot.
            token: the program's token; "" for none.
            context: TLS context; None for an unencrypted connection.
            timeout_s: longest duration of one attempt to connect, in seconds.
        """
        self.address = address
        self.on_message: Callable[[str | bytes], None] = _ignore
        """Callback that receives each message, in order."""
        self.on_lost: Callable[[str], None] = _ignore
        """Callback that receives the reason when the connection is lost."""
        self.is_up = False
        """Whether the server has sent its first message on this connection; set by the owner."""
        self._robot = robot
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._context = context
        self._timeout_s = timeout_s
        self._line: ClientConnection | None = None
        self._outbox: deque[bytes] = deque()
        self._ticks: dict[str, bytes] = {}
        self._final = ""
        self._filled = asyncio.Event()

    # -- sending

    def send(self, message: msgspec.Struct) -> bool:
        """Queue a message if the connection is up; return whether the connection is up."""
        if self.is_up:
            self._outbox.append(_encode(message))
            self._filled.set()
        return self.is_up

    def offer_tick(self, command: str, message: msgspec.Struct) -> None:
        """Send a tick as soon as possible; replace a waiting tick of `command`."""
        if self.is_up:
            self._ticks[command] = _encode(message)
            self._filled.set()

    def drop_tick(self, command: str) -> None:
        """Drop a waiting tick of `command`."""
        self._ticks.pop(command, None)

    async def _write(self, line: ClientConnection) -> None:
        with suppress(ConnectionClosed):
            while True:
                await self._filled.wait()
                self._filled.clear()
                while self._outbox or self._ticks:
                    data = (
                        self._outbox.popleft()
                        if self._outbox
                        else self._ticks.pop(next(iter(self._ticks)))
                    )
                    await line.send(data, text=True)

    # -- the connection

    async def run(self) -> None:
        """Keep the connection open, and reopen it after each loss, until cancelled.

        Raises:
            ConnectionLost: the first attempt failed, or the server ended the connection
                permanently.
        """
        wait_s, was_up = _FIRST_WAIT_S, False
        while True:
            fault = await self._converse()
            was_up = was_up or self.is_up
            if self.is_up:
                wait_s = _FIRST_WAIT_S
            self.is_up = False
            self._outbox.clear()
            self._ticks.clear()
            self.on_lost(str(fault))
            if isinstance(fault, AccessDenied) or fault.is_final or not was_up:
                raise fault
            await asyncio.sleep(wait_s * random.uniform(*_JITTER))  # noqa: S311 - no secret
            wait_s = min(wait_s * 2, _LONGEST_WAIT_S)

    async def _converse(self) -> ConnectionLost:
        """Connect, and pass received messages to the callback until a loss; return the reason."""
        try:
            async with self._connected() as line:
                self._line = line
                writing = asyncio.create_task(self._write(line))
                try:
                    with suppress(ConnectionClosed):
                        async for message in line:
                            self.on_message(message)
                finally:
                    writing.cancel()
                    self._line = None
                return self._closed(line)
        except (OSError, TimeoutError, WebSocketException) as error:
            return self._explained(error)

    def _connected(self) -> connect:
        address = self.address
        # An empty buffer before each tick keeps the newest tick first.
        more: dict[str, Any] = {"ssl": self._context} if self._context is not None else {}
        return connect(
            address.socket(self._robot),
            additional_headers=self._headers,
            user_agent_header=f"urc/{__version__}",
            compression=None,
            proxy=None if address.is_loopback else True,
            open_timeout=self._timeout_s,
            close_timeout=_GOODBYE_S,
            ping_interval=_PING_S,
            ping_timeout=_SILENT_S,
            max_size=_MOST_BYTES,
            write_limit=0,
            **more,
        )

    def _explained(self, error: Exception) -> ConnectionLost:
        where = self.address.url
        if isinstance(error, InvalidStatus):
            status = error.response.status_code
            if status in _DENIED:
                return AccessDenied(f"{where} does not accept the token (HTTP {status})")
            return ConnectionLost(f"{where} answered with HTTP {status}")
        if isinstance(error, ssl.SSLCertVerificationError):
            return ConnectionLost(
                f"the certificate of {where} is not trusted: {error.verify_message};"
                " specify the file of the server's authority"
            )
        if isinstance(error, TimeoutError):
            return ConnectionLost(f"{where} did not answer within {self._timeout_s:g} s")
        if isinstance(error, InvalidHandshake):
            return ConnectionLost(f"{where} is not a URC server: {printable(str(error))}")
        why = getattr(error, "strerror", None) or error
        return ConnectionLost(f"cannot reach {where}: {printable(str(why))}")

    def _closed(self, line: ClientConnection) -> ConnectionLost:
        code, reason = line.close_code, printable(line.close_reason or "")
        if code == CLOSE_NOT_LET_IN:
            # The server's own text is meant for people using a browser.
            return AccessDenied(
                f"{self.address.url} does not accept the token: it is unknown, removed or expired"
            )
        fault = ConnectionLost(self._final or reason or "the server closed the connection")
        fault.is_final = bool(self._final) or code in _FOR_GOOD
        return fault

    def fail(self, reason: str) -> None:
        """End the connection permanently."""
        self._final = reason
        self.abort()

    async def close(self) -> None:
        """Close the connection; `run` must be cancelled afterwards."""
        if self._line is not None:
            await self._line.close()

    def abort(self) -> None:
        """Cut the connection at once, so that the server stops the robot; `run` reopens it."""
        if self._line is not None:
            self._line.transport.abort()


def _ignore(_: object) -> None:
    """Ignore an event for which the owner has not yet set a callback."""
