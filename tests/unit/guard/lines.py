"""A wire that does as told, and a guard of one line on it."""

import asyncio
from collections.abc import Callable
from functools import partial

from urc.guard import messages
from urc.guard.channel import GuardedLineSpec
from urc.guard.guard_client import GuardClient, HeldSpec
from urc.guard.local_channel import LocalChannel
from urc.guard.server import GuardServer
from urc.model.payload import Payload
from urc.motion.hold_to_run import HoldTerms
from urc.motion.stall import STALLED_S
from urc.testing.clock import FakeClock, settle
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError

__all__ = [
    "HELD",
    "STOP",
    "TERMS",
    "Bench",
    "CountedWire",
    "GatedWire",
    "Prompter",
    "Rig",
    "ScatteredWire",
    "SlowWire",
    "Wire",
]

STOP = b"stop"
TERMS = HoldTerms(STOP, period_s=0.02)
HELD = {name: HeldSpec("wire", TERMS) for name in ("drive", "turn", "lift", "aim")}


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

    def cut(self, reason: str = "the connection broke") -> None:
        self.arriving.put_nowait(PeerClosed(reason))


class CountedWire(Wire):
    """One that tells what is unsent, and takes bytes at once."""

    def __init__(self) -> None:
        super().__init__()
        self.is_stuck = False
        self.stuck_bytes = 0

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


class Prompter(GatedWire):
    """One that takes bytes at once while it is let, and all else where there is room."""

    def __init__(self) -> None:
        super().__init__()
        self.is_prompt = True
        self.is_clogged = False
        self.sink: Callable[[bytes], bool] | None = None

    def offer(self, data: bytes) -> bool:
        assert type(data) is bytes
        if self.is_prompt:
            self.written.append(data)
        return self.is_prompt

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        self.sink = sink


class Bench:
    """The guard's side of one line, told message by message; keeps what it says."""

    def __init__(
        self,
        robot: Wire,
        *,
        stalled_s: float = STALLED_S,
        is_strict: bool = False,
    ) -> None:
        self.robot = robot
        self.clock = FakeClock()
        self.said: list[messages.FromGuard] = []
        self.host = GuardServer(self._emit, self.clock)
        self.host.add(messages.MakeTransport("wire", "", {}, [], "", stalled_s, is_strict), robot)

    def _emit(self, said: messages.FromGuard) -> int:
        self.said.append(said)
        return len(said.data) if isinstance(said, messages.BytesReceived) else 0

    def tell(self, *messages: messages.ToGuard) -> None:
        """Tell it what comes together."""
        for message in messages:
            self.host.handle(message)
        self.host.settle()

    async def open(self, turn: int = 1) -> None:
        self.tell(messages.OpenLine("wire", turn, 1.0))
        await settle()
        assert self.heard() == [messages.LineOpened("wire", turn, "wire", {})]

    def heard(self) -> list[messages.FromGuard]:
        """Return what it said since this was last asked."""
        said, self.said[:] = [*self.said], []
        return said

    def tick(self, data: Payload, *, number: int = 1, control: str = "drive") -> None:
        self.tell(messages.RenewLease(control, number, data, self.clock.now()))

    async def drive(self, terms: HoldTerms = TERMS) -> None:
        await self.open()
        self.tell(messages.ArmControl("wire", "drive", terms))
        self.tick(b"go 1")
        await settle()


class Rig:
    """A guard of one line, and the engine's side of it."""

    def __init__(
        self,
        robot: Wire,
        *,
        stalled_s: float = STALLED_S,
        is_strict: bool = False,
        silent_s: float | None = None,
    ) -> None:
        self.robot = robot
        self.clock = FakeClock()
        make = messages.MakeTransport("wire", "", {}, [], "", stalled_s, is_strict, silent_s)
        line: Transport = robot
        lines = [GuardedLineSpec(make, line)]
        channel_to = partial(LocalChannel, lines=lines, clock=self.clock)
        self.guard = GuardClient(lines, HELD, channel_to)
        self.guard.start()
        self.transport = self.guard.transports["wire"]

    async def drive(self, terms: HoldTerms = TERMS) -> None:
        await self.transport.open(1.0)
        self.guard.arm("drive", terms)
        self.tick(b"go 1")
        await settle()

    def tick(self, data: Payload) -> None:
        self.guard.tick("drive", data)

    def caught(self) -> list[tuple[str, messages.ToGuard]]:
        """Return the messages that replace unsent ones, with their slots: none is sent any more."""
        found: list[tuple[str, messages.ToGuard]] = []
        post = self.guard.channel.post

        def catch(message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
            if slot:
                found.append((slot, message))
            else:
                post(message, is_urgent=is_urgent)

        self.guard.channel.post = catch  # type: ignore[method-assign]
        return found

    async def stops(self) -> list[tuple[str, str]]:
        async with asyncio.timeout(1.0):
            return list(await self.guard.stops())
