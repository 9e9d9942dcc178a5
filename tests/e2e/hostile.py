"""Robots that misbehave, each a real listening socket run by a few lines of the test."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

from tests.e2e.ports import free_port

__all__ = ["HOSTILE", "Robot", "closes", "drips", "good", "robot_on"]

Behave = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


async def endless_line(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send one line that never ends, as fast as it is taken."""
    while True:
        writer.write(b"x" * 65536)
        await writer.drain()


async def garbage(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send bytes that are no text, in frames and without."""
    while True:
        writer.write(bytes(range(256)) * 16)
        await writer.drain()


async def tiny_frames(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Send nothing but ends of frames."""
    while True:
        writer.write(b"\n" * 65536)
        await writer.drain()


async def nothing(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Take everything and say nothing."""
    while await reader.read(4096):
        pass


async def deaf(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Take nothing and say nothing."""
    await asyncio.Event().wait()


async def closes(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Close at once."""


async def resets(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Reset the connection."""
    writer.transport.abort()


async def drips(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answer right, one byte at a time."""
    while await reader.readline():
        for byte in b"77\n":
            writer.write(bytes([byte]))
            await writer.drain()
            await asyncio.sleep(0.01)


async def good(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answer every line with a number, and keep the connection."""
    while await reader.readline():
        writer.write(b"42\n")
        await writer.drain()


HOSTILE: dict[str, Behave] = {
    behave.__name__: behave
    for behave in (endless_line, garbage, tiny_frames, nothing, deaf, closes, resets)
}


class Robot:
    """One listening robot; `behave` may be changed between connections."""

    def __init__(self, behave: Behave) -> None:
        self.behave = behave
        self.port = free_port()
        self.connections = 0
        self._server: asyncio.Server | None = None
        self._tasks: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    async def start(self) -> None:
        """Listen, each time on the same port."""
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", self.port)

    async def kill(self) -> None:
        """Stop listening and cut every connection, as a power failure would."""
        assert self._server is not None
        self._server.close()
        tasks = list(self._tasks)
        for task, writer in self._tasks.items():
            writer.transport.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._server.wait_closed()

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        task = asyncio.create_task(self._run(reader, writer))
        self._tasks[task] = writer
        task.add_done_callback(self._tasks.pop)

    async def _run(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            await self.behave(reader, writer)
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()


@asynccontextmanager
async def robot_on(behave: Behave) -> AsyncIterator[Robot]:
    """Run a robot for the length of the context."""
    robot = Robot(behave)
    await robot.start()
    try:
        yield robot
    finally:
        await robot.kill()
