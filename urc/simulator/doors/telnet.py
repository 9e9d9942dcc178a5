"""The emulated robot behind a Telnet server, which negotiates and echoes as real ones do."""

import asyncio
from collections.abc import Sequence

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
from urc.simulator.doors.terminal import Keys, echo_of
from urc.transports.telnet_protocol import BINARY, ECHO, NAWS, SGA, TTYPE, TelnetTalk

__all__ = ["TelnetDoor"]

DEFAULT_PORT = 23


class TelnetDoor:
    """One listening port and whoever came in through it."""

    def __init__(self, place: Place) -> None:
        """Prepare the door; `open` listens."""
        self._place = place._replace(options={"port": DEFAULT_PORT, **place.options})
        self._crowd = Crowd(self._place)
        self._server: asyncio.Server | None = None

    async def open(self) -> Listening:
        """Listen on the port of the options, or on any."""
        place, port = self._place, option_port(self._place)
        try:
            self._server = await asyncio.start_server(
                self._let_in, place.host, port, limit=READ_BYTES
            )
        except OSError as fault:
            where = shown_place(place.host, port)
            message = f"transports.{place.name}: cannot listen on {where} ({reason(fault)})"
            raise UrcError(message) from fault
        host, port = self._server.sockets[0].getsockname()[:2]
        text = f"telnet {shown_place(host, port)}"
        return Listening(host, port, text, {"host": host, "port": port})

    async def close(self) -> None:
        """Stop listening and cut every connection."""
        if self._server is None:
            return
        self._server.close()
        await self._crowd.close()
        await self._server.wait_closed()

    def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        keep_alive(writer.get_extra_info("socket"))
        writer.transport.set_write_buffer_limits(high=READ_BYTES)
        self._crowd.welcome(
            lambda guest: _Talk(self._place, reader, writer).run(guest), writer.transport.abort
        )


class _Talk:
    """The conversation with one client."""

    def __init__(
        self, place: Place, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self._place = place
        self._reader = reader
        self._writer = writer
        self._keys = Keys(place.spec)
        self._telnet = TelnetTalk(
            ours=frozenset((ECHO, SGA, BINARY)), theirs=frozenset((SGA, BINARY, TTYPE, NAWS))
        )

    async def run(self, guest: Guest) -> None:
        self._writer.write(self._telnet.ask(ours=(ECHO, SGA), theirs=(SGA, NAWS)))
        await converse(self._place, guest, self._take, self._put)
        self._writer.close()
        async with asyncio.timeout(TAKEN_WITHIN_S):
            await self._writer.wait_closed()

    async def _take(self) -> bytes:
        while data := await self._reader.read(READ_BYTES):
            typed, answers = self._telnet.receive(data)
            if ECHO in self._telnet.ours:
                answers += self._telnet.encode(echo_of(typed))
            if answers:
                self._writer.write(answers)
            if BINARY not in self._telnet.theirs:
                typed = self._keys.read(typed)
            if typed:
                return typed
            # A client that only negotiates must take the answers, too.
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await self._writer.drain()
        return b""

    async def _put(self, said: Sequence[Payload]) -> None:
        for one in said:
            if isinstance(one, bytes):
                self._writer.write(self._telnet.encode(one))
        await self._writer.drain()
