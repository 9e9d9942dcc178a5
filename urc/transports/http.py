"""The HTTP transport: requests and responses, and streams of images, events and lines.

A request counts as sent when its bytes are in the kernel; `receive` returns the response. The
number of concurrent requests is limited. If a new request waits too long, the oldest request is
dropped. If a connection is lost, its request fails immediately.
"""

import asyncio
from collections.abc import AsyncIterator, Coroutine, Mapping
from typing import Any
from urllib.parse import urlencode

import httpx2
import msgspec

from urc._headers import is_reserved
from urc.model.payload import Envelope, Payload
from urc.transports._faults import CLOSED, late
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError, TransportSetup
from urc.transports.http_body import body_of, complaint
from urc.transports.http_client import HttpClient, HttpFault
from urc.transports.http_receive_queue import HttpReceiveQueue
from urc.transports.http_streams import HttpStream, LastActivity, streams_of
from urc.transports.web_dial import Dialer
from urc.transports.web_origin import OptionReader

__all__ = ["HttpTransport", "from_setup"]

MAX_BODY_BYTES = 8_388_608
IN_FLIGHT = 4
ANSWER_S = 10.0
PATIENCE_S = 1.0
"""Maximum time that a new request waits before the oldest request is dropped, in seconds."""


class HttpTransport:
    """A reusable transport to one robot's web server."""

    def __init__(self, setup: TransportSetup) -> None:
        """Read the options of `setup`, without connecting.

        Raises:
            TransportError: an option or a subscription is invalid.
        """
        options = OptionReader("http", setup.options)
        self._place = options.place("http")
        self._credentials = options.credentials(("basic", "bearer", "digest"))
        self._headers = options.headers()
        self._max_body = int(options.number("max_body", MAX_BODY_BYTES, 1, 2**28))
        self._most = int(options.number("in_flight", IN_FLIGHT, 1, 32))
        self._answer_s = options.duration("response_timeout", ANSWER_S, 0.05, 600)
        self._probe = options.text("probe")
        self._streams = streams_of(setup.subscriptions)
        self._dialer = Dialer(self._place, tls=options.tls(self._place), tunnel=setup.tunnel)
        self._talk: _OpenConnection | None = None

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``http http://192.168.4.1:80/``."""
        place = self._place
        return f"http http{'s' * place.is_secure}://{place.authority}{place.path}"

    async def open(self, timeout_s: float) -> None:
        """Check that the server responds within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        client = HttpClient(
            self._place,
            self._dialer,
            credentials=self._credentials,
            headers=self._headers,
            connections=self._most + len(self._streams) + 1,
        )
        talk = _OpenConnection(client, self._most, self._answer_s, self._max_body)
        try:
            async with asyncio.timeout(timeout_s):
                await client.reach(timeout_s)
                if self._probe:
                    await talk.probe(self._probe)
        except TimeoutError as fault:
            await talk.close()
            raise ConnectFailed(late(self._place.authority, timeout_s)) from fault
        except BaseException:
            await talk.close()
            raise
        for spec in self._streams:
            talk.listen(HttpStream(spec, client, talk.queue, talk.pulse, self._max_body))
        self._talk = talk

    async def receive(self) -> Envelope:
        """Return the next response, image, event or line.

        Raises:
            PeerClosed: the robot is no longer reachable.
        """
        if self._talk is None:
            raise PeerClosed(CLOSED)
        return await self._talk.receive()

    async def send(self, data: Payload) -> None:
        """Send a request; `receive` later returns the response or the failure.

        Raises:
            PeerClosed: the transport is closed.
            TransportError: `data` is not a valid request.
        """
        if not isinstance(data, Envelope) or data.verb != "request":
            what = f"{data.verb} anything" if isinstance(data, Envelope) else "send bare bytes"
            raise TransportError(f"http can only send requests; it cannot {what}")
        if self._talk is None:
            raise PeerClosed(CLOSED)
        await self._talk.send(data)

    def unsent(self) -> int:
        """Return the number of unacknowledged request bytes."""
        return 0 if self._talk is None else self._talk.unsent()

    def forget(self) -> None:
        """Cancel every request with unsent bytes.

        Each request uses a separate connection, so an unsent request could arrive after newer
        requests.
        """
        if self._talk is not None:
            self._talk.forget()

    async def close(self) -> None:
        """Close every connection immediately and discard unsent data.

        The method never raises and may be called twice.
        """
        talk, self._talk = self._talk, None
        if talk is not None:
            await talk.close()


def from_setup(setup: TransportSetup) -> Transport:
    """Return an HTTP transport for a document's options, or raise `TransportError`."""
    return HttpTransport(setup)


class _OpenConnection:
    """The connections, requests and streams of the transport between `open` and `close`."""

    def __init__(self, client: HttpClient, most: int, answer_s: float, max_body_bytes: int) -> None:
        self.queue = HttpReceiveQueue()
        self.pulse = LastActivity()
        self._client = client
        self.unsent, self.forget = client.unsent, client.forget
        self._most = most
        self._answer_s = answer_s
        self._max_bytes = max_body_bytes
        self._number = 0
        self._is_looking = False
        self._requests: dict[int, asyncio.Task[None]] = {}
        """Requests that are in progress or have an unread response, keyed by request number; the
        oldest request comes first."""
        self._has_place = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        """All running tasks, including the tasks of dropped requests."""

    def listen(self, stream: HttpStream) -> None:
        self._start(stream.run())

    def _start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def probe(self, path: str) -> None:
        try:
            async with self._client.answer(self._client.request("GET", path, {}, None)) as response:
                reason = complaint(response, await body_of(response, self._max_bytes))
        except HttpFault as fault:
            raise ConnectFailed(str(fault)) from fault
        if reason:
            raise ConnectFailed(f"the probe of {path} failed: {reason}")

    async def receive(self) -> Envelope:
        envelope, place = await self.queue.pop()
        if place is not None:
            self._requests.pop(place, None)
            self._has_place.set()
        return envelope

    async def send(self, data: Envelope) -> None:
        if self.queue.ended is not None:
            raise PeerClosed(self.queue.ended)
        await self._until_place()
        self._number += 1
        handed = asyncio.Event()
        work = self._request(self._number, data, handed)
        task = self._requests[self._number] = self._start(work)
        try:
            await handed.wait()
        except asyncio.CancelledError:
            task.cancel()
            raise

    async def close(self) -> None:
        self.queue.end(CLOSED)
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._client.close()

    async def _until_place(self) -> None:
        """Wait until another request may start; after a time limit, drop the oldest request."""
        try:
            async with asyncio.timeout(PATIENCE_S):
                while len(self._requests) >= self._most:
                    self._has_place.clear()
                    await self._has_place.wait()
        except TimeoutError:
            while len(self._requests) >= self._most:
                place = next(iter(self._requests))
                self._requests.pop(place).cancel()
                self.queue.forget(place)

    async def _request(self, place: int, data: Envelope, handed: asyncio.Event) -> None:
        """Send one request and add its response to the queue."""
        fault: HttpFault | None = None
        # Read first: the robot may have closed idle connections, which must not be used.
        await asyncio.sleep(0)
        try:
            async with asyncio.timeout(self._answer_s):
                answer = await self._exchange(data, handed)
        except TimeoutError:
            fault = HttpFault(f"no answer within {self._answer_s:g} s", is_unanswered=True)
        except HttpFault as found:
            fault = found
        finally:
            handed.set()
        if fault is not None:
            answer = Envelope("response", {"ok": False, "reason": str(fault)})
        attributes = {"id": data.attributes.get("id"), **answer.attributes}
        self.queue.answer(place, answer._replace(attributes=attributes))
        if fault is not None:
            await self._conclude(fault)

    async def _conclude(self, fault: HttpFault) -> None:
        """Check whether an unresponsive robot is still reachable; if not, end the queue."""
        if fault.is_unreachable:
            self.queue.end(str(fault))
        elif fault.is_unanswered and not self._is_looking:
            self._is_looking = True
            try:
                await self._client.reach()
            except ConnectFailed as gone:
                self.queue.end(str(gone))
            finally:
                self._is_looking = False

    async def _exchange(self, data: Envelope, handed: asyncio.Event) -> Envelope:
        request = _request_of(self._client, data)
        body = await request.aread()
        request.stream = _Handed(body, handed)
        async with self._client.answer(request) as response:
            self.pulse.heartbeat()
            found = await body_of(response, self._max_bytes)
            reason = complaint(response, found)
            attributes: dict[str, object] = {
                "ok": not reason,
                "status": response.status_code,
                "headers": dict(response.headers),
            }
            if reason:
                attributes["reason"] = reason
            return Envelope("response", attributes, found)


class _Handed(httpx2.AsyncByteStream):
    """A request body that records when all its bytes are in the kernel."""

    def __init__(self, body: bytes, handed: asyncio.Event) -> None:
        self._body = body
        self._handed = handed

    async def __aiter__(self) -> AsyncIterator[bytes]:
        if self._body:
            yield self._body
        self._handed.set()


def _request_of(client: HttpClient, data: Envelope) -> httpx2.Request:
    """Return the HTTP request of the library `httpx2` for an envelope."""
    attributes = data.attributes
    path, query = str(attributes.get("path", "/")), attributes.get("query")
    if isinstance(query, Mapping):
        query = urlencode({str(name): _plain(value) for name, value in query.items()})
    if query:
        path += f"{'&' if '?' in path else '?'}{query}"
    headers = attributes.get("headers") or {}
    if not isinstance(headers, Mapping):
        raise HttpFault(f"headers must map names to values, not {headers!r}")
    named = {str(name): _plain(value) for name, value in headers.items()}
    for name in named:
        if is_reserved(name):
            raise HttpFault(f"a document may not set the header {name[:40]!r}")
    body = data.body
    if body is not None and not isinstance(body, bytes):
        if not any(name.lower() == "content-type" for name in named):
            named["Content-Type"] = "application/json"
        try:
            body = msgspec.json.encode(body)
        except (msgspec.MsgspecError, TypeError) as fault:
            raise HttpFault(f"the body cannot be written as JSON ({fault})") from fault
    method = str(attributes.get("method", "GET"))
    if "url" in attributes:
        return client.follow(method, str(attributes["url"]), named, body)
    return client.request(method, path, named, body)


def _plain(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)
