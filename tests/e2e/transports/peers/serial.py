"""A robot at the other end of a pseudo-terminal, run by the test.

Opening a port asks nobody. A wire has no far end that could be known: a robot that vanishes is only
silent. Unplugging the port is told, and is what "closes" does here.
"""

import asyncio
import errno
import os
import pty
import tempfile
import tty
from pathlib import Path

from tests.e2e.transports.peers.base import Behaviour, Traits
from urc.transports.base import Transport, TransportSetup
from urc.transports.serial import from_setup

__all__ = ["SerialPeer"]


class SerialPeer:
    """Holds one pseudo-terminal."""

    traits = Traits(open_can_wait=False, tells_vanishing=False)
    ask = b"Give me the battery %\n"
    answer = b"Give me the battery %\n"

    def __init__(self) -> None:
        self._behaviour: Behaviour = "echo"
        self._wire, self._held = pty.openpty()
        self._task: asyncio.Task[None] | None = None
        self._folder = tempfile.TemporaryDirectory()

    async def start(self, behaviour: Behaviour) -> Transport:
        """Hold the far end, unless the port is not there."""
        self._behaviour = behaviour
        tty.setraw(self._held)
        os.set_blocking(self._wire, False)
        path = Path(self._folder.name, "port")
        if behaviour != "refuses":
            path.symlink_to(os.ttyname(self._held))
        if behaviour not in ("refuses", "deaf"):
            self._task = asyncio.create_task(self._behave())
        return from_setup(TransportSetup("wire", {"port": str(path), "baud": 115200}))

    async def vanish(self) -> None:
        """Nobody can tell."""
        raise NotImplementedError

    async def stop(self) -> None:
        """Unplug it."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        self._unplug()
        self._folder.cleanup()

    def _unplug(self) -> None:
        for end in (self._wire, self._held):
            if end >= 0:
                os.close(end)
        self._wire = self._held = -1

    async def _behave(self) -> None:
        while True:
            data = await self._some()
            if self._behaviour == "closes":
                self._unplug()
                return
            if self._behaviour == "echo":
                await self._write(data)
            elif self._behaviour == "drips":
                for byte in data:
                    await self._write(bytes([byte]))
                    await asyncio.sleep(0.01)
            while self._behaviour == "floods":
                await self._write(self.answer * 100)

    async def _some(self) -> bytes:
        while True:
            try:
                return os.read(self._wire, 4096)
            except OSError as fault:
                if fault.errno not in (errno.EAGAIN, errno.EIO):
                    raise
            await asyncio.sleep(0.002)

    async def _write(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self._wire, data) :]
            except BlockingIOError:
                await asyncio.sleep(0.002)
