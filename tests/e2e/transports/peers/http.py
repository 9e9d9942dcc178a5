"""A robot behind a web server, run by the test: as plain as the protocol allows."""

import asyncio
from contextlib import suppress

from tests.e2e.transports.peers.base import Behaviour, Traits
from tests.e2e.transports.peers.tcp import TcpPeer
from urc.model.payload import Envelope, Payload
from urc.transports.base import TopicSubscription, Transport, TransportSetup
from urc.transports.http import from_setup

__all__ = ["HttpPeer"]

_BODY = b"87 %"


class HttpPeer(TcpPeer):
    """Listens on a free port of loopback.

    A web server that closes says nothing by it (`tells_close`): the next request gets a connection
    of its own. It floods with lines, on a stream beside the request.
    """

    traits = Traits(is_stream=False, tells_close=False)
    ask: Payload = Envelope("request", {"method": "POST", "path": "/battery", "id": 7}, _BODY)  # type: ignore[assignment]
    answer: Payload = Envelope(  # type: ignore[assignment]
        "response",
        {"id": 7, "ok": True, "status": 200, "headers": {"content-length": str(len(_BODY))}},
        _BODY,
    )

    def __init__(self) -> None:
        super().__init__()
        self._behaviour: Behaviour = "echo"
        self._asked = asyncio.Event()
        self._talks: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen as the robot on TCP does, and answer requests where that one would talk."""
        if behaviour in ("refuses", "mute"):
            return await super().start(behaviour)
        self._behaviour = behaviour
        if behaviour == "floods":
            self.answer = Envelope("message", {"topic": "/flood"}, _BODY)
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        self._server = await asyncio.start_server(self._let_in, sock=self._listener)
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        flood = (TopicSubscription("/flood", {"stream": "lines"}),)
        listens = flood if self._behaviour == "floods" else ()
        options = {"url": f"http://127.0.0.1:{self.port}", "response_timeout": "3s"}
        return from_setup(TransportSetup("wire", options, listens))

    async def stop(self) -> None:
        """Let packets pass again and close everything."""
        if self._server is not None:
            self._server.close()
        tasks = list(self._talks)
        for task, writer in self._talks.items():
            writer.transport.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await super().stop()

    def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(self._talk(reader, writer))
        self._talks[task] = writer
        task.add_done_callback(self._talks.pop)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError, asyncio.IncompleteReadError):
            if self._behaviour == "deaf":
                writer.transport.pause_reading()  # type: ignore[attr-defined]
                await asyncio.Event().wait()
            while True:
                head = await reader.readuntil(b"\r\n\r\n")
                if head.startswith(b"GET /flood"):
                    await self._flood(writer)
                await reader.readexactly(len(_BODY))
                self._asked.set()
                answer = f"HTTP/1.1 200 OK\r\nContent-Length: {len(_BODY)}\r\n\r\n".encode() + _BODY
                size = 1 if self._behaviour == "drips" else len(answer)
                for start in range(0, len(answer), size):
                    if self._behaviour in ("echo", "drips"):
                        writer.write(answer[start : start + size])
                        await writer.drain()
                    if self._behaviour == "drips":
                        await asyncio.sleep(0.01)
        writer.transport.abort()

    async def _flood(self, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n")
        await self._asked.wait()
        lines = (_BODY + b"\n") * 1000
        while True:
            writer.write(f"{len(lines):x}\r\n".encode() + lines + b"\r\n")
            await writer.drain()
