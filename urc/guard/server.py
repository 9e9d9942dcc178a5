"""The guard's server, which handles the engine's messages for all transports of one robot."""

import asyncio
from collections.abc import Callable
from importlib import import_module
from operator import attrgetter
from typing import Any, Final

from urc.guard import messages
from urc.guard.guarded_connection import Emit, GuardedConnection
from urc.guard.send_queue import LaneClock
from urc.transports.base import (
    GoalRecord,
    SupportsGoals,
    TopicSubscription,
    Transport,
    TransportSetup,
)

__all__ = ["FINISH_S", "GuardServer"]

FINISH_S: Final = 2.0
"""Maximum time for writing the last stops and closing the connections, in seconds."""


class GuardServer:
    """The guarded transports of one robot, with the handlers for the engine's messages.

    All handlers run on one event loop, and no handler waits.
    """

    def __init__(self, emit: Emit, clock: LaneClock) -> None:
        """Create a server without transports; `emit` sends messages to the engine."""
        self._emit = emit
        self._clock = clock
        self._lines: dict[str, GuardedConnection] = {}
        self._controls: dict[str, GuardedConnection] = {}
        self._stirred: set[GuardedConnection] = set()
        self._is_finishing = False
        self._handlers: dict[type, Callable[[Any], None]] = {
            messages.SendBytes: self._send,
            messages.FlowCredit: lambda said: self._lines[said.line].credit(said.turn, said.amount),
            messages.ReleaseControl: self._release,
            messages.StopMotion: self._stop,
            messages.ArmControl: self._arm,
            messages.OpenLine: lambda said: self._lines[said.line].open(said.turn, said.timeout_s),
            messages.CloseLine: lambda said: self._lines[said.line].close(said.turn),
            messages.MakeTransport: self._make,
            messages.ReplaceStop: self._renew,
            messages.RecoverStop: self._owe,
            messages.EndCancellations: self._end_cancellations,
        }

    def handle(self, said: messages.ToGuard) -> None:
        """Handle a message from the engine; call `settle` after each batch of messages."""
        if type(said) is messages.RenewLease and not self._is_finishing:
            line = self._controls.get(said.control)
            if line is not None:
                line.scheduler.tick(
                    said.control, said.number, said.data, said.at_s, said.count, said.until_s
                )
                self._stirred.add(line)
        elif not self._is_finishing:
            self._handlers[type(said)](said)

    def settle(self) -> None:
        """Write due frames after a batch of messages."""
        while self._stirred:
            line = self._stirred.pop()
            line.scheduler.write_due()
            line.settle()

    async def finish(self) -> None:
        """Stop all controls and close all connections, within about `FINISH_S` seconds."""
        self._is_finishing = True
        ends = [line.finish(FINISH_S) for line in self._lines.values()]
        await asyncio.gather(*ends)

    def _make(self, said: messages.MakeTransport) -> None:
        tunnel: Any = self._lines[said.tunnel].transport if said.tunnel else None
        subscriptions = tuple(TopicSubscription(*one) for one in said.subscriptions)
        module, _, path = said.factory.partition(":")
        factory: Callable[[TransportSetup], Transport] = attrgetter(path)(import_module(module))
        transport = factory(TransportSetup(said.line, said.options, subscriptions, tunnel))
        self.add(said, transport)

    def add(self, said: messages.MakeTransport, transport: Transport) -> None:
        """Add a transport, whose connection the engine can then open."""
        if isinstance(transport, SupportsGoals):

            def changed(record: GoalRecord) -> None:
                self._emit(messages.GoalsChanged(said.line, record))

            transport.keep_goals(said.goals, changed)
        self._lines[said.line] = GuardedConnection(said, transport, self._emit, self._clock)

    def _send(self, said: messages.SendBytes) -> None:
        line = self._lines[said.line]
        line.send(said)
        self._stirred.add(line)

    def _release(self, said: messages.ReleaseControl) -> None:
        line = self._controls.get(said.control)
        if line is not None:
            line.scheduler.release(said.control)
            self._stirred.add(line)

    def _arm(self, said: messages.ArmControl) -> None:
        line = self._controls[said.control] = self._lines[said.line]
        line.scheduler.arm(said.control, said.terms)

    def _renew(self, said: messages.ReplaceStop) -> None:
        line = self._controls.get(said.control)
        if line is not None:
            line.scheduler.renew(said.control, said.stop, said.stops)

    def _stop(self, said: messages.StopMotion) -> None:
        for name, control, terms in said.controls:
            line = self._controls[control] = self._lines[name]
            line.scheduler.stop(control, terms)
            self._stirred.add(line)
        self.settle()  # before other messages that arrived with it

    def _end_cancellations(self, said: messages.EndCancellations) -> None:
        transport = self._lines[said.line].transport
        if isinstance(transport, SupportsGoals):
            transport.end_cancellations(said.actions)

    def _owe(self, said: messages.RecoverStop) -> None:
        line = self._controls[said.control] = self._lines[said.line]
        line.scheduler.owe(said.control, said.terms)
        line.rescue()
