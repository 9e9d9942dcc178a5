"""An emulated robot behind a WebSocket; each message is one payload."""

from abc import abstractmethod
from collections.abc import Coroutine, Sequence
from functools import partial
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from urc.model.payload import Payload
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.clients import ClientConnection, converse
from urc.simulator.servers.http_auth import HttpAuth
from urc.simulator.servers.listening import Listener, ListeningServer, UrlServer, keep_alive

__all__ = ["MessageServer", "WebSocketServer"]

MAX_MESSAGE_BYTES = 1_048_576


class MessageServer(ListeningServer):
    """A simulated server that exchanges payloads with WebSocket clients."""

    async def _listen(self, host: str, port: int) -> Listener:
        server = await self._serve(host, port)
        # `Clients` closes the connections without a closing handshake for each.
        refuse = partial(server.close, close_connections=False)
        return Listener(next(iter(server.sockets)).getsockname(), refuse, server.wait_closed)

    async def _accept(self, socket: ServerConnection) -> None:
        keep_alive(socket.transport.get_extra_info("socket"))
        self._clients.admit(lambda client: self._talk(client, socket), socket.transport.abort)
        await socket.wait_closed()

    @abstractmethod
    async def _serve(self, host: str, port: int) -> Server:
        """Start listening with the limits of the server class."""

    @abstractmethod
    def _talk(
        self, client: ClientConnection, socket: ServerConnection
    ) -> Coroutine[Any, Any, None]:
        """Exchange messages with one client until the connection ends."""


class WebSocketServer(UrlServer, MessageServer):
    """A WebSocket port."""

    SCHEME = "ws"

    def __init__(self, context: ServerContext) -> None:
        super().__init__(context)
        self._auth = HttpAuth(context.options.get("auth"))
        self._is_text = context.options.get("send_as", "text") == "text"

    async def _serve(self, host: str, port: int) -> Server:
        offered = self._context.options.get("subprotocols")
        names = offered if isinstance(offered, list | tuple) else ()
        return await serve(
            self._accept,
            host,
            port,
            compression=None,
            max_size=MAX_MESSAGE_BYTES,
            max_queue=4,
            write_limit=0,
            subprotocols=[Subprotocol(str(name)) for name in names] or None,
            process_request=self._check,
        )

    def _check(self, socket: ServerConnection, request: Request) -> Response | None:
        """Reject requests with an unknown path or invalid credentials."""
        given = request.headers.get("Authorization", "")
        challenge = self._auth.challenge("GET", request.path, given)
        if challenge is not None:
            refusal = socket.respond(HTTPStatus.UNAUTHORIZED, "who are you?\n")
            refusal.headers["WWW-Authenticate"] = challenge
            return refusal
        if request.path.partition("?")[0] != self._path:
            return socket.respond(
                HTTPStatus.NOT_FOUND, f"unknown path; the robot's WebSocket is at {self._path}\n"
            )
        return None

    async def _talk(self, client: ClientConnection, socket: ServerConnection) -> None:
        async def take() -> Payload | None:
            try:
                while not (message := await socket.recv(decode=False)):
                    pass
            except ConnectionClosed:
                return None
            return message

        async def put(said: Sequence[Payload]) -> None:
            for payload in said:
                if isinstance(payload, bytes):
                    await socket.send(payload, text=self._is_text and _is_text(payload))

        try:
            await converse(self._context, client, take, put)
            await socket.close()
        except ConnectionClosed as ended:
            raise ConnectionError("the client closed the connection") from ended


def _is_text(payload: bytes) -> bool:
    try:
        payload.decode()
    except UnicodeDecodeError:
        return False
    return True
