"""The emulated robot behind a TCP port, or calling one (``mode: listen``)."""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress

from urc.model.codec import Payload
from urc.problems import UrcError
from urc.simulator.doors.base import (
    READ_BYTES,
    TAKEN_WITHIN_S,
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

__all__ = ["TcpDoor", "talk_over"]

CALLS_EVERY_S = 0.5
"""How long a robot that calls the driver waits before it calls again."""


class TcpDoor:
    """One listening port and whoever came in through it."""

    def __init__(self, place: Place) -> None:
        """Prepare the door; `open` listens."""
        self._place = place
        self._crowd = Crowd(place)
        self._server: asyncio.Server | None = None
        self._calls: asyncio.Task[None] | None = None

    async def open(self) -> Listening:
        """Listen on the port of the options, or on any; or call the driver that listens."""
        place, port = self._place, option_port(self._place)
        if place.options.get("mode") == "listen":
            return self._call(port)
        try:
            self._server = await asyncio.start_server(
                self._let_in, place.host, port, limit=READ_BYTES
            )
        except OSError as fault:
            where = shown_place(place.host, port)
            message = f"transports.{place.name}: cannot listen on {where} ({reason(fault)})"
            raise UrcError(message) from fault
        host, port = self._server.sockets[0].getsockname()[:2]
        text = f"{place.spec.type} {shown_place(host, port)}"
        return Listening(host, port, text, {"host": host, "port": port})

    async def close(self) -> None:
        """Stop listening and cut every connection."""
        if self._server is not None:
            self._server.close()
        if self._calls is not None:
            self._calls.cancel()
            await asyncio.gather(self._calls, return_exceptions=True)
        await self._crowd.close()
        if self._server is not None:
            await self._server.wait_closed()

    def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        keep_alive(writer.get_extra_info("socket"))
        self._crowd.welcome(
            lambda guest: talk_over(self._place, guest, reader, writer), writer.transport.abort
        )

    def _call(self, port: int) -> Listening:
        place = self._place
        bind = str(place.options.get("bind") or "127.0.0.1")
        host = "127.0.0.1" if place.is_anywhere or bind == "0.0.0.0" else bind  # noqa: S104
        port = port or _free_port(host)
        self._calls = asyncio.create_task(self._keep_calling(host, port))
        text = f"{place.spec.type}, calls {shown_place(host, port)}"
        return Listening(host, port, text, {"bind": host, "port": port, "host": host})

    async def _keep_calling(self, host: str, port: int) -> None:
        """Connect to the driver, again and again: one connection at a time, as a robot does."""
        while True:
            with suppress(OSError, TimeoutError):
                async with asyncio.timeout(TAKEN_WITHIN_S):
                    reader, writer = await asyncio.open_connection(host, port, limit=READ_BYTES)
                self._let_in(reader, writer)
                with suppress(OSError):
                    await writer.wait_closed()
            await asyncio.sleep(CALLS_EVERY_S)


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])


async def talk_over(
    place: Place, guest: Guest, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    """Talk to one client over a stream, and close it in good order."""
    writer.transport.set_write_buffer_limits(high=READ_BYTES)

    async def put(said: Sequence[Payload]) -> None:
        writer.write(b"".join(one for one in said if isinstance(one, bytes)))
        await writer.drain()

    await converse(place, guest, lambda: reader.read(READ_BYTES), put)
    writer.close()
    async with asyncio.timeout(TAKEN_WITHIN_S):
        await writer.wait_closed()
