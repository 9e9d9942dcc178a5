"""One HTTP connection: a request must be whole in time, and every refusal carries our headers.

Floor 5. A thin layer over uvicorn's protocol; only `server` uses it. What uvicorn answers by
itself, before any application is asked, would otherwise go out without the page policy: a request
that is no HTTP, and one connection too many.
"""

import asyncio
from http import HTTPStatus
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from urc.web.serve.crowd import is_stop
from urc.web.serve.policy import REFUSAL_HEADERS

__all__ = ["CONNECTIONS", "REQUEST_S", "RESERVE", "Connection", "refusal"]

CONNECTIONS = 1024
"""How many may be open at once, WebSockets included. One more closes one that only waits: of the
address that has most of these, the oldest."""
RESERVE = 64
"""How many more may be made while none of them only waits, to say STOP and nothing else."""
REQUEST_S = 5.0
"""In which a connection must bring a whole request, its body too: the first one from the moment it
is made, each later one from its first byte."""


def refusal(status: HTTPStatus, text: str) -> bytes:
    """Return a whole answer of one line of plain text, after which the connection closes."""
    body = text.encode() + b"\n"
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
        (b"cache-control", b"no-store"),
        (b"connection", b"close"),
        *REFUSAL_HEADERS,
    ]
    lines = b"".join(name + b": " + value + b"\r\n" for name, value in headers)
    return f"HTTP/1.1 {status.value} {status.phrase}\r\n".encode() + lines + b"\r\n" + body


def _stops(data: bytes) -> bool:
    """Return whether a request that begins so is a STOP."""
    method, _, rest = data.partition(b"\r\n")[0].partition(b" ")
    return is_stop(method.decode("latin-1"), rest.partition(b" ")[0].decode("latin-1"))


class Connection(H11Protocol):
    """uvicorn's HTTP/1.1, with a limit on the time that a request takes to arrive.

    WARNING: of the base class this uses asyncio's own protocol methods, the constructor's
    arguments, `send_400_response`, and the attributes `conn`, `connections`, `loop` and
    `transport`. tests/e2e/test_dashboard_server.py fails when one of them changes its meaning.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        request_s: float = REQUEST_S,
        most: int = CONNECTIONS,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self._request_s = request_s
        self._most = most
        self._alarm: asyncio.TimerHandle | None = None
        self._is_one_too_many = False
        self._has_spoken = False
        self.made_s = 0.0
        """When it was made, by the clock of the loop."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take the transport, and expect a request."""
        super().connection_made(transport)
        self.made_s = self.loop.time()
        if len(self.connections) > self._most and not self._make_room():
            self._is_one_too_many = True
            if len(self.connections) > self._most + RESERVE:
                transport.abort()
                return
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Take what came, and see whether the request is whole now."""
        self._has_spoken = True
        if self._is_one_too_many and not _stops(data):
            # Not earlier: an answer to nothing is lost when the request then meets a closed door.
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "Too many connections are open.")
            return
        super().data_received(data)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the clock."""
        self._unwatch()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:
        """Say that this is no HTTP; called by the base class."""
        self._refuse(HTTPStatus.BAD_REQUEST, msg)

    def _make_room(self) -> bool:
        """Close one that only waits, if there is one; return whether there was."""
        waiting: dict[str, list[Connection]] = {}
        for one in self.connections:
            if isinstance(one, Connection) and one is not self and one.only_waits:
                peer = one.transport.get_extra_info("peername") or ("",)
                waiting.setdefault(str(peer[0]), []).append(one)
        if not waiting:
            return False
        most = max(waiting.values(), key=len)
        min(most, key=lambda one: one.made_s).transport.abort()
        return True

    @property
    def only_waits(self) -> bool:
        """Whether no whole request is under way on it."""
        is_ours = self.transport.get_protocol() is self and not self.transport.is_closing()
        return is_ours and self.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def _watch(self) -> None:
        """Let the clock run while a request is not whole, and only then."""
        is_ours = self.transport.get_protocol() is self  # else it has become a WebSocket
        is_open = self.conn.their_state in (h11.IDLE, h11.SEND_BODY)
        if not (is_ours and is_open) or self.transport.is_closing():
            self._unwatch()
        elif self._alarm is None:
            self._alarm = self.loop.call_later(self._request_s, self._give_up)

    def _unwatch(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _give_up(self) -> None:
        self._alarm = None
        if self._has_spoken:
            text = f"The request was not here within {self._request_s:g} s."
            self._refuse(HTTPStatus.REQUEST_TIMEOUT, text)
        else:  # a browser that connects in advance takes an answer to nothing for a fault
            self.transport.close()

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        self._unwatch()
        if self.transport.is_closing():
            return
        if self.conn.our_state is h11.IDLE:
            self.transport.write(refusal(status, text))
            self.transport.close()
        else:  # the application is answering, or has: ours would land in the middle, or behind
            self.transport.abort()
