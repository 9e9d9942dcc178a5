"""A robot on TCP, run by the test."""

import asyncio
import socket
from contextlib import suppress

from tests.e2e.transports.packets import Loss
from tests.e2e.transports.peers.base import Behaviour, Traits
from urc.transports.base import Transport, TransportSetup
from urc.transports.tcp import from_setup

__all__ = ["StreamRobot", "TcpPeer"]


class StreamRobot:
    """Behaves as told on any asyncio stream; other peers over streams use it, too."""

    def __init__(self, behaviour: Behaviour, answer: bytes) -> None:
        self._behaviour = behaviour
        self._answer = answer
        self._tasks: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    def meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Take one client in."""
        task = asyncio.create_task(self._serve(reader, writer))
        self._tasks[task] = writer
        task.add_done_callback(self._tasks.pop)

    async def stop(self) -> None:
        """Cut every client off."""
        tasks = list(self._tasks)
        for task, writer in self._tasks.items():
            writer.transport.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            await self._behave(reader, writer)
            writer.close()
            await writer.wait_closed()
        writer.transport.abort()

    async def _behave(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._behaviour == "deaf":
            writer.transport.pause_reading()  # type: ignore[attr-defined]
            await asyncio.Event().wait()
        while data := await reader.read(65536):
            if self._behaviour == "closes":
                return
            if self._behaviour == "silent":
                continue
            if self._behaviour == "drips":
                for byte in data:
                    writer.write(bytes([byte]))
                    await asyncio.sleep(0.01)
            while self._behaviour == "floods":
                writer.write(self._answer * 1000)
                await writer.drain()
            if self._behaviour == "echo":
                writer.write(data)
            await writer.drain()


class TcpPeer:
    """Listens on a free port of loopback."""

    traits = Traits()
    ask = b"Give me the battery %\n"
    answer = b"Give me the battery %\n"

    def __init__(self) -> None:
        self._listener = socket.socket()
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
        self._server: asyncio.Server | None = None
        self._robot: StreamRobot | None = None
        self._crowd: list[socket.socket] = []
        self._loss: Loss | None = None
        self.port = 0

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen, unless the robot refuses; where it is mute, its queue of callers is full."""
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        if behaviour == "refuses":
            self._listener.close()
        elif behaviour == "mute":
            self._fill()
        else:
            self._robot = StreamRobot(behaviour, self.answer)
            self._server = await asyncio.start_server(self._robot.meet, sock=self._listener)
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        return from_setup(TransportSetup("wire", {"host": "127.0.0.1", "port": self.port}))

    def _begin(self, port: int) -> None:
        self.port = port
        self._loss = Loss(port)

    async def vanish(self) -> None:
        """Lose every packet."""
        assert self._loss is not None
        await self._loss.begin()

    async def stop(self) -> None:
        """Let packets pass again and close everything."""
        if self._loss is not None:
            await self._loss.end()
        if self._server is not None:
            self._server.close()
        if self._robot is not None:
            await self._robot.stop()
        if self._server is not None:
            await self._server.wait_closed()
        self._listener.close()
        for caller in self._crowd:
            caller.close()

    def _fill(self) -> None:
        """Take the places of the queue; the system then answers nobody else."""
        self._listener.listen(0)
        for _ in range(8):
            caller = socket.socket()
            caller.setblocking(False)
            caller.connect_ex(("127.0.0.1", self.port))
            self._crowd.append(caller)
