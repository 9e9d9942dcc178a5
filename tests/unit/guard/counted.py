"""A session, its guard and a robot whose frames carry numbers, on a clock that the test moves.

All is real but the wire and the process: what the two sides say goes as bytes through a pipe that
takes its time, so both do things of which the other has not heard.
"""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.dialogue import driver_of
from urc.guard import messages
from urc.guard.local_channel import LocalChannel
from urc.model.payload import Payload
from urc.model.profile import Profile
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import Reason
from urc.motion.lease import Operator
from urc.runtime import guarding, held_commands
from urc.runtime.motion_controller import MotionController
from urc.runtime.session import Session
from urc.testing.clock import FakeClock, settle
from urc.testing.transport import table_of
from urc.transports.base import ConnectFailed, PeerClosed

__all__ = ["NUMBERS", "Robot", "World", "opened", "parted"]

NUMBERS = 100
"""From 0 on; after the last comes 0."""
DRIVER = r"""
signals: { volts: { type: integer } }
transports:
  wire:
    type: %s
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    timeouts: { connect: 1s, reply: 500ms }
    queue: { in_flight: 3 }
    reconnect: { initial: 100ms, max: 200ms }
    keepalive: { send: "{{ seq('n', 0, 99) }} ALIVE", every: 70ms }
commands:
  drive:
    send: "{{ seq('n', 0, 99) }} DRIVE {{ v }}"
    args: { v: { type: integer, min: -9, max: 9, default: 0 } }
    hold: { repeat: 50ms, release: {}, watchdog: none }
  turn:
    send: "{{ seq('n', 0, 99) }} TURN {{ v }}"
    args: { v: { type: integer, min: -9, max: 9, default: 0 } }
    hold: { repeat: 20ms, release: {}, watchdog: none }
  ping:
    send: "{{ seq('n', 0, 99) }} PING"
    reply: { regex: '^(?P<_n>\d+) PONG$', match: _n == seq.n }
  beep: { send: BEEP }
polls:
  - send: "{{ seq('n', 0, 99) }} VOLTS"
    every: 50ms
    reply: { regex: '^(?P<_n>\d+) V (?P<volts>\d+)$', match: _n == seq.n }
"""
_PROFILES = {
    kind: Profile("talker", "Talker", "talker.yaml", driver=driver_of(DRIVER % kind))
    for kind in ("tcp", "pigeon")
}


class Robot:
    """Answers what is asked; each connection is a list of what it heard."""

    address = "wire"

    def __init__(self, *, is_bytewise: bool) -> None:
        self.heard: list[list[str]] = []
        """Of each connection, the newest last."""
        self.is_open = False
        self.is_gone = False
        """Whether nothing listens."""
        self.unread: deque[Payload | PeerClosed] = deque()
        self._is_bytewise = is_bytewise
        self._arrived = asyncio.Event()
        self._flowing = asyncio.Event()
        self._flowing.set()

    def freeze(self, is_frozen: bool) -> None:
        """Take nothing more, or take it again."""
        if is_frozen:
            self._flowing.clear()
        else:
            self._flowing.set()

    def cut(self) -> None:
        """End the connection."""
        self.unread.append(PeerClosed("the robot hung up"))
        self._arrived.set()

    async def open(self, timeout_s: float) -> None:
        if self.is_gone:
            raise ConnectFailed("nothing listens")
        self.is_open = True
        self.heard.append([])
        self.unread.clear()
        self._flowing.set()

    async def receive(self) -> Payload:
        while not self.unread:
            self._arrived.clear()
            await self._arrived.wait()
        found = self.unread.popleft()
        if isinstance(found, PeerClosed):
            self.unread.appendleft(found)
            raise found
        return found

    async def send(self, data: Payload) -> None:
        self.take(data)
        await self._flowing.wait()

    async def close(self) -> None:
        self.is_open = False

    def take(self, data: Payload) -> None:
        assert isinstance(data, bytes)
        for text in data.decode().splitlines():
            self.heard[-1].append(text)
            number, _, word = text.partition(" ")
            if word in ("PING", "VOLTS"):
                said = f"{number} {'PONG' if word == 'PING' else 'V 12'}\n".encode()
                parts = [said[at : at + 1] for at in range(len(said))]
                self.unread.extend(parts if self._is_bytewise else [said])
                self._arrived.set()


class PromptRobot(Robot):
    """One whose line takes bytes without waiting, and tells what is unsent."""

    def __init__(self, *, is_bytewise: bool) -> None:
        super().__init__(is_bytewise=is_bytewise)
        self.unsent_bytes = 0

    def offer(self, data: bytes) -> bool:
        self.take(data)
        self.unsent_bytes += 0 if self._flowing.is_set() else len(data)
        return True

    def freeze(self, is_frozen: bool) -> None:
        super().freeze(is_frozen)
        if not is_frozen:
            self.unsent_bytes = 0

    async def open(self, timeout_s: float) -> None:
        await super().open(timeout_s)
        self.unsent_bytes = 0

    def unsent(self) -> int:
        return self.unsent_bytes


class PipedChannel(LocalChannel):
    """A guard behind a pipe that takes `delay_s`, each way."""

    delay_s = 0.0

    def start(self) -> None:
        self._to_guard: deque[bytes] = deque()
        self._to_engine: deque[bytes] = deque()
        self._encode = messages.encoder().encode
        self._of_guard, self._of_server = messages.decoder_of_guard(), messages.decoder_of_server()
        super().start()

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        self._to_guard.append(self._encode(message))
        self._clock.call_at(self._clock.now() + self.delay_s, self._to)

    def _to(self) -> None:
        if self._to_guard:
            self._host.handle(self._of_guard.decode(self._to_guard.popleft()))
            self._host.settle()

    def _emit(self, message: messages.FromGuard) -> int:
        data = self._encode(message)
        self._to_engine.append(data)
        self._clock.call_at(self._clock.now() + self.delay_s, self._from)
        return len(data)

    def _from(self) -> None:
        if self._to_engine:
            data = self._to_engine.popleft()
            self._listener.handle(self._of_server.decode(data), len(data))

    async def finish(self) -> None:
        while self._to_guard:
            self._to()
        await super().finish()
        while self._to_engine:
            self._from()


class World:
    """Somebody who drives, and what the robot hears."""

    def __init__(self, session: Session, robot: Robot, clock: FakeClock) -> None:
        self.session, self.robot, self.clock = session, robot, clock
        self.controller = MotionController(session.profile.driver)
        self.controller.join(Operator("ann", "ann", "maintain"))
        assert session.backend is not None
        self.guard = session.backend
        self.controller.attach(session)
        self._ticks = 0
        self._asking: list[asyncio.Task[object]] = []
        self.failures: list[str] = []

    def delay(self, seconds: float) -> None:
        """Let the pipe take so long from now on."""
        assert isinstance(self.guard.channel, PipedChannel)
        self.guard.channel.delay_s = seconds

    def take(self) -> None:
        """Take the controls."""
        self.controller.drive("ann", "reset", self.clock.now())
        self.controller.drive("ann", "leave", self.clock.now())
        self.controller.drive("ann", "take", self.clock.now())

    def tick(self, command: str, value: int) -> str:
        """Hold a control."""
        self._ticks += 1
        now = self.clock.now()
        given = ControlInput(
            self.controller.lease.state.epoch, self._ticks, self.controller.heartbeat("ann", now)
        )
        return self.controller.tick("ann", command, {"v": value}, given, now)

    def ask(self, command: str) -> None:
        """Give a command, and note how it fails, if it does."""
        self._asking.append(asyncio.create_task(self._ask(command)))

    async def _ask(self, command: str) -> None:
        try:
            await self.session.command(command)
        except Exception as error:
            self.failures.append(str(error))

    async def follow(self) -> None:
        """Tell the desk of stops, for ever."""
        assert self.session.backend is not None
        while True:
            stops: list[tuple[str, Reason]] = list(await self.session.backend.stops())
            for command, reason in stops:
                self.controller.stopped(command, reason)


@asynccontextmanager
async def opened(
    *,
    is_prompt: bool,
    is_lossy: bool = False,
    is_bytewise: bool = False,
) -> AsyncIterator[World]:
    """Open a session behind a pipe; at its end everything has stopped, and been said."""
    clock, kind = FakeClock(), "pigeon" if is_lossy else "tcp"
    robot = (PromptRobot if is_prompt else Robot)(is_bytewise=is_bytewise)
    table = table_of(**{kind: robot})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(guarding, "LocalChannel", PipedChannel)
        patch.setattr(held_commands, "_LOSSY", frozenset(("pigeon",)))
        session = Session(
            _PROFILES[kind], {}, table, clock=clock, random=lambda: 0.0, motion="here"
        )
        async with _served(session, robot, clock) as world:
            yield world


@asynccontextmanager
async def _served(session: Session, robot: Robot, clock: FakeClock) -> AsyncIterator[World]:
    ready, done = asyncio.Event(), asyncio.Event()

    async def serve() -> None:
        async with session:
            ready.set()
            await done.wait()

    serving = asyncio.create_task(serve())
    await ready.wait()
    world = World(session, robot, clock)
    following = asyncio.create_task(world.follow())
    await clock.advance(0.0)
    try:
        yield world
    finally:
        world.controller.detach()
        following.cancel()
        done.set()
        for _ in range(2000):
            if serving.done():
                break
            await clock.advance(0.01)
        await settle()
        await serving


def parted(texts: list[str]) -> tuple[list[int], list[str]]:
    """Return the numbers of a connection's frames, and the words of all its frames."""
    words = [text.split() for text in texts]
    return [int(one[0]) for one in words if one[0].isdigit()], [
        " ".join(one[1:]) if one[0].isdigit() else one[0] for one in words
    ]
