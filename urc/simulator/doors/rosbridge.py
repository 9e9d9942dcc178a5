"""The emulated robot behind a rosbridge server: version 2 of the protocol, over WebSocket."""

import asyncio
from collections.abc import Sequence

from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from urc.model.codec import Envelope, Payload
from urc.problems import UrcError
from urc.simulator.doors.base import (
    Crowd,
    Guest,
    Listening,
    Place,
    converse,
    keep_alive,
    option_port,
    reason,
    shown_place,
)
from urc.simulator.doors.rosbridge_desk import Desk, Seat
from urc.transports.rosbridge_types import spelled

__all__ = ["RosbridgeDoor"]

DEFAULT_PORT = 9090
MAX_BYTES = 10_000_000
"""Largest frame; the real one's default."""
MAX_UNSENT_BYTES = 4_194_304
"""A client that leaves more than this untaken misses messages."""


class RosbridgeDoor:
    """One listening port, and a desk for all who come in through it."""

    def __init__(self, place: Place) -> None:
        """Prepare the door; `open` listens."""
        self._place = place
        self._crowd = Crowd(place)
        # A bridge spells types as its ROS does; where the document leaves that open, it is ROS 2.
        ros = {1: 1, 2: 2, "auto": 2}.get(place.options.get("ros"))
        types = {name: str(how.get("type") or "") for name, how in place.topics.items()}
        self._desk = Desk({name: spelled(kind, "msg", ros) for name, kind in types.items()})
        self._server: Server | None = None

    async def open(self) -> Listening:
        """Listen on the port of the options, or on any."""
        place, port = self._place, option_port(self._place, default=DEFAULT_PORT)
        try:
            self._server = await serve(
                self._let_in,
                place.host,
                port,
                compression=None,
                max_size=MAX_BYTES,
                max_queue=16,
                ping_interval=None,  # off by default in the real one, too
            )
        except OSError as fault:
            where = shown_place(place.host, port)
            message = f"transports.{place.name}: cannot listen on {where} ({reason(fault)})"
            raise UrcError(message) from fault
        host, port = self._server.sockets[0].getsockname()[:2]
        text = f"rosbridge {shown_place(host, port)}"
        return Listening(host, port, text, {"host": host, "port": port})

    async def close(self) -> None:
        """Stop listening and cut every connection."""
        if self._server is None:
            return
        self._server.close(close_connections=False)
        await self._crowd.close()
        await self._server.wait_closed()

    async def _let_in(self, socket: ServerConnection) -> None:
        keep_alive(socket.transport.get_extra_info("socket"))
        self._crowd.welcome(lambda guest: self._talk(guest, socket), socket.transport.abort)
        await socket.wait_closed()

    async def _talk(self, guest: Guest, socket: ServerConnection) -> None:
        clock = asyncio.get_running_loop().time

        def send(frame: str | bytes) -> None:
            # Neither waits: what the desk says to one client must not hold up the others.
            if socket.transport.get_write_buffer_size() <= MAX_UNSENT_BYTES:
                broadcast([socket], frame)

        seat = Seat(self._desk, send)
        asked: list[tuple[Envelope, int]] = []

        async def take() -> Payload | None:
            if asked:  # answered by now, or never
                envelope, faults = asked.pop()
                if guest.line.faults > faults:
                    seat.refuses(envelope)
            try:
                while True:
                    heard = seat.hears(await socket.recv(), clock())
                    await socket.drain()
                    if heard is not None:
                        asked[:] = [(heard, guest.line.faults)]
                        return heard
            except ConnectionClosed:
                return None

        async def put(said: Sequence[Payload]) -> None:
            for payload in said:
                seat.says(payload, clock())
            await socket.drain()

        try:
            await converse(self._place, guest, take, put)
            await socket.close()
        finally:
            seat.leave()
