"""What the engine's side keeps of its lines and held commands, wherever the guard is.

`LocalGuard` is the guard without a process, for tests and for whoever asks for it.
"""

import asyncio
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from urc.guard import wire
from urc.guard.host import Host
from urc.guard.lane import Clock
from urc.guard.proxy import GuardedTransport, Stands
from urc.model.codec import Count, Counted, Numbered, Payload, Series, size_of
from urc.motion.hold import STOP_FOR_S, Reason, Terms
from urc.transports.base import Transport

__all__ = ["Client", "LineSpec", "LocalGuard"]

_MOST_STOPS: Final = 256
_TELLING_S: Final = 0.5
"""What it may take until the guard has what it is told."""
_UNCOUNTED: Final = Count({}, {})
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
    at_s: float = 0.0
    """When that was taken."""
    counted: Counted | None = None
    """Its frame, while it is held, where that carries a number."""
    may_move: bool = False
    stopped_s: float = float("-inf")
    """When its last stop was told."""


class Client:
    """The lines of one robot behind a guard, and its held commands."""

    def __init__(self, lines: Sequence[LineSpec]) -> None:
        """Prepare; `start` begins. `lines` are in the order in which they carry each other."""
        self._lines = tuple(lines)
        self.transports = {
            spec.make.line: GuardedTransport(
                spec.make.line, spec.transport.address, self._post, self._ready, self._stands
            )
            for spec in lines
        }
        self._held: dict[str, _Held] = {}
        self.on_stand: Stands = _unheard
        """Told how the counters of a line stand, and whether no frame of the engine that carries
        one is still on its way."""
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

    def tick(self, control: str, data: Payload | Counted) -> None:
        """Renew the lease of `control`; `data` is its newest frame. Never waits."""
        held = self._held.get(control)
        if held is not None:
            held.number += 1
            held.at_s = self._now()
            held.may_move = True
            held.counted = data if isinstance(data, Counted) else None
            numbered = data.numbered if isinstance(data, Counted) else Numbered(data, _UNCOUNTED)
            self._pass_tick(control, held, numbered)

    def _pass_tick(self, control: str, held: _Held, numbered: Numbered) -> None:
        count = numbered.takes if numbered.takes.after else None
        tick = wire.Tick(control, held.number, numbered.data, held.at_s, count)
        self._pass_newest(control, tick)

    def renew(self, control: str, stop: Payload | Series) -> None:
        """Let `stop` be what stops `control` from now on; it arms nothing."""
        held = self._held.get(control)
        if held is not None:
            held.terms = terms = held.terms.stopped_by(stop)
            self._pass_newest(f"{control} stop", wire.Renew(control, terms.stop, terms.stops))

    def release(self, control: str) -> None:
        """Stop `control`, which was let go."""
        self._let_go(control)
        self._post(wire.Release(control))

    def stop(self, controls: Sequence[tuple[str, str, Terms]]) -> None:
        """Stop at once, whatever moves: line, control and terms of each."""
        for line, control, terms in controls:
            held = self._remember(line, control, terms)
            held.is_armed = False
            held.may_move = True  # until it is known that the stop was written
            self._let_go(control)
        self._pass_stop(wire.Stop(list(controls)))

    def is_stopping(self, control: str) -> bool:
        """Return whether `control` may be moving, or its stop may still be repeated."""
        held = self._held.get(control)
        if held is None:
            return False
        return held.may_move or self._now() - held.stopped_s < STOP_FOR_S + _TELLING_S

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        """Wait for the next stops that were written; being cancelled loses none."""
        while not self._stops:
            self._stopped.clear()
            await self._stopped.wait()
        found = tuple(self._stops)
        self._stops.clear()
        return found

    def _let_go(self, control: str) -> None:
        """Forget a tick that waits, and make none again: it would begin a motion."""
        self._drop(control)
        held = self._held.get(control)
        if held is not None:
            held.counted = None

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
            if isinstance(said, wire.Counted):
                self._tick_again(said)

    def _stands(self, line: str, stand: Mapping[str, int], is_settled: bool) -> None:
        self.on_stand(line, stand, is_settled)

    def _tick_again(self, said: wire.Counted) -> None:
        """Make ticks again whose numbers were used up; they are as old as they were."""
        for control, number in said.stale:
            held = self._held.get(control)
            if held is None or held.counted is None or held.number != number:
                continue  # it was let go, or a newer one is under way
            numbered = held.counted.again()
            if numbered is not None:
                self._pass_tick(control, held, numbered)

    def _note(self, said: wire.Stopped) -> None:
        held = self._held.get(said.control)
        if held is not None:
            held.stopped_s = self._now()
            if said.number == held.number:  # else there is a newer tick under way
                held.may_move = False
            if said.reason != "released":
                held.is_armed = False
                held.counted = None
        self._stops.append((said.control, said.reason))
        self._stopped.set()

    # -- the way to the guard

    def _now(self) -> float:
        return time.monotonic()

    def _post(self, said: wire.ToGuard) -> None:
        raise NotImplementedError

    def _pass_newest(self, slot: str, said: wire.ToGuard) -> None:
        """Pass on what takes the place of what waits in its slot."""
        self._post(said)

    def _pass_stop(self, said: wire.Stop) -> None:
        self._post(said)

    def _drop(self, control: str) -> None:
        """Forget a tick that waits."""

    async def _ready(self) -> None:
        """Return when there is a guard."""


def _unheard(line: str, stand: Mapping[str, int], is_settled: bool) -> None:
    """Nobody counts."""


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
