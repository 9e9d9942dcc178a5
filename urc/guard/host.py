"""What happens in the guard: lines by name, and what is said about them."""

import asyncio
from collections.abc import Callable
from importlib import import_module
from operator import attrgetter
from typing import Any, Final

from urc.guard import wire
from urc.guard.lane import Clock
from urc.guard.line import Emit, Line
from urc.transports.base import Setup, Subscription, Transport

__all__ = ["FINISH_S", "Host"]

FINISH_S: Final = 2.0
"""What stopping and closing may take at the end."""


class Host:
    """All lines of one robot. Everything happens on one loop, nothing in it waits."""

    def __init__(self, emit: Emit, clock: Clock) -> None:
        """Begin with no line; `emit` passes messages to the engine's side."""
        self._emit = emit
        self._clock = clock
        self._lines: dict[str, Line] = {}
        self._controls: dict[str, Line] = {}
        self._stirred: set[Line] = set()
        self._is_finishing = False
        self._handlers: dict[type, Callable[[Any], None]] = {
            wire.Send: self._send,
            wire.Credit: lambda said: self._lines[said.line].credit(said.turn, said.amount),
            wire.Release: self._release,
            wire.Stop: self._stop,
            wire.Arm: self._arm,
            wire.Open: lambda said: self._lines[said.line].open(said.turn, said.timeout_s),
            wire.Close: lambda said: self._lines[said.line].close(said.turn),
            wire.Make: self._make,
            wire.Renew: self._renew,
            wire.Owe: self._owe,
        }

    def take(self, said: wire.ToGuard) -> None:
        """Do what the engine's side says; `settle` follows."""
        if type(said) is wire.Tick and not self._is_finishing:
            line = self._controls.get(said.control)
            if line is not None:
                line.reins.tick(said.control, said.number, said.data, said.at_s, said.count)
                self._stirred.add(line)
        elif not self._is_finishing:
            self._handlers[type(said)](said)

    def settle(self) -> None:
        """Write what is due after all that was said together."""
        while self._stirred:
            line = self._stirred.pop()
            line.reins.step()
            line.settle()

    async def finish(self) -> None:
        """Stop everything, close everything. Takes `FINISH_S` and little more at most."""
        self._is_finishing = True
        ends = [line.finish(FINISH_S) for line in self._lines.values()]
        await asyncio.gather(*ends)

    def _make(self, said: wire.Make) -> None:
        tunnel: Any = self._lines[said.tunnel].transport if said.tunnel else None
        subscriptions = tuple(Subscription(*one) for one in said.subscriptions)
        module, _, path = said.factory.partition(":")
        factory: Callable[[Setup], Transport] = attrgetter(path)(import_module(module))
        transport = factory(Setup(said.line, said.options, subscriptions, tunnel))
        self.add(said, transport)

    def add(self, said: wire.Make, transport: Transport) -> None:
        """Keep a line whose transport is made."""
        self._lines[said.line] = Line(said, transport, self._emit, self._clock)

    def _send(self, said: wire.Send) -> None:
        line = self._lines[said.line]
        line.send(said)
        self._stirred.add(line)

    def _release(self, said: wire.Release) -> None:
        line = self._controls.get(said.control)
        if line is not None:
            line.reins.release(said.control)
            self._stirred.add(line)

    def _arm(self, said: wire.Arm) -> None:
        line = self._controls[said.control] = self._lines[said.line]
        line.reins.arm(said.control, said.terms)

    def _renew(self, said: wire.Renew) -> None:
        line = self._controls.get(said.control)
        if line is not None:
            line.reins.renew(said.control, said.stop, said.stops)

    def _stop(self, said: wire.Stop) -> None:
        for name, control, terms in said.controls:
            line = self._controls[control] = self._lines[name]
            line.reins.stop(control, terms)
            self._stirred.add(line)
        self.settle()  # before anything else that came with it

    def _owe(self, said: wire.Owe) -> None:
        line = self._controls[said.control] = self._lines[said.line]
        line.reins.owe(said.control, said.terms)
        line.rescue()
