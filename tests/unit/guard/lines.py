"""A wire that does as told, and a guard of one line on it."""

import asyncio

from urc.guard import wire
from urc.guard.client import LineSpec, LocalGuard
from urc.model.codec import Payload
from urc.motion.hold import Terms
from urc.motion.stall import STALLED_S
from urc.testing.clock import FakeClock, settle
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError

__all__ = [
    "STOP",
    "TERMS",
    "CountedWire",
    "GatedWire",
    "Rig",
    "ScatteredWire",
    "SlowWire",
    "Wire",
]

STOP = b"stop"
TERMS = Terms(STOP, period_s=0.02)


class Wire:
    """A robot's line that takes what it is told to take."""

    address = "wire"

    def __init__(self) -> None:
        self.written: list[Payload] = []
        self.aborts = 0
        self.opens = 0
        self.is_open = False
        self.refusal = ""
        self.arriving: asyncio.Queue[Payload | TransportError] = asyncio.Queue()

    async def open(self, timeout_s: float) -> None:
        self.opens += 1
        if self.refusal:
            raise ConnectFailed(self.refusal)
        self.is_open = True
        self.arriving = asyncio.Queue()

    async def receive(self) -> Payload:
        found = await self.arriving.get()
        if isinstance(found, TransportError):
            raise found
        return found

    async def send(self, data: Payload) -> None:
        self.written.append(data)

    async def close(self) -> None:
        self.is_open = False

    def cut(self, reason: str = "the line broke") -> None:
        self.arriving.put_nowait(PeerClosed(reason))


class CountedWire(Wire):
    """One that tells what is unsent, and takes bytes at once."""

    def __init__(self) -> None:
        super().__init__()
        self.is_stuck = False
        self.stuck_bytes = 0
        self.touches = 0

    def touch(self) -> None:
        self.touches += 1

    def offer(self, data: bytes) -> bool:
        self.written.append(data)
        if self.is_stuck:
            self.stuck_bytes += len(data)
        return True

    def unsent(self) -> int:
        return self.stuck_bytes

    async def abort(self) -> None:
        self.aborts += 1
        self.stuck_bytes = 0
        self.is_stuck = False
        await self.close()


class ScatteredWire(CountedWire):
    """One on which each thing goes by a connection of its own, so that order is not kept."""

    def __init__(self) -> None:
        super().__init__()
        self.forgotten_bytes = 0

    def forget(self) -> None:
        self.forgotten_bytes += self.stuck_bytes
        self.stuck_bytes = 0


class SlowWire(Wire):
    """One on which sending waits while it is stuck, and nothing else is known."""

    def __init__(self) -> None:
        super().__init__()
        self.flowing = asyncio.Event()
        self.flowing.set()

    async def send(self, data: Payload) -> None:
        await self.flowing.wait()
        self.written.append(data)


class GatedWire(Wire):
    """One that takes one frame for each time that it is told to."""

    def __init__(self) -> None:
        super().__init__()
        self._room = asyncio.Semaphore(0)

    def let_through(self, frames: int = 1) -> None:
        for _ in range(frames):
            self._room.release()

    async def send(self, data: Payload) -> None:
        await self._room.acquire()
        self.written.append(data)


class Rig:
    """A guard of one line, and the engine's side of it."""

    def __init__(
        self, robot: Wire, *, stalled_s: float = STALLED_S, is_strict: bool = False
    ) -> None:
        self.robot = robot
        self.clock = FakeClock()
        make = wire.Make("wire", "", {}, [], "", stalled_s, is_strict)
        line: Transport = robot
        self.guard = LocalGuard([LineSpec(make, line)], self.clock)
        self.guard.start()
        self.transport = self.guard.transports["wire"]

    async def drive(self, terms: Terms = TERMS) -> None:
        await self.transport.open(1.0)
        self.guard.arm("wire", "drive", terms)
        self.tick(b"go 1")
        await settle()

    def tick(self, data: Payload) -> None:
        self.guard.tick("drive", data)

    async def stops(self) -> list[tuple[str, str]]:
        async with asyncio.timeout(1.0):
            return list(await self.guard.stops())
