"""Robots on TCP in other ways: with TLS, calling us, and as a serial port behind a server."""

import asyncio
import contextlib
import ssl
import tempfile
from pathlib import Path

from tests.e2e.transports.authority import Authority
from tests.e2e.transports.peers.base import Behaviour
from tests.e2e.transports.peers.tcp import StreamRobot, TcpPeer
from urc.transports.base import Transport, TransportSetup
from urc.transports.serial import from_setup as serial_from_setup
from urc.transports.tcp import from_setup

__all__ = ["CallingPeer", "SocketSerialPeer", "TlsPeer"]


class TlsPeer(TcpPeer):
    """Listens with a certificate; where it is mute, it takes the call and agrees on nothing."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory()
        self._authority = Authority(Path(self._folder.name))

    async def start(self, behaviour: Behaviour) -> Transport:
        if behaviour == "refuses":
            return await super().start(behaviour)
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        if behaviour == "mute":
            self._listener.listen()
        else:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*self._authority.sign("127.0.0.1"))
            self._robot = StreamRobot(behaviour, self.answer)
            self._server = await asyncio.start_server(
                self._robot.meet, sock=self._listener, ssl=context
            )
        return self.transport()

    def transport(self) -> Transport:
        tls = {"ca": self._authority.file}
        options = {"host": "127.0.0.1", "port": self.port, "tls": tls}
        return from_setup(TransportSetup("wire", options))

    async def stop(self) -> None:
        await super().stop()
        self._folder.cleanup()


class CallingPeer(TcpPeer):
    """Connects to us, again and again; one that is mute or refuses never does."""

    def __init__(self) -> None:
        super().__init__()
        self._task: asyncio.Task[None] | None = None

    async def start(self, behaviour: Behaviour) -> Transport:
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        self._listener.close()
        if behaviour not in ("refuses", "mute"):
            self._robot = StreamRobot(behaviour, self.answer)
            self._task = asyncio.create_task(self._call())
        return self.transport()

    def transport(self) -> Transport:
        return from_setup(TransportSetup("wire", {"mode": "listen", "port": self.port}))

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        await super().stop()

    async def _call(self) -> None:
        """Call one connection after the other."""
        assert self._robot is not None
        while True:
            with contextlib.suppress(OSError):
                reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
                self._robot.meet(reader, writer)
                with contextlib.suppress(OSError):
                    await writer.wait_closed()
            await asyncio.sleep(0.05)


class SocketSerialPeer(TcpPeer):
    """Stands for a server that passes a port's bytes on."""

    def transport(self) -> Transport:
        return serial_from_setup(
            TransportSetup("wire", {"port": f"socket://127.0.0.1:{self.port}"})
        )
