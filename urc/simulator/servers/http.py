"""An emulated robot behind a web server, with requests and streams of images, events and lines.

Requests are passed to the robot's rules as envelopes. Each of the driver's subscriptions is a
stream at the topic's path. Streams contain the robot's messages or, for a camera, images of its
world. If there is no world, each image is filled with one colour, which changes slowly.
"""

import asyncio
import http.client
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from urllib.parse import parse_qsl, unquote, urlsplit

import h11
import msgspec

from urc.model.payload import Envelope, Payload
from urc.simulator.emulated_robot import EmulatedConnection
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.clients import READ_BYTES, TAKEN_WITHIN_S, ClientConnection, converse
from urc.simulator.servers.coloured_picture import picture
from urc.simulator.servers.http_auth import HttpAuth
from urc.simulator.servers.listening import StreamServer, UrlServer

__all__ = ["HttpServer"]

MAX_BODY_BYTES = 1_048_576
PICTURE_EVERY_S = 0.1
_BOUNDARY = "picture"
_OURS = ("content-length", "transfer-encoding", "connection")
_TYPES = {
    "mjpeg": f"multipart/x-mixed-replace;boundary={_BOUNDARY}",
    "sse": "text/event-stream",
    "lines": "text/plain; charset=utf-8",
}


class HttpRequest(NamedTuple):
    """One HTTP request from a client, with its decoded path."""

    method: str
    target: str
    """The request target as received."""
    path: str
    """Decoded path, relative to the driver's URL and without the query."""
    headers: Mapping[str, str]
    body: bytes

    @property
    def ways(self) -> list[Envelope]:
        """The request in two notations: with a separate query, and with the query in the path."""
        query = urlsplit(self.target).query
        attributes: dict[str, object] = {"method": self.method, "path": self.path}
        attributes["headers"] = self.headers
        if not query:
            return [Envelope("request", attributes, self.body)]
        pairs = {"query": dict(parse_qsl(query, keep_blank_values=True))}
        whole = {"path": f"{self.path}?{unquote(query)}"}
        return [Envelope("request", {**attributes, **one}, self.body) for one in (pairs, whole)]


class HttpServer(UrlServer, StreamServer):
    """A web server."""

    SCHEME = "http"

    def __init__(self, context: ServerContext) -> None:
        super().__init__(context)
        self._auth = HttpAuth(context.options.get("auth"))

    async def _talk(
        self,
        client: ClientConnection,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        base = self._path.rstrip("/")
        await _HttpConversation(self._context, self._auth, base, reader, writer).run(client)


class _HttpConversation:
    """Answers the requests of one HTTP connection in turn; the last may start a stream."""

    def __init__(
        self,
        context: ServerContext,
        auth: HttpAuth,
        base: str,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        self._context = context
        self._auth = auth
        self._base = base
        self._reader = reader
        self._writer = writer
        self._http = h11.Connection(h11.SERVER)

    async def run(self, client: ClientConnection) -> None:
        try:
            while (asked := await self._next(client)) is not None:
                await self._serve(client, asked)
                if self._http.our_state is not h11.DONE:
                    break
                self._http.start_next_cycle()
        except h11.RemoteProtocolError as fault:
            await self._refuse(fault)
        self._writer.close()
        async with asyncio.timeout(TAKEN_WITHIN_S):
            await self._writer.wait_closed()

    async def _next(self, client: ClientConnection) -> HttpRequest | None:
        """Return the next request; None at the end of the connection."""
        head: h11.Request | None = None
        body = bytearray()
        while True:
            event = self._http.next_event()
            if event is h11.NEED_DATA:
                if self._http.they_are_waiting_for_100_continue:
                    await self._send(h11.InformationalResponse(status_code=100, headers=[]))
                self._http.receive_data(await self._reader.read(READ_BYTES))
                client.active_s = asyncio.get_running_loop().time()
            elif isinstance(event, h11.Request):
                head = event
            elif isinstance(event, h11.Data):
                body += event.data
                if len(body) > MAX_BODY_BYTES:
                    raise h11.RemoteProtocolError("too long", error_status_hint=413)
            elif isinstance(event, h11.EndOfMessage) and head is not None:
                return self._asked(head, bytes(body))
            else:
                return None

    def _asked(self, head: h11.Request, body: bytes) -> HttpRequest:
        target = head.target.decode("ascii", "replace")
        path = unquote(urlsplit(target).path).removeprefix(self._base) or "/"
        headers = {name.decode(): value.decode("latin-1") for name, value in head.headers}
        return HttpRequest(head.method.decode(), target, path, headers, body)

    async def _serve(self, client: ClientConnection, asked: HttpRequest) -> None:
        given = asked.headers.get("authorization", "")
        challenge = self._auth.challenge(asked.method, asked.target, given)
        if challenge is not None:
            await self._answer(401, [("WWW-Authenticate", challenge)], b"who are you?\n", asked)
            return
        kind = self._kind(asked)
        await self._suffer(client.line)
        if kind == "stills":
            taken = self._picture(asked)
            if not taken:
                await self._answer(503, [], b"the camera gives no picture\n", asked)
                return
            await self._answer(200, [("Content-Type", "image/jpeg")], taken, asked)
        elif kind:
            await self._stream(client, asked, kind)
        else:
            await self._answer(*_written(self._asks(client.line, asked)), asked)

    async def _suffer(self, line: EmulatedConnection) -> None:
        """Delay or drop the reply according to the injected faults."""
        if line.loses:
            raise ConnectionResetError("lost on demand")
        if line.delay_s:
            await asyncio.sleep(line.delay_s)

    def _asks(self, line: EmulatedConnection, asked: HttpRequest) -> Envelope:
        """Return the robot's reply, or an error status."""
        for envelope in asked.ways:
            before = line.faults
            for one in line.request(envelope, self._context.now()):
                if isinstance(one, Envelope) and one.verb == "response":
                    return one
            if line.faults == before and line.is_incomplete:
                return Envelope("response", {"ok": False, "status": 503, "reason": "no value"})
            if line.faults == before:
                return Envelope("response", {"ok": True, "status": 200})
        reason = f"{line.last_fault}\n"
        return Envelope("response", {"ok": False, "status": 404, "reason": reason})

    def _kind(self, asked: HttpRequest) -> str:
        """Return the stream type of the subscription to this path; "" without a subscription."""
        if asked.method != "GET":
            return ""
        ways = self._context.topics.items()
        target = asked.target.removeprefix(self._base)
        names = (asked.path, target)
        kinds = [how.get("stream") for topic, how in ways if topic.partition("#")[0] in names]
        return str(kinds[0]) if kinds else ""

    def _picture(self, asked: HttpRequest) -> bytes:
        """Return the camera image of the robot's world, or a plain image if there is no world."""
        context, target = self._context, asked.target.removeprefix(self._base)
        seen = context.picture((asked.path, target))
        return picture(context.now()) if seen is None else seen

    async def _answer(
        self, status: int, headers: Sequence[tuple[str, str]], body: bytes, asked: HttpRequest
    ) -> None:
        given = {name.lower() for name, _ in headers}
        sent = (
            [*headers, ("Content-Length", str(len(body)))]
            if "content-length" not in given
            else [*headers]
        )
        if self._context.spec.connection == "per_request":
            sent.append(("Connection", "close"))
        reason = http.client.responses.get(status, "")
        await self._send(h11.Response(status_code=status, headers=sent, reason=reason.encode()))
        if body and asked.method != "HEAD":
            await self._send(h11.Data(data=body))
        await self._send(h11.EndOfMessage())

    async def _stream(self, client: ClientConnection, asked: HttpRequest, kind: str) -> None:
        """Stream the robot's messages on a topic until the client disconnects."""
        headers = [("Content-Type", _TYPES[kind]), ("Cache-Control", "no-store")]
        await self._send(h11.Response(status_code=200, headers=headers))
        if kind == "mjpeg":
            await self._pictures(asked)
            return
        path = asked.path

        async def put(said: Sequence[Payload]) -> None:
            for one in said:
                if isinstance(one, Envelope) and one.verb == "message":
                    topic, _, event = str(one.attributes.get("topic")).partition("#")
                    if topic == path:
                        await self._send(h11.Data(data=_piece(kind, event, _bytes(one.body))))

        await converse(self._context, client, self._gone, put)

    async def _pictures(self, asked: HttpRequest) -> None:
        gone = asyncio.ensure_future(self._gone())
        try:
            while not gone.done():
                taken = self._picture(asked)
                if not taken:
                    await asyncio.wait([gone], timeout=PICTURE_EVERY_S)
                    continue
                head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(taken)}"
                await self._send(h11.Data(data=f"{head}\r\n\r\n".encode() + taken + b"\r\n"))
                await asyncio.wait([gone], timeout=PICTURE_EVERY_S)
        finally:
            gone.cancel()

    async def _gone(self) -> None:
        """Wait until the client closes the connection; discard its data."""
        while await self._reader.read(READ_BYTES):
            pass

    async def _send(self, event: h11.Event) -> None:
        data = self._http.send(event)
        if data:
            self._writer.write(data)
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await self._writer.drain()

    async def _refuse(self, fault: h11.RemoteProtocolError) -> None:
        """Reply to a malformed request if the connection still permits a reply."""
        if self._http.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            headers = [("Content-Length", "0"), ("Connection", "close")]
            await self._send(h11.Response(status_code=fault.error_status_hint, headers=headers))
            await self._send(h11.EndOfMessage())


def _written(answer: Envelope) -> tuple[int, list[tuple[str, str]], bytes]:
    """Return the status, headers and body of the robot's reply."""
    attributes, body = answer.attributes, answer.body
    is_ok = bool(attributes.get("ok", True))
    status = attributes.get("status")
    found = attributes.get("headers")
    headers = [(str(k), str(v)) for k, v in found.items()] if isinstance(found, Mapping) else []
    if not is_ok and body is None:
        body = str(attributes.get("reason") or "refused").encode()
    if not any(name.lower() == "content-type" for name, _ in headers):
        kind = "text/plain; charset=utf-8" if isinstance(body, bytes | None) else "application/json"
        headers.append(("Content-Type", kind))
    plain = status if isinstance(status, int) and 200 <= status <= 599 else (200 if is_ok else 500)
    return plain, headers, _bytes(body)


def _bytes(body: object) -> bytes:
    if isinstance(body, bytes):
        return body
    return b"" if body is None else msgspec.json.encode(body)


def _piece(kind: str, event: str, body: bytes) -> bytes:
    """Return a message as a server-sent event, or as a line of text."""
    if kind == "lines":
        return body.replace(b"\n", b" ") + b"\n"
    name = [b"event: " + event.encode()] if event else []
    return b"\n".join([*name, *(b"data: " + line for line in body.splitlines()), b"", b""])
