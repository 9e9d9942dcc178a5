"""The engine's side of the guard: keeps it running, and remembers what it must stop.

Theory of operation. The guard is a process of its own. It says ten times a second that it is alive;
when it is silent for half a second, or gone, it is killed for good and another is started at once.
That one knows nothing: it is told the lines, the terms of everything armed, and what was moving,
of which it opens the lines and writes the stop before anything else. Nothing moves on by itself.

`LocalGuard` is the same without the process, for tests and for whoever asks for it.
"""

import asyncio
import logging
import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, NamedTuple

from urc.guard import wire
from urc.guard.host import Host
from urc.guard.lane import Clock
from urc.guard.pipe import Pipe
from urc.guard.process import launch, reap
from urc.guard.proxy import GuardedTransport
from urc.model.codec import Payload, size_of
from urc.motion.hold import Reason, Terms
from urc.transports.base import Transport

__all__ = ["CAN_GUARD", "Client", "Guard", "LineSpec", "LocalGuard"]

CAN_GUARD: Final = os.name == "posix"
"""Whether this system can hand a pipe to another process in the way that is used here."""
_LOOK_S: Final = 0.1
_SILENT_LOOKS: Final = 5
_START_LOOKS: Final = 100
"""A machine that is busy may take long until Python runs."""
_STEADY_S: Final = 0.5
"""A guard that lives this long was started well."""
_AT_ONCE: Final = 3
_AGAIN_S: Final = 1.0
"""Guards that end at once are started anew so often right away, and then at this pace."""
_FINISH_S: Final = 3.0
_MOST_STOPS: Final = 256
_OVERHEAD_BYTES: Final = 32
"""What a message counts for beside its payload."""
_DIED: Final = "the guard of this line ended; it is started anew"

log = logging.getLogger(__name__)


class LineSpec(NamedTuple):
    """One line of the robot."""

    make: wire.Make
    transport: Transport
    """Made by `make` in this process, and never opened where the guard is another one."""


@dataclass(slots=True)
class _Held:
    """What is remembered of a held command."""

    line: str
    terms: Terms
    is_armed: bool = False
    number: int = 0
    """Of the newest tick."""
    may_move: bool = False


class Client:
    """The lines of one robot behind a guard, and its held commands."""

    def __init__(self, lines: Sequence[LineSpec]) -> None:
        """Prepare; `start` begins. `lines` are in the order in which they carry each other."""
        self._lines = tuple(lines)
        self.transports = {
            spec.make.line: GuardedTransport(
                spec.make.line, spec.transport.address, self._post, self._ready
            )
            for spec in lines
        }
        self._held: dict[str, _Held] = {}
        self._stops: deque[tuple[str, Reason]] = deque(maxlen=_MOST_STOPS)
        self._stopped = asyncio.Event()

    def start(self) -> None:
        """Begin; needs a running loop."""
        raise NotImplementedError

    async def finish(self) -> None:
        """Stop everything, and leave nothing behind."""
        raise NotImplementedError

    # -- held commands

    def arm(self, line: str, control: str, terms: Terms) -> None:
        """Take ticks of `control`, which goes over `line`, from now on."""
        held = self._remember(line, control, terms)
        held.is_armed = True
        self._post(wire.Arm(line, control, terms))

    def tick(self, control: str, data: Payload) -> None:
        """Renew the lease of `control`; `data` is its newest frame. Never waits."""
        held = self._held.get(control)
        if held is not None:
            held.number += 1
            held.may_move = True
            self._pass_tick(wire.Tick(control, held.number, data, self._now()))

    def release(self, control: str) -> None:
        """Stop `control`, which was let go."""
        self._drop(control)
        self._post(wire.Release(control))

    def stop(self, controls: Sequence[tuple[str, str, Terms]]) -> None:
        """Stop at once, whatever moves: line, control and terms of each."""
        for line, control, terms in controls:
            held = self._remember(line, control, terms)
            held.is_armed = False
            held.may_move = True  # until it is known that the stop was written
            self._drop(control)
        self._pass_stop(wire.Stop(list(controls)))

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        """Wait for the next stops that were written; being cancelled loses none."""
        while not self._stops:
            self._stopped.clear()
            await self._stopped.wait()
        found = tuple(self._stops)
        self._stops.clear()
        return found

    def _remember(self, line: str, control: str, terms: Terms) -> _Held:
        held = self._held.get(control)
        if held is None:
            held = self._held[control] = _Held(line, terms)
        held.line, held.terms = line, terms
        return held

    # -- what is said

    def _take(self, said: wire.FromGuard, size: int) -> None:
        if isinstance(said, wire.Stopped):
            self._note(said)
        elif not isinstance(said, wire.Beat):
            self.transports[said.line].take(said, size)

    def _note(self, said: wire.Stopped) -> None:
        held = self._held.get(said.control)
        if held is not None:
            if said.number == held.number:  # else there is a newer tick under way
                held.may_move = False
            if said.reason != "released":
                held.is_armed = False
        self._stops.append((said.control, said.reason))
        self._stopped.set()

    # -- the way to the guard

    def _now(self) -> float:
        return time.monotonic()

    def _post(self, said: wire.ToGuard) -> None:
        raise NotImplementedError

    def _pass_tick(self, said: wire.Tick) -> None:
        self._post(said)

    def _pass_stop(self, said: wire.Stop) -> None:
        self._post(said)

    def _drop(self, control: str) -> None:
        """Forget a tick that waits."""

    async def _ready(self) -> None:
        """Return when there is a guard."""


class LocalGuard(Client):
    """The guard in this process: one that hangs stops nothing."""

    def __init__(self, lines: Sequence[LineSpec], clock: Clock) -> None:
        """Prepare; `clock` is the time."""
        super().__init__(lines)
        self._clock = clock
        self._host = Host(self._emit, clock)

    def start(self) -> None:
        """Begin."""
        for spec in self._lines:
            self._host.add(spec.make, spec.transport)

    async def finish(self) -> None:
        """Stop everything and close every line."""
        await self._host.finish()

    def _post(self, said: wire.ToGuard) -> None:
        self._host.take(said)
        self._host.settle()

    def _emit(self, said: wire.FromGuard) -> int:
        size = size_of(said.data) + _OVERHEAD_BYTES if isinstance(said, wire.Received) else 0
        self._take(said, size)
        return size

    def _now(self) -> float:
        return self._clock.now()


class Guard(Client):
    """The guard as a process."""

    def __init__(self, lines: Sequence[LineSpec]) -> None:
        """Prepare; nothing is started yet."""
        super().__init__(lines)
        self._encoder = wire.encoder()
        self._decoder = wire.decoder_of_server()
        self._pipe: Pipe | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._is_up = asyncio.Event()
        self._is_finishing = False
        self._gone = asyncio.Event()
        self._look: asyncio.TimerHandle | None = None
        self._look_s = 0.0
        self._silent_looks = 0
        self._was_heard = False
        self._started_s = 0.0
        self._short_lives = 0
        self._reaping: set[asyncio.Task[None]] = set()

    @property
    def pid(self) -> int:
        """Number of the process; 0 while there is none."""
        return 0 if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the process; it takes what it is told as soon as it runs."""
        loop = asyncio.get_running_loop()
        self._started_s = loop.time()
        try:
            self._process, line = launch()
        except OSError as fault:
            log.error("the guard cannot be started (%s)", fault)
            self._is_up.clear()
            self._look = loop.call_later(_AGAIN_S, self.start)
            return
        self._was_heard = False
        self._silent_looks = 0
        self._pipe = Pipe(
            line,
            self._encoder,
            self._decoder,
            take=self._hear,
            settle=_nothing,
            gone=self._died,
        )
        self._brief()
        self._is_up.set()
        self._look_s = self._started_s + _LOOK_S
        self._look = loop.call_at(self._look_s, self._watch)

    async def finish(self) -> None:
        """Let the guard stop everything and end; within 3 s it has."""
        self._is_finishing = True
        if self._look is not None:
            self._look.cancel()
        if self._pipe is not None:
            self._pipe.end()
            is_idle = not any(held.may_move for held in self._held.values())
            if is_idle and not self._was_heard and self._process is not None:
                self._process.kill()  # it has hardly begun: nothing is open, nothing moves
            with suppress(TimeoutError):
                async with asyncio.timeout(_FINISH_S):
                    await self._gone.wait()
        if self._pipe is not None:  # it did not end in time
            self._pipe.close()
            self._pipe = None
        for transport in self.transports.values():
            transport.lost("the session was closed")
        process, self._process = self._process, None
        if process is not None:
            await reap(process)
        if self._reaping:
            await asyncio.wait(self._reaping)

    def _brief(self) -> None:
        """Tell a new guard what it must know; what may move is stopped first."""
        for spec in self._lines:
            self._post(spec.make)
        for control, held in self._held.items():
            if held.may_move:
                held.is_armed = False
                self._post(wire.Owe(held.line, control, held.terms))
                held.number = 0
            elif held.is_armed:
                self._post(wire.Arm(held.line, control, held.terms))

    def _hear(self, said: wire.FromGuard) -> None:
        self._silent_looks = 0
        self._was_heard = True
        self._take(said, 0 if self._pipe is None else self._pipe.taken_bytes)

    def _watch(self) -> None:
        """Look whether the guard is alive."""
        loop = asyncio.get_running_loop()
        if loop.time() - self._look_s < _LOOK_S:  # else it was we who slept
            self._silent_looks += 1
        limit = _SILENT_LOOKS if self._was_heard else _START_LOOKS
        if self._silent_looks > limit and self._pipe is not None:
            log.error("the guard has been silent for %g s", limit * _LOOK_S)
            self._pipe.close()
            self._died()
            return
        self._look_s = loop.time() + _LOOK_S
        self._look = loop.call_at(self._look_s, self._watch)

    def _died(self) -> None:
        """Start another one, unless it was to end."""
        self._gone.set()
        self._pipe = None
        if self._look is not None:
            self._look.cancel()
        if self._is_finishing:
            return
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.send_signal(signal.SIGKILL)  # never two of them on one line
            task = asyncio.get_running_loop().create_task(reap(process))
            self._reaping.add(task)
            task.add_done_callback(self._reaping.discard)
        log.error("the guard ended; another one is started, and stops what moved")
        loop = asyncio.get_running_loop()
        is_short = loop.time() - self._started_s < _STEADY_S
        self._short_lives = self._short_lives + 1 if is_short else 0
        self._gone.clear()
        if self._short_lives < _AT_ONCE:
            self.start()
        else:
            self._is_up.clear()
            self._look = loop.call_later(_AGAIN_S, self.start)
        for transport in self.transports.values():
            transport.lost(_DIED)

    def _post(self, said: wire.ToGuard) -> None:
        if self._pipe is not None:
            self._pipe.post(said)

    def _pass_tick(self, said: wire.Tick) -> None:
        if self._pipe is not None:
            self._pipe.post(said, slot=said.control)

    def _pass_stop(self, said: wire.Stop) -> None:
        if self._pipe is not None:
            self._pipe.post(said, is_urgent=True)

    def _drop(self, control: str) -> None:
        if self._pipe is not None:
            self._pipe.drop(control)

    async def _ready(self) -> None:
        await self._is_up.wait()


def _nothing() -> None:
    """Nothing is to be done after what came together."""
