"""A TCP relay between two sites: it delays bytes, and keeps them while it is cut."""

import asyncio
from asyncio import StreamReader, StreamWriter
from collections.abc import Awaitable, Callable
from contextlib import suppress

__all__ = ["Partition"]

_READ_BYTES = 65536
_MOST_PARTS = 1000


class Partition:
    """Passes connections on, until it is cut.

    A cut network loses nothing at once: both ends keep sending into their buffers. Healing delivers
    what was sent meanwhile, which is the worst that a network may do.
    """

    def __init__(self, ports: dict[int, int]) -> None:
        """Prepare a relay; `ports` maps each own port to the port behind it."""
        self.delay_s = 0.0
        """Delay in each direction, in seconds; changes do not reorder bytes."""
        self._ports = ports
        self._passes = asyncio.Event()
        self._passes.set()
        self._servers: list[asyncio.Server] = []
        self._tasks: set[asyncio.Task[None]] = set()

    async def open(self) -> None:
        """Listen on all ports."""
        for own, behind in self._ports.items():
            self._servers.append(
                await asyncio.start_server(self._serving(behind), "127.0.0.1", own)
            )

    async def close(self) -> None:
        """End all connections."""
        for server in self._servers:
            server.close()
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.sleep(0)  # the transports close in the next turn

    def cut(self) -> None:
        """Pass nothing on, in either direction."""
        self._passes.clear()

    def heal(self) -> None:
        """Pass on what has waited, and all that follows."""
        self._passes.set()

    def _serving(self, port: int) -> Callable[[StreamReader, StreamWriter], Awaitable[None]]:
        async def serve(reader: StreamReader, writer: StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
            writers = [writer]
            try:
                await self._passes.wait()
                behind, onward = await asyncio.open_connection("127.0.0.1", port)
                writers.append(onward)
                async with asyncio.TaskGroup() as group:
                    group.create_task(self._pump(reader, onward))
                    group.create_task(self._pump(behind, writer))
            except OSError:
                pass  # nothing listens there
            finally:
                for one in writers:
                    one.transport.abort()

        return serve

    async def _pump(self, reader: StreamReader, writer: StreamWriter) -> None:
        """Pass on one direction of a connection, and then its end."""
        parts: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(_MOST_PARTS)
        async with asyncio.TaskGroup() as group:
            group.create_task(self._read(reader, parts))
            group.create_task(self._write(parts, writer))

    async def _read(self, reader: StreamReader, parts: asyncio.Queue[tuple[float, bytes]]) -> None:
        data = b" "
        while data:
            try:
                data = await reader.read(_READ_BYTES)
            except OSError:
                data = b""
            await parts.put((asyncio.get_running_loop().time() + self.delay_s, data))

    async def _write(self, parts: asyncio.Queue[tuple[float, bytes]], writer: StreamWriter) -> None:
        while True:
            due_s, data = await parts.get()
            await asyncio.sleep(due_s - asyncio.get_running_loop().time())
            await self._passes.wait()
            if not data:
                break
            with suppress(OSError):
                writer.write(data)
                await writer.drain()
        writer.close()
