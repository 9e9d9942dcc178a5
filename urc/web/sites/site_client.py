"""Requests to another site: an HTTP client and a socket relay over TLS on a line.

Layer 5. Each request has a line and a TLS handshake of its own, so a slow response never delays
another request.
"""

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from typing import Any, Final, NamedTuple, cast

import h11

from urc.fleet.bus import Lane
from urc.fleet.lines import Lines, SiteAbsent
from urc.problems import UrcError
from urc.web.serve.site_peer import SitePeer
from urc.web.serve.tls_connection import TlsConnection

__all__ = ["Response", "SiteClient", "SiteFailed", "relayed"]

CONNECT_S: Final = 5.0
"""Time limit for reaching another site, in seconds."""
ANSWER_S: Final = 30.0
"""Time limit for each part of a response, in seconds."""
READ_BYTES: Final = 64 * 1024
MAX_BODY_BYTES: Final = 16 * 1024 * 1024
"""Maximum size of a response that is read whole."""
_Headers = Iterable[tuple[bytes, bytes]]


class SiteFailed(UrcError):
    """The other site cannot be reached, or its response is invalid; the message is one line."""


class Response(NamedTuple):
    """The head of a response; `parts` yields the body."""

    status: int
    headers: list[tuple[bytes, bytes]]
    parts: AsyncIterator[bytes]

    async def whole(self) -> bytes:
        """Return the body; raise `SiteFailed` if it is too large."""
        body = bytearray()
        async for part in self.parts:
            body += part
            if len(body) > MAX_BODY_BYTES:
                raise SiteFailed(f"a response has more than {MAX_BODY_BYTES} bytes")
        return bytes(body)


class SiteClient:
    """Opens lines to other sites, with TLS."""

    def __init__(
        self,
        lines: Lines,
        context_of: Callable[[str], ssl.SSLContext],
        peer: Callable[[bytes], SitePeer],
    ) -> None:
        """Create a client.

        Args:
            lines: the lines of this site.
            context_of: function that returns the TLS context for a site. It checks the fleet's root
                certificate and the site's name.
            peer: function that returns the site of a certificate in DER. It raises `UrcError` for a
                revoked certificate.
        """
        self._lines = lines
        self._peer = peer
        self._context_of = context_of

    @property
    def sites(self) -> frozenset[str]:
        """Names of the other sites that are present."""
        return self._lines.sites

    async def connect(self, site: str, lane: Lane, protocol: asyncio.Protocol) -> TlsConnection:
        """Return a TLS connection to a site, whose protocol has been called.

        Raises:
            SiteFailed: the site is absent, or one end refuses the other's certificate.
        """
        start = _Start(self._context_of(site), site, protocol)
        try:
            line = self._lines.dial(site, lane, start)
            async with asyncio.timeout(CONNECT_S):
                await start.handshake()
        except SiteAbsent as fault:
            raise SiteFailed(str(fault)) from fault
        except TimeoutError:
            start.abort()
            raise SiteFailed(f"the site {site} has not answered within {CONNECT_S:g} s") from None
        except BaseException:
            start.abort()
            raise
        tls = start.connection()
        if not tls.is_ready:
            why = tls.fault or line.reason or "it ended the connection"
            raise SiteFailed(f"no secure connection to the site {site}: {why}")
        der = tls.get_extra_info("ssl_object").getpeercert(binary_form=True)
        try:
            refusal = self._peer(der or b"").refusal()
        except UrcError as error:
            refusal = str(error)
        if refusal:
            tls.abort()
            raise SiteFailed(f"no secure connection to the site {site}: {refusal}")
        return tls

    @asynccontextmanager
    async def request(
        self, site: str, method: str, target: str, headers: _Headers = (), body: bytes = b"",
        *, lane: Lane = "data",
    ) -> AsyncIterator[Response]:  # fmt: skip
        """Send a request, and keep its connection open while the context is open.

        Raises:
            SiteFailed: the site cannot be reached, or its response is invalid.
        """
        reader = asyncio.StreamReader(READ_BYTES)
        tls = await self.connect(site, lane, asyncio.StreamReaderProtocol(reader))
        try:
            talk = h11.Connection(h11.CLIENT)
            sent = [
                (b"host", b"localhost"),
                (b"connection", b"close"),
                (b"content-length", str(len(body)).encode()),
                *headers,
            ]
            data = talk.send(h11.Request(method=method, target=target, headers=sent)) or b""
            if body:
                data += talk.send(h11.Data(data=body)) or b""
            tls.write(data + (talk.send(h11.EndOfMessage()) or b""))
            head = await _next(talk, reader, site)
            while isinstance(head, h11.InformationalResponse):
                head = await _next(talk, reader, site)
            if not isinstance(head, h11.Response):
                raise SiteFailed(f"the site {site} sent no response")
            yield Response(head.status_code, list(head.headers), _parts(talk, reader, site))
        except (h11.RemoteProtocolError, h11.LocalProtocolError) as fault:
            if reason := tls.get_extra_info("line").reason:
                raise SiteFailed(f"the site {site} refuses the connection: {reason}") from fault
            raise SiteFailed(f"the site {site} sent an invalid response ({fault})") from fault
        finally:
            tls.abort()


class _Start(asyncio.Protocol):
    """The protocol of a line until its TLS handshake has ended."""

    def __init__(self, context: ssl.SSLContext, site: str, protocol: asyncio.Protocol) -> None:
        self._context = context
        self._site = site
        self._protocol = protocol
        self._ended = asyncio.Event()
        self._tls: TlsConnection | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        line = cast("asyncio.Transport", transport)
        self._tls = TlsConnection(
            line,
            self._context,
            lambda: self._protocol,
            lambda: self.connection().continue_handshake(),
            self._ended.set,
            hostname=self._site,
        )
        line.set_protocol(self._tls)

    def connection(self) -> TlsConnection:
        """Return the TLS connection, which exists as soon as the line does."""
        if self._tls is None:
            raise RuntimeError("the line has not called `connection_made`")
        return self._tls

    async def handshake(self) -> None:
        """Begin the handshake, and wait for its end."""
        self.connection().continue_handshake()
        await self._ended.wait()

    def abort(self) -> None:
        """End the connection, if there is one."""
        if self._tls is not None:
            self._tls.abort()


async def _parts(
    talk: h11.Connection, reader: asyncio.StreamReader, site: str
) -> AsyncIterator[bytes]:
    while True:
        event = await _next(talk, reader, site)
        if isinstance(event, h11.Data):
            yield bytes(event.data)
        elif isinstance(event, h11.EndOfMessage):
            return
        else:
            raise SiteFailed(f"the response of the site {site} has no end")


async def _next(talk: h11.Connection, reader: asyncio.StreamReader, site: str) -> Any:
    """Return the next event of the response."""
    while True:
        event = talk.next_event()
        if event is not h11.NEED_DATA:
            return event
        try:
            async with asyncio.timeout(ANSWER_S):
                talk.receive_data(await reader.read(READ_BYTES))
        except TimeoutError:
            raise SiteFailed(f"the site {site} has not answered for {ANSWER_S:g} s") from None
        except ConnectionError as fault:
            raise SiteFailed(f"the site {site} refuses the connection: {fault}") from fault


class _Side(asyncio.Protocol):
    """One end of a relay: it copies bytes to the other end's transport."""

    def __init__(self, ended: Callable[[], None]) -> None:
        self._ended = ended
        self.transport: asyncio.Transport | None = None
        self.other: _Side | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast("asyncio.Transport", transport)
        self.transport.set_write_buffer_limits(high=0)

    def data_received(self, data: bytes) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.write(data)

    def pause_writing(self) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.pause_reading()

    def resume_writing(self) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.resume_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.close()
        self._ended()


async def relayed(
    client: SiteClient,
    site: str,
    lane: Lane,
    head: bytes,
    near: asyncio.Transport,
    opened: Callable[[Callable[[], None]], Any] = lambda _: None,
) -> None:
    """Pass a browser's socket to a site, byte by byte, until either end closes.

    Args:
        client: the client.
        site: the robot's site.
        lane: ``control`` for sockets that drive.
        head: the request that opens the socket, with its headers.
        near: the browser's transport, whose protocol is replaced.
        opened: callback with a function that ends the relay.

    Raises:
        SiteFailed: the site cannot be reached. The browser's transport keeps its protocol.
    """
    over = asyncio.Event()
    far_side, near_side = _Side(over.set), _Side(over.set)
    far_side.other, near_side.other = near_side, far_side
    near.pause_reading()
    far = await client.connect(site, lane, far_side)
    near_side.connection_made(near)
    before = near.get_protocol()
    near.set_protocol(near_side)

    def end() -> None:
        far.abort()
        near.abort()

    opened(end)
    far.write(head)
    near.resume_reading()
    try:
        await over.wait()
    finally:
        end()
        before.connection_lost(None)
