"""A real Zenoh router and a device of it, from the wheel, behind a wire that the test can spoil."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

import zenoh

from tests.e2e.ports import free_port
from tests.e2e.transports.peers.base import Behaviour, Traits
from tests.e2e.transports.peers.tcp import TcpPeer
from urc.model.payload import Envelope
from urc.transports.base import TopicSubscription, Transport, TransportSetup
from urc.transports.zenoh import from_setup

__all__ = ["ZenohPeer", "other_program", "router_config", "warm_up"]


def router_config(port: int, **more: object) -> Any:
    """Return the settings of a router on a loopback port, without scouting."""
    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        **more,
    }
    return zenoh.Config.from_json5(json.dumps(settings))


@asynccontextmanager
async def other_program(module: str, *arguments: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run a module in a second process, with its input and output as pipes."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", module, *arguments),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()
        process._transport.close()  # type: ignore[attr-defined] # else it is closed too late


def warm_up() -> None:
    """Start the library's permanent threads, so that tests do not count them as left behind."""
    port = free_port()
    router = zenoh.open(router_config(port))
    client = {"mode": "client", "connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(client))) as session:
        list(session.get("nothing"))
    router.close()


warm_up()


class ZenohPeer(TcpPeer):
    """The wire ends in front of the router, and behaves there as told."""

    traits = Traits(is_stream=False)
    ask = Envelope("publish", {"topic": "ask"}, b"how much?")
    answer = Envelope("message", {"topic": "answer"}, b"42 %")

    def __init__(self) -> None:
        super().__init__()
        self._router: Any = None
        self._hidden = 0
        self._behaviour: Behaviour = "echo"
        self._tasks: set[asyncio.Task[None]] = set()
        self._is_asked = asyncio.Event()

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen; a router that refuses or is mute needs no Zenoh."""
        if behaviour in ("refuses", "mute"):
            return await super().start(behaviour)
        self._behaviour = behaviour
        self._hidden = free_port()
        self._router = await asyncio.to_thread(zenoh.open, router_config(self._hidden))
        loop = asyncio.get_running_loop()
        self._subscriber = self._router.declare_subscriber(
            "ask",
            zenoh.handlers.Callback(
                lambda _: loop.call_soon_threadsafe(self._asked), indirect=False
            ),
        )
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        self._server = await asyncio.start_server(self._meet, sock=self._listener)
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        options = {"host": "127.0.0.1", "port": self.port}
        return from_setup(TransportSetup("wire", options, (TopicSubscription("answer"),)))

    async def stop(self) -> None:
        """Cut the wires, and close the router."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await super().stop()
        if self._router is not None:
            await asyncio.to_thread(self._router.close)
            self._router = self._subscriber = None

    def _asked(self) -> None:
        self._is_asked.set()
        if self._behaviour in ("echo", "drips"):
            self._say()
        elif self._behaviour == "floods" and len(self._tasks) < 3:
            self._keep(self._flood())

    def _say(self) -> None:
        self._router.put("answer", b"42 %", express=True)

    def _keep(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _flood(self) -> None:
        while True:
            for _ in range(500):
                self._say()
            await asyncio.sleep(0)

    def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._keep(self._pass(reader, writer))

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Carry one client's bytes to the router and back."""
        behind, ahead = await asyncio.open_connection("127.0.0.1", self._hidden)
        self._is_asked.clear()
        ways = [
            asyncio.create_task(self._out(reader, ahead, writer)),
            asyncio.create_task(self._back(behind, writer)),
        ]
        if self._behaviour == "closes":
            ways.append(asyncio.create_task(self._until_asked()))
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for way in ways:
                way.cancel()
            for end in (writer, ahead):
                end.close()

    async def _until_asked(self) -> None:
        await self._is_asked.wait()

    async def _out(
        self, reader: asyncio.StreamReader, ahead: asyncio.StreamWriter, writer: Any
    ) -> None:
        while data := await reader.read(65536):
            ahead.write(data)
            await ahead.drain()
            if self._behaviour == "deaf" and b"answer" in data:  # it has subscribed
                writer.transport.pause_reading()
                await asyncio.Event().wait()

    async def _back(self, behind: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await behind.read(65536):
            if self._behaviour == "drips":
                for byte in data:
                    writer.write(bytes([byte]))
                    await asyncio.sleep(0.001)
            else:
                writer.write(data)
            await writer.drain()
