"""Puts an emulated robot on real ports, for people, tests and ``urc demo``.

Everything a client can do is bounded: how many there are, how much is read ahead, how long an
answer may wait to be taken. When all places are taken the client that has been silent for longest
goes, so that half-open connections cannot lock the door.
"""

import asyncio
import logging
import math
import os
import socket
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

from urc.expressions import ExpressionError, Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.simulator.twin import Twin, TwinLine

__all__ = ["serve"]

MAX_CLIENTS = 64
"""Connections on one transport."""
READ_BYTES = 4096
TAKEN_WITHIN_S = 5.0
"""A client that does not take its answers for this long is dropped."""

log = logging.getLogger(__name__)


@asynccontextmanager
async def serve(
    profile: Profile,
    settings: Mapping[str, Value],
    host: str = "127.0.0.1",
    *,
    now: Callable[[], float] = time.time,
) -> AsyncIterator[Mapping[str, tuple[str, int]]]:
    """Emulate the robot of `profile` until the context ends.

    Args:
        profile: its `simulator` rules answer.
        settings: for ports and templates; a port of 0 lets the system choose.
        host: address to listen on; the default can be reached from this machine only.
        now: seconds since the epoch, the templates' ``now``.

    Returns:
        Transport → the host and port it listens on.

    Raises:
        UrcError: a transport that cannot be emulated, or a port that cannot be had.
    """
    twin = Twin(profile, settings)
    doors: list[_Door] = []
    listening: dict[str, tuple[str, int]] = {}
    try:
        for name, spec in profile.driver.transports.items():
            if spec.type != "tcp":
                raise UrcError(f"transports.{name}: {spec.type} cannot be emulated, only tcp can")
            door = _Door(twin, spec, now)
            doors.append(door)
            listening[name] = await door.open(host, _port_of(spec, settings))
        yield listening
    finally:
        for door in doors:
            await door.close()


def _port_of(spec: TransportSpec, settings: Mapping[str, Value]) -> int:
    port = spec.options.get("port")
    if isinstance(port, Template):
        try:
            port = port.evaluate({"settings": settings})
        except ExpressionError as problem:
            raise UrcError(f"transports.{spec.name}.port: {problem}") from problem
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise UrcError(f"transports.{spec.name}.port: {port!r} is no port to listen on")
    return port


def _reason(fault: OSError) -> str:
    """Return the system's own words: asyncio puts the address into the error a second time."""
    if isinstance(fault, socket.gaierror) or not fault.errno:
        return str(fault.strerror or fault).lower()
    return os.strerror(fault.errno).lower()


@dataclass(slots=True, eq=False)
class _Client:
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    line: TwinLine
    heard_s: float


class _Door:
    """One listening port and whoever came in through it."""

    def __init__(self, twin: Twin, spec: TransportSpec, now: Callable[[], float]) -> None:
        self._twin = twin
        self._spec = spec
        self._now = now
        self._limit = 1 if spec.connection == "per_request" else None
        self._server: asyncio.Server | None = None
        self._clients: dict[_Client, asyncio.Task[None]] = {}

    async def open(self, host: str, port: int) -> tuple[str, int]:
        try:
            self._server = await asyncio.start_server(self._let_in, host, port, limit=READ_BYTES)
        except OSError as fault:
            why = _reason(fault)
            message = f"transports.{self._spec.name}: cannot listen on {host}:{port} ({why})"
            raise UrcError(message) from fault
        name = self._server.sockets[0].getsockname()
        return str(name[0]), int(name[1])

    async def close(self) -> None:
        if self._server is None:
            return
        self._server.close()
        tasks = list(self._clients.values())
        for client, task in self._clients.items():
            client.writer.transport.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._server.wait_closed()

    def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._clients) >= MAX_CLIENTS:
            silent = min(self._clients, key=lambda client: client.heard_s)
            silent.heard_s = math.inf  # on its way out, and not to be chosen again
            silent.writer.transport.abort()
            self._clients[silent].cancel()
        connection = writer.get_extra_info("socket")
        with suppress(OSError):  # it is gone already
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        line = self._twin.line(self._spec.name)
        client = _Client(reader, writer, line, asyncio.get_running_loop().time())
        self._clients[client] = asyncio.create_task(self._attend(client))

    async def _attend(self, client: _Client) -> None:
        """Talk to one client until either side has had enough."""
        try:
            await self._converse(client)
            client.writer.close()
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await client.writer.wait_closed()
        except (OSError, TimeoutError) as fault:
            log.info("%s: a client was lost: %s", self._spec.name, str(fault) or "it takes nothing")
        finally:
            client.writer.transport.abort()
            self._clients.pop(client, None)
            if client.line.faults:
                text, count = client.line.last_fault, client.line.faults
                log.info("%s: %s (%d faults in all)", self._spec.name, text, count)

    async def _converse(self, client: _Client) -> None:
        clock = asyncio.get_running_loop().time
        line, before_s = client.line, clock()
        client.writer.transport.set_write_buffer_limits(high=READ_BYTES)
        while True:
            data: bytes | None = None
            with suppress(TimeoutError):
                async with asyncio.timeout(line.due_in_s):
                    data = await client.reader.read(READ_BYTES)
            if data == b"":
                return
            now_s = clock()
            said = line.step(now_s - before_s, self._now())
            before_s = now_s
            answers: list[bytes] = []
            if data:
                client.heard_s = now_s
                answers = line.receive(data, self._now(), self._limit)
            client.writer.write(b"".join(said + answers))
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await client.writer.drain()
            if answers and self._limit is not None:
                return
            await asyncio.sleep(0)  # reading what is there already does not wait by itself
