"""The clients of a simulated server, and their conversations with the robot.

Each client has a separate `EmulatedConnection`. Limits apply to the number of clients, the size of
input buffers and the time for a write. At the maximum number of clients, a new client replaces the
client that has been silent longest. Half-open connections therefore cannot block the server.
"""

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from typing import Any

from urc.model.payload import Payload
from urc.simulator.emulated_robot import EmulatedConnection
from urc.simulator.servers.base import ServerContext

__all__ = ["MAX_CLIENTS", "READ_BYTES", "TAKEN_WITHIN_S", "ClientConnection", "Clients", "converse"]

MAX_CLIENTS = 64
"""Maximum number of connections per transport."""
READ_BYTES = 4096
TAKEN_WITHIN_S = 5.0
"""Write timeout in seconds; a client that does not read its data in time is disconnected."""

log = logging.getLogger(__name__)


class ClientConnection:
    """One client that is connected to a simulated server."""

    def __init__(self, line: EmulatedConnection, abort: Callable[[], None]) -> None:
        self.line = line
        self.abort = abort
        """Function that disconnects the client immediately; further calls have no effect."""
        self.active_s = asyncio.get_running_loop().time()
        """Time of the client's last data, on the event loop's clock."""


class Clients:
    """The clients of one server, with one task per client."""

    def __init__(self, context: ServerContext, limit: int = MAX_CLIENTS) -> None:
        self._context = context
        self._limit = limit
        self._talks: dict[ClientConnection, asyncio.Task[None]] = {}

    @property
    def lines(self) -> Sequence[EmulatedConnection]:
        """The robot's side of each open connection."""
        return [client.line for client in self._talks]

    def admit(
        self,
        talk: Callable[[ClientConnection], Coroutine[Any, Any, None]],
        abort: Callable[[], None],
    ) -> None:
        """Run `talk` for a new client. When the client is replaced or `talk` ends, call `abort`.

        `talk` may raise OSError or TimeoutError if the client is lost.
        """
        if len(self._talks) >= self._limit:
            silent = min(self._talks, key=lambda client: client.active_s)
            silent.active_s = math.inf  # it is closing, and must not be chosen again
            silent.abort()
            self._talks[silent].cancel()
        client = ClientConnection(self._context.line(), abort)
        self._talks[client] = asyncio.create_task(self._attend(client, talk))

    async def close(self) -> None:
        """Disconnect every client."""
        tasks = list(self._talks.values())
        for client, task in self._talks.items():
            client.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _attend(
        self,
        client: ClientConnection,
        talk: Callable[[ClientConnection], Coroutine[Any, Any, None]],
    ) -> None:
        name = self._context.name
        try:
            await talk(client)
        except (OSError, TimeoutError) as fault:
            log.info("%s: lost a client: %s", name, str(fault) or "it did not read its data")
        finally:
            client.abort()
            self._talks.pop(client, None)
            if client.line.faults:
                text, count = client.line.last_fault, client.line.faults
                log.info("%s: %s (%d faults in all)", name, text, count)


async def converse(
    context: ServerContext,
    client: ClientConnection,
    take: Callable[[], Awaitable[Payload | None]],
    put: Callable[[Sequence[Payload]], Awaitable[None]],
) -> None:
    """Exchange data with one client until the client or the robot closes the connection.

    With ``connection: per_request``, the robot closes the connection after one reply.

    Args:
        context: context of the server.
        client: client with the robot's side of its connection.
        take: function that returns the client's next payload; None or b"" at the end of input.
            Calls to `take` can be cancelled and repeated without data loss.
        put: function that sends the robot's payloads and waits while the client's buffer is full.

    Raises:
        TimeoutError: the client does not read its data.
    """
    clock = asyncio.get_running_loop().time
    line, before_s = client.line, clock()
    limit = 1 if context.spec.connection == "per_request" else None
    while True:
        said_by_client: Payload | None = b""
        try:
            async with asyncio.timeout(line.due_in_s) as wait:
                said_by_client = await take()
        except TimeoutError:
            if not wait.expired():
                raise  # the system reports the client as lost
        if not said_by_client and not wait.expired():
            return
        now_s, was_late = clock(), line.has_late
        said: list[Payload] = list(line.advance(now_s - before_s, context.now()))
        before_s = now_s
        answers: list[Payload] = []
        if said_by_client:
            client.active_s = now_s
            answers = list(line.receive(said_by_client, context.now(), limit))
        if said or answers:
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await put(said + answers)
        is_answered = limit is not None and bool(answers or (was_late and said))
        if (line.is_over or is_answered) and not line.has_late:
            return
        await asyncio.sleep(0)  # reading buffered data does not yield to other tasks
