"""An emulated robot behind a Telnet server that supports negotiation and echo."""

import asyncio
from collections.abc import Sequence

from urc.model.payload import Payload
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.clients import READ_BYTES, TAKEN_WITHIN_S, ClientConnection, converse
from urc.simulator.servers.listening import StreamServer
from urc.simulator.servers.terminal import TerminalInput, echo_of
from urc.transports.telnet_protocol import BINARY, ECHO, NAWS, SGA, TTYPE, TelnetNegotiation

__all__ = ["TelnetServer"]


class TelnetServer(StreamServer):
    """A Telnet port."""

    DEFAULT_PORT = 23

    async def _talk(
        self,
        client: ClientConnection,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        await _TelnetConversation(self._context, reader, writer).run(client)


class _TelnetConversation:
    """Exchanges data with one client of the Telnet server."""

    def __init__(
        self, context: ServerContext, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self._context = context
        self._reader = reader
        self._writer = writer
        self._keys = TerminalInput(context.spec)
        self._telnet = TelnetNegotiation(
            ours=frozenset((ECHO, SGA, BINARY)), theirs=frozenset((SGA, BINARY, TTYPE, NAWS))
        )

    async def run(self, client: ClientConnection) -> None:
        self._writer.write(self._telnet.requests(ours=(ECHO, SGA), theirs=(SGA, NAWS)))
        await converse(self._context, client, self._read, self._write)
        self._writer.close()
        async with asyncio.timeout(TAKEN_WITHIN_S):
            await self._writer.wait_closed()

    async def _read(self) -> bytes:
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
            # A client that only negotiates must read the responses, too.
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await self._writer.drain()
        return b""

    async def _write(self, said: Sequence[Payload]) -> None:
        for one in said:
            if isinstance(one, bytes):
                self._writer.write(self._telnet.encode(one))
        await self._writer.drain()
