"""An HTTP/1.1 client for one server, based on the library `httpx2`: connections, logins, errors.

The client replaces the library's connection handling. Every connection is opened to the server in
the document, even if a request names another host. Redirects and proxy settings from the
environment are ignored. Address lookups do not delay the program's exit.
"""

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from typing import Any
from urllib.parse import unquote

import httpcore2
import httpx2

from urc.transports._faults import HUNG_UP, late, one_line
from urc.transports._stream import TcpStream
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    TransportError,
    ends_of,
    unsent_of,
)
from urc.transports.web_dial import Dialer
from urc.transports.web_origin import Credentials, WebOrigin

__all__ = ["HttpClient", "HttpFault", "leads_up"]

KEPT_S = 3.0
"""Lifetime of an idle connection, in seconds; it is short because small robots close idle
connections after five seconds."""
CONNECT_S = 3.0
"""Maximum time to open a connection, including the TLS handshake, in seconds."""
MAX_COOKIES = 50


class HttpFault(TransportError):
    """Raised if a request fails, with a message for people."""

    def __init__(
        self, text: str, *, is_unreachable: bool = False, is_unanswered: bool = False
    ) -> None:
        """Initialise the error.

        Args:
            text: message for people.
            is_unreachable: whether no connection could be opened.
            is_unanswered: whether a connection was opened, but no usable response arrived.
        """
        super().__init__(text)
        self.is_unreachable = is_unreachable
        self.is_unanswered = is_unanswered


class HttpClient:
    """All HTTP connections of one open transport."""

    def __init__(
        self,
        place: WebOrigin,
        dialer: Dialer,
        *,
        credentials: Credentials | None,
        headers: Mapping[str, str],
        connections: int,
    ) -> None:
        """Initialise without connecting. At most `connections` connections are open at a time."""
        self._place = place
        self._credentials = credentials
        self._backend = _Backend(dialer)
        pool = httpcore2.AsyncConnectionPool(
            ssl_context=_NO_TLS,
            max_connections=connections,
            keepalive_expiry=KEPT_S,
            network_backend=self._backend,
        )
        self._origin = f"http{'s' * place.is_secure}://{place.authority}"
        self._client = httpx2.AsyncClient(
            transport=_PoolTransport(pool),
            auth=_auth(credentials),
            headers={"Accept-Encoding": "identity", "User-Agent": "urc", **headers},
            timeout=httpx2.Timeout(None, connect=CONNECT_S, pool=CONNECT_S),
            follow_redirects=False,
            trust_env=False,
        )

    @property
    def where(self) -> str:
        """Host and port in readable form."""
        return self._place.authority

    async def reach(self, timeout_s: float = CONNECT_S) -> None:
        """Open a connection that the next request will use; raise `ConnectFailed` on failure."""
        await self._backend.reach(timeout_s)

    def ends(self) -> tuple[str, str]:
        """Return the IP addresses of both ends of the connection that `reach` has opened.

        Raises:
            ConnectFailed: the addresses are unknown, or the connection has ended.
        """
        return self._backend.ends()

    def request(
        self, method: str, path: str, headers: Mapping[str, str], body: bytes | None
    ) -> httpx2.Request:
        """Return a request for `path`, relative to the path in the document's URL.

        Raises:
            HttpFault: the request is not valid HTTP, or its path is outside the base path.
        """
        if leads_up(path):
            base = self._base.removeprefix(self._origin)
            raise HttpFault(
                f"{method} {path[:80]!r} would be outside {base or '/'}:"
                " a path must not contain '..'"
            )
        return self._built(method, f"{self._base}/{path.lstrip('/')}", headers, body)

    def follow(
        self, method: str, reference: str, headers: Mapping[str, str], body: bytes | None
    ) -> httpx2.Request:
        """Return a request for a URL from the robot, absolute or relative to the robot's root.

        Raises:
            HttpFault: the request is not valid HTTP, or names another host, port or protocol.
        """
        try:
            base = httpx2.URL(f"{self._base}/")
            url = base.join(reference)
        except (httpx2.InvalidURL, UnicodeError, TypeError, ValueError) as fault:
            raise HttpFault(f"{reference[:80]!r} is not a URL ({fault})") from fault
        if (url.scheme, url.host, url.port, url.userinfo) != (
            base.scheme,
            base.host,
            base.port,
            b"",
        ):
            where = f"{self._place.authority}"
            raise HttpFault(
                f"{one_line(reference)!r} is not on {where}: requests are sent only to the robot"
            )
        return self._built(method, str(url.copy_with(fragment=None)), headers, body)

    @property
    def _base(self) -> str:
        """The document's URL, without a trailing slash."""
        return self._origin + self._place.path.partition("?")[0].rstrip("/")

    def _built(
        self, method: str, target: str, headers: Mapping[str, str], body: bytes | None
    ) -> httpx2.Request:
        path = target.removeprefix(self._origin)
        try:
            url = httpx2.URL(target)
            request = self._client.build_request(method, url, headers=dict(headers), content=body)
        except (httpx2.InvalidURL, UnicodeError, TypeError, ValueError) as fault:
            raise HttpFault(f"{method} {path[:80]!r} is not a valid request ({fault})") from fault
        return request

    @asynccontextmanager
    async def answer(
        self, request: httpx2.Request, silence_s: float | None = None
    ) -> AsyncIterator[httpx2.Response]:
        """Send `request` and yield its response before the body is read.

        Every error inside the context is raised as `HttpFault`.

        Args:
            request: a request returned by `request` or `follow`.
            silence_s: maximum time between two parts of the response, in seconds; None for no
                limit.
        """
        if silence_s is not None:
            request.extensions["timeout"] = {**request.extensions["timeout"], "read": silence_s}
        if len(self._client.cookies.jar) > MAX_COOKIES:
            self._client.cookies.clear()
        try:
            response = await self._sent(request)
            try:
                yield response
            finally:
                await response.aclose()
        except _FAULTS as fault:
            raise self._translated(fault, silence_s or CONNECT_S) from fault

    async def _sent(self, request: httpx2.Request) -> httpx2.Response:
        try:
            return await self._client.send(request, stream=True)
        except (httpcore2.TimeoutException, httpcore2.NetworkError, httpcore2.ProtocolError):
            raise
        except Exception as fault:  # the library hardly validates challenges and cookies
            # Use a new object, because the old object would keep answering an invalid challenge.
            if (fresh := _auth(self._credentials)) is not None:
                self._client.auth = fresh
            if isinstance(fault, _FAULTS):
                raise
            where = self._place.authority
            raise HttpFault(f"{where} sent an invalid response ({_short(fault)})") from fault

    def unsent(self) -> int:
        """Return the number of unacknowledged request bytes."""
        return self._backend.unsent()

    def forget(self) -> None:
        """Close all connections with unsent bytes and discard the bytes."""
        self._backend.forget()

    async def close(self) -> None:
        """Close every connection and discard unsent data. Never raises."""
        await self._backend.close()
        with suppress(Exception):  # connections that are already broken
            await self._client.aclose()

    def _translated(self, fault: Exception, waited_s: float) -> HttpFault:
        where = self._place.authority
        if isinstance(fault, httpcore2.ConnectError | httpcore2.ConnectTimeout):
            return HttpFault(str(fault), is_unreachable=True)
        if isinstance(fault, httpcore2.PoolTimeout):
            return HttpFault(f"all connections to {where} are in use by other requests")
        if isinstance(fault, httpcore2.TimeoutException):
            return HttpFault(late(where, waited_s), is_unanswered=True)
        if isinstance(fault, httpcore2.RemoteProtocolError | httpx2.ProtocolError):
            if "without sending" in str(fault):
                text = "the robot closed the connection without a response"
                return HttpFault(text, is_unanswered=True)
            return HttpFault(f"{where} does not speak HTTP ({_short(fault)})")
        if isinstance(fault, httpcore2.LocalProtocolError | NotImplementedError):
            return HttpFault(f"the request cannot be sent ({_short(fault)})")
        return HttpFault(_short(fault), is_unanswered=True)


def leads_up(path: str) -> bool:
    """Return whether a path contains the segment "." or "..", even if percent-encoded."""
    plain = path.partition("?")[0].partition("#")[0]
    for _ in range(_UNPACKED):  # some servers decode twice
        plain = unquote(plain)
    return any(part in (".", "..") for part in plain.replace("\\", "/").split("/"))


_UNPACKED = 2
_FAULTS = (
    httpcore2.TimeoutException,
    httpcore2.NetworkError,
    httpcore2.ProtocolError,
    httpx2.ProtocolError,
    NotImplementedError,  # Digest with auth-int only
)
_NO_TLS = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
"""An empty TLS context for the connection pool, so that the pool does not load the system's
certificates."""


def _short(fault: Exception) -> str:
    return one_line(str(fault) or "the reason is unknown").rstrip(".")


def _auth(credentials: Credentials | None) -> httpx2.Auth | None:
    if credentials is None:
        return None
    if credentials.kind == "digest":
        return httpx2.DigestAuth(credentials.user, credentials.secret)
    if credentials.kind == "basic":
        return httpx2.BasicAuth(credentials.user, credentials.secret)
    return _Bearer(credentials.header)


class _Bearer(httpx2.Auth):
    def __init__(self, header: str) -> None:
        self._header = header

    def auth_flow(self, request: httpx2.Request) -> Any:  # a generator with the library's types
        request.headers["Authorization"] = self._header
        yield request


class _Backend(httpcore2.AsyncNetworkBackend):
    """A network backend that connects to only one server.

    The first request uses the connection opened by `reach`.
    """

    def __init__(self, dialer: Dialer) -> None:
        self._dialer = dialer
        self._spare: ByteStream | None = None
        self._connections: set[_PooledStream] = set()
        """Open connections that httpcore2 is using."""

    def unsent(self) -> int:
        return sum(one.unsent() for one in self._connections)

    def forget(self) -> None:
        for one in list(self._connections):
            if one.unsent():
                one.drop()

    def _lent(self, stream: ByteStream) -> "_PooledStream":
        made = _PooledStream(stream, self._connections.discard)
        self._connections.add(made)
        return made

    async def reach(self, timeout_s: float) -> None:
        await self.close()
        self._spare = await self._dialer.stream(timeout_s)

    def ends(self) -> tuple[str, str]:
        return ends_of(self._spare)

    async def close(self) -> None:
        spare, self._spare = self._spare, None
        if spare is not None:
            await spare.abort()

    async def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        spare, self._spare = self._spare, None
        if spare is not None:
            connection = self._lent(spare)
            if not connection.is_readable():  # otherwise the robot has closed it
                return connection
            await connection.aclose()
        try:
            return self._lent(await self._dialer.stream(timeout or CONNECT_S))
        except ConnectFailed as fault:
            raise httpcore2.ConnectError(str(fault)) from fault

    async def sleep(self, seconds: float) -> None:
        await asyncio.sleep(seconds)


class _PooledStream(httpcore2.AsyncNetworkStream):
    """A stream with the interface that the connection pool of httpcore2 requires."""

    def __init__(self, stream: ByteStream, ended: Callable[["_PooledStream"], None]) -> None:
        self._stream = stream
        self._ended = ended
        self._early = b""

    async def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        if self._early:
            early, self._early = self._early, b""
            return early
        try:
            async with asyncio.timeout(timeout):
                return await self._stream.read()
        except TimeoutError as fault:
            raise httpcore2.ReadTimeout from fault
        except PeerClosed as ended:
            if str(ended) == HUNG_UP:
                return b""
            raise httpcore2.ReadError(str(ended)) from ended

    async def write(self, buffer: bytes, timeout: float | None = None) -> None:
        if not buffer:
            return
        try:
            async with asyncio.timeout(timeout):
                await self._stream.write(buffer)
        except TimeoutError as fault:
            raise httpcore2.WriteTimeout from fault
        except PeerClosed as ended:
            raise httpcore2.WriteError(str(ended)) from ended

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes; 0 if unknown.

        The result is 0 if the robot has closed the connection, even if the library still holds it.
        """
        stream = self._stream
        return 0 if isinstance(stream, TcpStream) and stream.has_ended else unsent_of(stream)

    def drop(self) -> None:
        """Close the connection and discard unsent data; waiting tasks receive an error.

        A tunnelled connection stays open, because a tunnel preserves the order of data.
        """
        if isinstance(self._stream, TcpStream):
            self._ended(self)
            self._stream.drop()

    async def aclose(self) -> None:
        if self.unsent():  # a dropped request would arrive late, after newer ones
            self.drop()
        self._ended(self)
        await self._stream.abort()

    async def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        return self  # already started by `StreamDialer`

    def get_extra_info(self, info: str) -> object:
        return self.is_readable() if info == "is_readable" else None

    def is_readable(self) -> bool:
        """Return whether `read` would return immediately; if so, the pool closes the idle stream.

        A stream can only be tested by calling `read`; the call is cancelled if no data is
        available.
        """
        if self._early:
            return True
        taking = self._stream.read()
        try:
            taking.send(None)
        except StopIteration as taken:
            self._early = taken.value
            return True
        except PeerClosed:
            return True
        taking.close()
        return False


class _PoolTransport(httpx2.AsyncBaseTransport):
    """An httpx2 transport that uses URC's connection pool and keeps the pool's errors unchanged."""

    def __init__(self, pool: httpcore2.AsyncConnectionPool) -> None:
        self._pool = pool

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        url = request.url
        assert isinstance(request.stream, httpx2.AsyncByteStream)  # noqa: S101 - made so
        answer = await self._pool.handle_async_request(
            httpcore2.Request(
                method=request.method,
                url=httpcore2.URL(
                    scheme=url.raw_scheme, host=url.raw_host, port=url.port, target=url.raw_path
                ),
                headers=request.headers.raw,
                content=request.stream,
                extensions=request.extensions,
            )
        )
        return httpx2.Response(
            answer.status,
            headers=answer.headers,
            stream=_Body(answer),
            extensions=answer.extensions,
        )

    async def aclose(self) -> None:
        await self._pool.aclose()


class _Body(httpx2.AsyncByteStream):
    def __init__(self, answer: httpcore2.Response) -> None:
        self._answer = answer

    async def __aiter__(self) -> AsyncIterator[bytes]:
        async for piece in self._answer.aiter_stream():
            yield piece

    async def aclose(self) -> None:
        await self._answer.aclose()
