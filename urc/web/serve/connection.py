"""One HTTP connection, with request turns, time limits, and policy headers for refusals.

Layer 5. The module is a thin layer over uvicorn's protocol, used only by `server`. The library
uvicorn refuses invalid HTTP and connections above its limit. Without this layer, uvicorn's refusals
would lack the page policy's headers.
"""

import asyncio
from http import HTTPStatus
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from urc.web.serve.connection_quota import is_stop
from urc.web.serve.policy import REFUSAL_HEADERS
from urc.web.serve.request_turns import RequestTurns

__all__ = ["CONNECTIONS", "REQUEST_S", "RESERVE", "HttpConnection", "refusal"]

CONNECTIONS = 1024
"""Maximum number of open connections, including WebSockets. At the limit, a new connection closes
the oldest idle connection from the address with the most idle connections."""
RESERVE = 64
"""Number of additional connections that accept only STOP, used while no other connection is
idle."""
REQUEST_S = 5.0
"""Time limit for receiving a complete request with its body, in seconds. For the first request, the
time starts when the connection opens; for later requests, with the first byte."""


def refusal(status: HTTPStatus, text: str) -> bytes:
    """Return a complete response with one line of plain text, for a connection that then closes."""
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
    """Return whether a request that begins with `data` is a STOP request."""
    method, _, rest = data.partition(b"\r\n")[0].partition(b" ")
    return is_stop(method.decode("latin-1"), rest.partition(b" ")[0].decode("latin-1"))


class HttpConnection(H11Protocol):
    """uvicorn's HTTP/1.1 protocol, with turns and a time limit for receiving a request.

    The request state has two keys for endless responses. The event ``closing`` is set when the
    server ends. The function ``abort`` closes the connection.

    WARNING: this class depends on asyncio's protocol methods and on private names of its base
        class. The class uses the constructor's arguments and the methods `handle_events`,
        `send_400_response` and `shutdown`. It also uses the attributes `conn`, `connections`,
        `flow`, `loop` and `transport`. The tests in tests/e2e/test_dashboard_server.py and
        tests/e2e/test_api.py fail if one of these names changes.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        turns: RequestTurns,
        request_s: float = REQUEST_S,
        most: int = CONNECTIONS,
    ) -> None:
        self._closing = asyncio.Event()
        state = {**app_state, "abort": self._abort, "closing": self._closing}
        super().__init__(config, server_state, state, _loop)
        self._turns = turns
        self._request_s = request_s
        self._most = most
        self._alarm: asyncio.TimerHandle | None = None
        self._is_one_too_many = False
        self._has_spoken = False
        self._is_urgent = False
        """Whether the last received bytes begin a STOP request."""
        self.made_s = 0.0
        """Time at which the connection opened, on the event loop's clock."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Store the transport, and start the time limit for the first request."""
        super().connection_made(transport)
        self.made_s = self.loop.time()
        if len(self.connections) > self._most and not self._make_room():
            self._is_one_too_many = True
            if len(self.connections) > self._most + RESERVE:
                transport.abort()
                return
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Process received bytes and check whether the request is complete."""
        self._has_spoken = True
        self._is_urgent = _stops(data)
        if self._is_one_too_many and not self._is_urgent:
            # An earlier refusal would be lost, because the client must write its request first.
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "Too many connections are open.")
            return
        super().data_received(data)
        self._watch()

    def handle_events(self) -> None:
        """Read the requests in the received bytes: STOP immediately, all others in turn."""
        if self._is_urgent:
            super().handle_events()
        elif not self._turns.take(self, self._handle_events):
            self.flow.pause_reading()  # the turn resumes reading

    def _handle_events(self) -> None:
        if self.transport.is_closing():
            return
        self.flow.resume_reading()
        super().handle_events()
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the lost connection from the queue, and cancel its request's time limit."""
        self._turns.remove(self)
        self._unwatch()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:
        """Refuse invalid HTTP; the base class calls this method."""
        self._refuse(HTTPStatus.BAD_REQUEST, msg)

    def shutdown(self) -> None:
        """Allow the response in progress to finish; called when the server ends."""
        super().shutdown()
        self._closing.set()

    def _abort(self) -> None:
        """Close the connection immediately, without waiting for an unresponsive reader."""
        self.transport.abort()

    def _make_room(self) -> bool:
        """Close an idle connection; return False if no connection is idle."""
        waiting: dict[str, list[HttpConnection]] = {}
        for one in self.connections:
            if isinstance(one, HttpConnection) and one is not self and one.only_waits:
                peer = one.transport.get_extra_info("peername") or ("",)
                waiting.setdefault(str(peer[0]), []).append(one)
        if not waiting:
            return False
        most = max(waiting.values(), key=len)
        min(most, key=lambda one: one.made_s).transport.abort()
        return True

    @property
    def only_waits(self) -> bool:
        """Return whether the connection is idle, without a complete request in progress."""
        is_ours = self.transport.get_protocol() is self and not self.transport.is_closing()
        return is_ours and self.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def _watch(self) -> None:
        """Start the time limit if a request is incomplete; otherwise, cancel it."""
        is_ours = self.transport.get_protocol() is self  # otherwise a WebSocket
        is_open = self.conn.their_state in (h11.IDLE, h11.SEND_BODY)
        if not (is_ours and is_open) or self.transport.is_closing():
            self._unwatch()
        elif self._alarm is None:
            self._alarm = self.loop.call_later(self._request_s, self._timed_out)

    def _unwatch(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _timed_out(self) -> None:
        self._alarm = None
        if self._has_spoken:
            text = f"The request did not arrive within {self._request_s:g} s."
            self._refuse(HTTPStatus.REQUEST_TIMEOUT, text)
        else:  # a browser that connects in advance would treat an early response as a fault
            self.transport.close()

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        self._unwatch()
        if self.transport.is_closing():
            return
        if self.conn.our_state is h11.IDLE:
            self.transport.write(refusal(status, text))
            self.transport.close()
        else:  # the application is responding, and a second response would corrupt the first
            self.transport.abort()
