"""What the engine's side keeps of its lines and held commands, wherever the guard is.

`LocalGuard` is the guard without a process, for tests and for whoever asks for it.
"""

import asyncio
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from urc.guard import wire
from urc.guard.host import Host
from urc.guard.lane import Clock
from urc.guard.proxy import GuardedTransport
from urc.model.codec import Payload, size_of
from urc.motion.hold import Reason, Terms
from urc.transports.base import Transport

__all__ = ["Client", "LineSpec", "LocalGuard"]

_MOST_STOPS: Final = 256
_OVERHEAD_BYTES: Final = 32
"""What a message counts for beside its payload."""


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
            self._post(wire.Tick(control, held.number, data, self._now()))

    def rehearse(self, control: str, data: Payload) -> None:
        """Let the guard go the way of a tick, and write nothing, where it is another process."""

    def renew(self, control: str, stop: Payload) -> None:
        """Let `stop` be what stops `control` from now on; it arms nothing."""
        held = self._held.get(control)
        if held is not None:
            held.terms = held.terms._replace(stop=stop)
            self._pass_renewed(wire.Renew(control, stop))

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

    def _pass_renewed(self, said: wire.Renew) -> None:
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
