"""A TCP relay between two sites that can be cut: bytes wait in it, and pass when it is healed."""

import asyncio
from contextlib import suppress

__all__ = ["Partition"]

_READ_BYTES = 65536


class Partition:
    """Passes connections on, until it is cut.

    A cut network loses nothing at once: both ends keep sending into their buffers. Healing delivers
    what was sent meanwhile, which is the worst that a network may do.
    """

    def __init__(self, ports: dict[int, int]) -> None:
        """Prepare a relay; `ports` maps each own port to the port behind it."""
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

    def cut(self) -> None:
        """Pass nothing on, in either direction."""
        self._passes.clear()

    def heal(self) -> None:
        """Pass on what has waited, and all that follows."""
        self._passes.set()

    def _serving(self, port: int):  # type: ignore[no-untyped-def]  # a callback of asyncio
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
            await self._passes.wait()
            try:
                behind = await asyncio.open_connection("127.0.0.1", port)
            except OSError:
                writer.close()
                return
            async with asyncio.TaskGroup() as group:
                group.create_task(self._pump(reader, behind[1]))
                group.create_task(self._pump(behind[0], writer))

        return serve

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(_READ_BYTES):
                await self._passes.wait()
                writer.write(data)
                await writer.drain()
        writer.close()
