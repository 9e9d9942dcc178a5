"""The one owner of a driver's engine: whoever has news for it comes here.

All calls into the engine are made on the event loop, one after the other and never from inside one
another: performing an event only sets state in a `Link`, the hub or a future, and the links' own
tasks act on it later. A driver with several transports has one engine, one dispatcher, and a link
for each transport.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from urc.model.driver import Command
from urc.model.values import Sample
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    Fault,
    Open,
    Replied,
    Request,
    Samples,
    Send,
)
from urc.runtime.clock import Alarm, Clock
from urc.runtime.hub import Hub, Note

__all__ = ["Answer", "Dispatcher", "EngineLike", "Port"]

MAX_WAITING = 256
"""Commands that may wait for their answer at a time; one more is refused."""
_SOONEST_S = 0.001
"""A tick that leaves work overdue is not repeated sooner, so that no engine can hold the loop."""
_AFTER_A_BUG_S = 1.0

Answer = Replied | Failed

log = logging.getLogger(__name__)


class EngineLike(Protocol):
    """What is used of `urc.protocol.engine.Engine`."""

    @property
    def deadline(self) -> float | None:
        """When `tick` wants to be called."""

    def start(self, transport: str, now: float) -> Sequence[Event]:
        """The transport is open."""

    def receive(self, transport: str, data: bytes, now: float) -> Sequence[Event]:
        """Bytes arrived."""

    def closed(self, transport: str, reason: str, now: float) -> Sequence[Event]:
        """The transport is gone, or could not be opened."""

    def command(self, request: Request, now: float) -> Sequence[Event]:
        """Somebody wants this done."""

    def finish(self, now: float) -> list[Event]:
        """Close every line in good order."""

    def tick(self, now: float) -> Sequence[Event]:
        """The deadline has come."""


class Port(Protocol):
    """What the dispatcher asks of a `Link`. Nothing here may call the dispatcher back."""

    @property
    def is_full(self) -> bool:
        """Whether so much waits to be written that no new command should be taken."""

    def want_open(self) -> None:
        """Connect; a request waits for it."""

    def want_close(self, reason: str) -> None:
        """Write what is queued and close; at once when there is a reason."""

    def queue(self, data: bytes, *, is_secret: bool = False) -> None:
        """Write these bytes; secret ones are not shown to whoever watches the traffic."""

    def heard(self) -> None:
        """A good frame arrived."""

    def count(self, fault: Fault) -> None:
        """Something was not as declared."""

    def hang_up(self, reason: str) -> None:
        """Give the connection up, and tell the engine from the link's own task."""

    def publish(self) -> None:
        """Show the state, if it has changed."""


class Dispatcher:
    """Passes news to the engine and performs what it answers."""

    def __init__(
        self, engine: EngineLike, hub: Hub, clock: Clock, commands: Mapping[str, Command]
    ) -> None:
        self._engine = engine
        self._hub = hub
        self._clock = clock
        self._commands = commands
        self._ports: dict[str, Port] = {}
        self._waiting: dict[int, asyncio.Future[Answer]] = {}
        self._alarm: Alarm | None = None
        self._alarm_s: float | None = None
        self._is_stopped = False

    def attach(self, transport: str, port: Port) -> None:
        """Say which link serves `transport`."""
        self._ports[transport] = port

    def start(self, transport: str) -> None:
        """Tell the engine that a transport is open."""
        self._run(lambda now: self._engine.start(transport, now))

    def receive(self, transport: str, data: bytes) -> None:
        """Tell the engine what arrived; all readings in it reach the hub in one go."""
        self._run(lambda now: self._engine.receive(transport, data, now), heard_on=transport)

    def closed(self, transport: str, reason: str) -> None:
        """Tell the engine that a transport is gone, or could not be opened."""
        self._run(lambda now: self._engine.closed(transport, reason, now))

    def command(self, request: Request) -> asyncio.Future[Answer]:
        """Start a command. The future gets exactly one answer, unless `forget` comes first."""
        answer: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        refusal = self._refusal(request)
        if refusal is not None:
            answer.set_result(refusal)
            return answer
        self._waiting[request.id] = answer
        self._run(lambda now: self._engine.command(request, now))
        return answer

    def forget(self, request_id: int) -> None:
        """Nobody waits for this answer any more."""
        self._waiting.pop(request_id, None)

    def wind_up(self) -> None:
        """Begin: let the engine say when it wants to be called."""
        self._arm()

    def finish(self) -> None:
        """Let every open line say its good-bye; each ends with the engine closing it."""
        try:
            events = self._engine.finish(self._clock.now())
        except Exception as bug:  # supervisor, as in `command`
            self._survive(bug)
            return
        self._perform(events, None)
        self._arm()

    def stop(self, reason: str) -> None:
        """Call no engine from now on, and fail every command that still waits."""
        self._is_stopped = True
        if self._alarm is not None:
            self._alarm.cancel()
        for number in list(self._waiting):
            self._settle(Failed(number, "", "disconnected", reason))

    def _refusal(self, request: Request) -> Failed | None:
        """Return why the engine is not even asked, or None."""
        if self._is_stopped:
            return Failed(request.id, request.command, "disconnected", "the session is closed")
        command = self._commands.get(request.command)
        port = self._ports.get(command.transport) if command else None
        if len(self._waiting) >= MAX_WAITING:
            text = f"{MAX_WAITING} commands are waiting already; this one was dropped"
        elif port is not None and port.is_full:
            text = "the robot takes no more bytes at the moment; the command was dropped"
        else:
            return None
        return Failed(request.id, request.command, "queue-full", text)

    def _run(
        self, step: Callable[[float], Sequence[Event]], *, heard_on: str | None = None
    ) -> None:
        if self._is_stopped:
            return
        try:
            events = step(self._clock.now())
        except Exception as bug:  # supervisor: one bad driver must not end the session
            self._survive(bug)
            return
        if events:
            self._perform(events, heard_on)
        self._arm()

    def _perform(self, events: Sequence[Event], heard_on: str | None) -> None:
        samples: list[Sample] = []
        answers: list[Answer] = []
        for event in events:
            match event:
                case Samples():
                    samples += event.samples
                    if event.transport:
                        self._ports[event.transport].heard()
                case Fault():
                    self._ports[event.transport].count(event)
                case Send():
                    self._ports[event.transport].queue(event.data, is_secret=event.is_secret)
                case Open():
                    self._ports[event.transport].want_open()
                case Close():
                    self._ports[event.transport].want_close(event.reason)
                case Replied():
                    answers.append(event)
                    if heard_on is not None:
                        self._ports[heard_on].heard()
                case Failed():
                    answers.append(event)
        if samples:
            self._hub.put(samples)
        # After the hub: whoever waits for a reply finds its readings there.
        for answer in answers:
            self._settle(answer)
        for port in self._ports.values():
            port.publish()

    def _settle(self, answer: Answer) -> None:
        waiting = self._waiting.pop(answer.id, None)
        if waiting is not None and not waiting.done():
            waiting.set_result(answer)

    def _arm(self, soonest_s: float = 0.0) -> None:
        due_s = self._engine.deadline
        if due_s is not None and soonest_s:
            due_s = max(due_s, self._clock.now() + soonest_s)
        if due_s == self._alarm_s:
            return
        if self._alarm is not None:
            self._alarm.cancel()
        self._alarm_s = due_s
        self._alarm = None if due_s is None else self._clock.call_at(due_s, self._tick)

    def _tick(self) -> None:
        self._alarm = self._alarm_s = None
        if self._is_stopped:
            return
        try:
            events = self._engine.tick(self._clock.now())
        except Exception as bug:  # supervisor, as above
            self._survive(bug)
            return
        self._perform(events, None)
        self._arm(_SOONEST_S)

    def _survive(self, bug: Exception) -> None:
        """Report a mistake of our own, begin all lines anew, and keep the timer alive."""
        log.error("the engine failed", exc_info=bug)
        text = f"URC made a mistake ({type(bug).__name__}): please report it with the log"
        self._hub.note(Note(self._clock.now(), "error", "engine", text))
        for port in self._ports.values():
            port.hang_up(text)
        self._arm(_AFTER_A_BUG_S)
