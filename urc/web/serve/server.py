"""The HTTP and HTTPS server: uvicorn, run by a coroutine, with small send buffers.

Layer 5. Only this module and `connection` depend on uvicorn. Buffers for unsent data are as small
as possible, because buffered data becomes outdated and cannot be withdrawn.
"""

import asyncio
import contextlib
import ipaddress
import signal
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Protocol, cast

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState

from urc._addresses import local_addresses
from urc.problems import UrcError
from urc.transports.own_listeners import OWN_DOORS
from urc.web.feed.client_socket import SocketFlow
from urc.web.serve.certificates import Certificates
from urc.web.serve.connection import CONNECTIONS, REQUEST_S, HttpConnection
from urc.web.serve.frames import WebSocketFrames, text_of
from urc.web.serve.request_turns import RequestTurns
from urc.web.serve.tls_listener import FirstBytes, Handshakes
from urc.web.serve.tls_port import TlsPort
from urc.web.wire.messages import INBOUND_BYTES

__all__ = ["FurtherPort", "LineDoor", "reachable_urls", "serve"]

SEND_BUFFER_BYTES = 64 * 1024
UNSENT_BYTES = 8 * 1024
HEADER_BYTES = 16 * 1024
PING_EVERY_S = 5.0
PING_TIMEOUT_S = 10.0
GRACE_S = 2
DATE_S = 1.0
BACKLOG = 128
SETUP_TURNS = 2
"""Turns of the event loop until asyncio has set up a connection that it has accepted."""


class FurtherPort(Protocol):
    """An additional port of the server, which the application recognises."""

    wanted: int
    """TCP port; 0 lets the system choose one."""
    flag: str
    """Command-line option that sets the port, for error messages."""

    def opened(self, port: int) -> None:
        """Store the port on which the server listens."""


class LineDoor(Protocol):
    """The way in for lines of other sites; see `urc.web.sites.door.SiteDoor`."""

    def open(self, make: Callable[[Mapping[str, Any]], asyncio.Protocol]) -> None:
        """Serve lines from now on; `make` creates the HTTP protocol of a line."""

    def close(self) -> None:
        """Refuse all further lines."""


async def serve(
    app: ASGIApp,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    on_ready: Callable[[str], None] | None = None,
    request_s: float = REQUEST_S,
    connections: int = CONNECTIONS,
    certificates: Certificates | None = None,
    allowed_hosts: Iterable[str] = (),
    handshakes: Handshakes | None = None,
    further: Sequence[FurtherPort] = (),
    door: LineDoor | None = None,
) -> None:
    """Serve `app` until SIGINT, SIGTERM or cancellation, then close within 3 seconds.

    Args:
        app: an application from `build_app`.
        host: an address or host name of this machine.
        port: TCP port; 0 lets the system choose one.
        on_ready: callback that is called once, with the first of `reachable_urls`, such as
            ``http://127.0.0.1:8080/``.
        request_s: time limit for receiving a complete request, in seconds.
        connections: maximum number of open connections; above this number, a new connection
            replaces an idle connection or gets status 503.
        certificates: certificates for HTTPS; None for plain HTTP.
        allowed_hosts: additional names of this machine, for redirects from plain HTTP to HTTPS.
        handshakes: limits on unfinished handshakes; None for the default limits.
        further: additional ports on the same address.
        door: way in for other sites of the fleet; None for a server without a fleet.

    Raises:
        UrcError: the server cannot listen on the address.
    """
    turns = RequestTurns()
    connection: Callable[..., asyncio.Protocol] = partial(
        HttpConnection, turns=turns, request_s=request_s, most=connections
    )
    line_connection = connection
    if certificates is not None:
        handshakes = handshakes or Handshakes(certificates.context)
        connection = partial(_first_bytes, handshakes, connection)
        app = TlsPort(app, allowed_hosts)
    server = _UvicornServer(_config(app, connection))
    with contextlib.ExitStack() as stack:
        listeners = [_kept(stack, host, port, "--port")]
        for one in further:
            listeners.append(_kept(stack, host, one.wanted, one.flag))
            one.opened(listeners[-1].getsockname()[1])
        stack.enter_context(_ending(server))
        stack.enter_context(_renewed(certificates, handshakes))
        running = asyncio.ensure_future(server.serve(sockets=listeners))
        await _until_ready(server, running)
        if door is not None and server.started:
            stack.callback(door.close)
            door.open(partial(_line_protocol, server, line_connection))
        if on_ready and server.started:
            on_ready(_first_url(listeners[0], "http" if certificates is None else "https"))
        await _follow(server, running)


def _line_protocol(
    server: "_UvicornServer", connection: Callable[..., asyncio.Protocol], state: Mapping[str, Any]
) -> asyncio.Protocol:
    """Return the HTTP protocol for a line of another site, with additions to the request state."""
    return connection(
        config=server.config,
        server_state=server.server_state,
        app_state={**server.lifespan.state, **state},
    )


def _first_url(listener: socket.socket, scheme: str) -> str:
    """Return the first of `reachable_urls`."""
    place, real_port = listener.getsockname()[:2]
    return reachable_urls(place, real_port, scheme)[0]


def _config(app: ASGIApp, connection: Callable[..., asyncio.Protocol]) -> uvicorn.Config:
    """Return the configuration for the HTTP server."""
    return uvicorn.Config(
        app,
        loop="none",
        http=cast("type[asyncio.Protocol]", connection),
        ws=_DashboardSocket,
        ws_max_size=INBOUND_BYTES,
        ws_ping_interval=PING_EVERY_S,
        ws_ping_timeout=PING_TIMEOUT_S,
        ws_per_message_deflate=False,
        lifespan="on",
        log_config=None,
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=GRACE_S,
        h11_max_incomplete_event_size=HEADER_BYTES,
    )


def _first_bytes(
    handshakes: Handshakes, connection: Callable[..., asyncio.Protocol], **options: Any
) -> FirstBytes:
    """Return the protocol for a new connection to a TLS port."""
    return FirstBytes(handshakes, partial(connection, **options))


@contextlib.contextmanager
def _renewed(certificates: Certificates | None, handshakes: Handshakes | None) -> Iterator[None]:
    """Renew the certificate while the context is open, then end all handshakes."""
    if certificates is None or handshakes is None:
        yield
        return
    keeping = asyncio.ensure_future(certificates.keep())
    try:
        yield
    finally:
        keeping.cancel()
        handshakes.close()


class _UvicornServer(uvicorn.Server):
    """A uvicorn server whose main loop waits for an event instead of polling for its end."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._ending = asyncio.Event()

    def end(self) -> None:
        """Close gracefully."""
        self.should_exit = True
        self._ending.set()

    async def main_loop(self) -> None:
        """Update the Date header every second until the server ends."""
        while not await self.on_tick(0):
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(DATE_S):
                    await self._ending.wait()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop accepting, complete the accepted connections, then close all of them.

        asyncio loses a connection that it has accepted but not yet set up when its server closes
        (https://github.com/python/cpython/issues/109564).
        """
        loop = asyncio.get_running_loop()
        for listener in sockets or ():
            loop.remove_reader(listener)
        for _ in range(SETUP_TURNS):
            await asyncio.sleep(0)
        await super().shutdown(sockets)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to `_ending`, because uvicorn's handler would raise each signal again."""
        yield


class _DashboardSocket(WebSocketsSansIOProtocol):
    """A uvicorn WebSocket that has no send queue and calls back when the socket is writable.

    WARNING: this class may use only asyncio's protocol methods and the arguments of the
        constructor; the rest of the base class is private to uvicorn. The application finds the
        socket's `SocketFlow` in ``scope["state"]["flow"]``.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        self._urc_flow = SocketFlow()
        self._urc_frames: WebSocketFrames | None = None
        """Parser of received frames; None during the handshake."""
        super().__init__(config, server_state, {**app_state, "flow": self._urc_flow}, _loop)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport and request a pause as soon as the kernel's buffer is full."""
        super().connection_made(transport)
        self._urc_flow.connected(cast("asyncio.Transport", transport))

    def connection_lost(self, exc: Exception | None) -> None:
        """Wake a waiting writer, which then notices the closed connection."""
        super().connection_lost(exc)
        self._urc_flow.lost()

    def data_received(self, data: bytes) -> None:
        """Pass a complete text message directly to the client; leave all other data to uvicorn."""
        if self._urc_frames is None:
            self._urc_frames = WebSocketFrames()
            super().data_received(data)
            return
        text = self._urc_frames.whole(data)
        sink = self._urc_flow.sink
        if sink is None:
            super().data_received(data)
        elif text is None:
            self._urc_several(data, self._urc_frames.spans, sink)
        elif not sink(text):
            super().data_received(data)

    def _urc_several(
        self, data: bytes, spans: Iterable[tuple[int, int]], sink: Callable[[bytes], bool]
    ) -> None:
        """Pass messages from one read to the client, up to the first refused message."""
        at = 0
        for begin, end in spans:
            if not sink(text_of(data[begin:end])):
                break
            at = end
        if at < len(data):
            super().data_received(data[at:])

    def pause_writing(self) -> None:
        """Notify the client that the kernel accepts no more data."""
        super().pause_writing()
        self._urc_flow.pause()

    def resume_writing(self) -> None:
        """Notify the client that the kernel has accepted all written data."""
        super().resume_writing()
        self._urc_flow.resume()


def _kept(stack: contextlib.ExitStack, host: str, port: int, flag: str) -> socket.socket:
    """Listen until `stack` closes; the robots' transports cannot connect to this port."""
    listener = _listen(host, port, flag)
    stack.callback(listener.close)
    stack.enter_context(OWN_DOORS.kept(listener))
    return listener


def _listen(host: str, port: int, flag: str) -> socket.socket:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise UrcError(f"cannot listen on {host}: {error.strerror or error}") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Accepted sockets inherit these two options.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
        if family == socket.AF_INET6:
            # "::" means every IPv4 and IPv6 address, regardless of the system's default.
            with contextlib.suppress(OSError):  # some systems lack this option
                listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        reason = error.strerror or str(error)
        hint = f"; choose another port with {flag}" if port else ""
        raise UrcError(f"cannot listen on {host} port {port}: {reason}{hint}") from error
    listener.setblocking(False)
    return listener


def reachable_urls(host: str, port: int, scheme: str = "http") -> tuple[str, ...]:
    """Return the URLs of a dashboard that listens on `host`.

    For ``0.0.0.0`` and ``::``, the URLs contain the network addresses of this machine, or the
    loopback address if this machine has none. For any other host, the only URL contains `host`. The
    function finds the addresses without sending packets.

    Args:
        host: the address or name on which the server listens.
        port: the actual port, not 0.
        scheme: ``http`` or ``https``.
    """
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return (_url(scheme, host, port),)
    if not address.is_unspecified:
        return (_url(scheme, host, port),)
    found = [each for each in local_addresses() if each.version <= address.version]
    loopback = ipaddress.ip_address("127.0.0.1" if address.version == 4 else "::1")
    return tuple(_url(scheme, str(each), port) for each in found or [loopback])


def _url(scheme: str, host: str, port: int) -> str:
    return f"{scheme}://[{host}]:{port}/" if ":" in host else f"{scheme}://{host}:{port}/"


async def _until_ready(server: uvicorn.Server, running: "asyncio.Future[None]") -> None:
    while not server.started and not running.done():
        await asyncio.wait((running,), timeout=0.01)


async def _follow(server: _UvicornServer, running: "asyncio.Future[None]") -> None:
    """Wait until the server has ended; on cancellation, close the server gracefully first."""
    try:
        await asyncio.shield(running)
    except asyncio.CancelledError:
        server.end()
        await asyncio.wait((running,), timeout=GRACE_S + 1)
        running.cancel()
        raise


@contextlib.contextmanager
def _ending(server: _UvicornServer) -> Iterator[None]:
    """End the server on SIGINT and SIGTERM while the context is open, where supported."""
    loop = asyncio.get_running_loop()
    caught: list[signal.Signals] = []

    for number in (signal.SIGINT, signal.SIGTERM):
        # In a thread and on Windows, loops have no signal handlers, so the caller's handlers stay
        # in place.
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            loop.add_signal_handler(number, server.end)
            caught.append(number)
    try:
        yield
    finally:
        for number in caught:
            loop.remove_signal_handler(number)
