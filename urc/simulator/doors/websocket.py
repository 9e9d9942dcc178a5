"""The emulated robot behind a WebSocket: each message is one piece of what is said."""

from collections.abc import Sequence
from http import HTTPStatus

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from urc.model.codec import Payload
from urc.problems import UrcError
from urc.simulator.doors.base import (
    Crowd,
    Guest,
    Listening,
    Place,
    converse,
    keep_alive,
    reason,
    shown_place,
)
from urc.simulator.doors.http import listen_url
from urc.simulator.doors.http_guard import Guard

__all__ = ["WebSocketDoor"]

MAX_MESSAGE_BYTES = 1_048_576


class WebSocketDoor:
    """One listening port and whoever came in through it."""

    def __init__(self, place: Place) -> None:
        """Prepare the door; `open` listens."""
        self._place = place
        self._crowd = Crowd(place)
        self._server: Server | None = None
        self._path = "/"
        self._guard = Guard(place.options.get("auth"))
        self._is_text = place.options.get("send_as", "text") == "text"

    async def open(self) -> Listening:
        """Listen on the port of the option `url`, or on any."""
        place = self._place
        port, self._path = listen_url(place, "ws")
        offered = place.options.get("subprotocols")
        names = offered if isinstance(offered, list | tuple) else ()
        try:
            self._server = await serve(
                self._let_in,
                place.host,
                port,
                compression=None,
                max_size=MAX_MESSAGE_BYTES,
                max_queue=4,
                write_limit=0,
                subprotocols=[Subprotocol(str(name)) for name in names] or None,
                process_request=self._check,
            )
        except OSError as fault:
            where = shown_place(place.host, port)
            message = f"transports.{place.name}: cannot listen on {where} ({reason(fault)})"
            raise UrcError(message) from fault
        host, port = self._server.sockets[0].getsockname()[:2]
        url = f"ws://{shown_place(host, port)}{self._path}"
        return Listening(host, port, f"websocket {url}", {"url": url, "tls": None})

    async def close(self) -> None:
        """Stop listening and cut every connection."""
        if self._server is None:
            return
        self._server.close(close_connections=False)
        await self._crowd.close()
        await self._server.wait_closed()

    def _check(self, socket: ServerConnection, request: Request) -> Response | None:
        """Refuse who asks for another path, or may not come in."""
        given = request.headers.get("Authorization", "")
        challenge = self._guard.challenge("GET", request.path, given)
        if challenge is not None:
            refusal = socket.respond(HTTPStatus.UNAUTHORIZED, "who are you?\n")
            refusal.headers["WWW-Authenticate"] = challenge
            return refusal
        if request.path.partition("?")[0] != self._path:
            return socket.respond(HTTPStatus.NOT_FOUND, f"the robot is at {self._path}\n")
        return None

    async def _let_in(self, socket: ServerConnection) -> None:
        keep_alive(socket.transport.get_extra_info("socket"))
        self._crowd.welcome(lambda guest: self._talk(guest, socket), socket.transport.abort)
        await socket.wait_closed()

    async def _talk(self, guest: Guest, socket: ServerConnection) -> None:
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
            await converse(self._place, guest, take, put)
            await socket.close()
        except ConnectionClosed as ended:
            raise ConnectionError("it closed the line") from ended


def _is_text(payload: bytes) -> bool:
    try:
        payload.decode()
    except UnicodeDecodeError:
        return False
    return True
