"""The one owner of a driver's engine: whoever has news for it comes here.

All calls into the engine are made on the event loop, one after the other and never from inside one
another: performing an event only sets state in a `Link`, the hub or a future, and the links' own
tasks act on it later. A driver with several transports has one engine, one dispatcher, and a link
for each transport.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, Protocol

from urc.model.codec import Payload
from urc.model.driver import Command
from urc.model.values import NOTHING, Sample
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    Fault,
    Open,
    Ready,
    Replied,
    Request,
    Samples,
    Send,
)
from urc.protocol.reins import Pull, Reins
from urc.runtime.clock import Alarm, Clock
from urc.runtime.hub import Hub, Note, Progress

__all__ = ["MAX_WAITING", "Dispatcher", "EngineLike", "Port"]


MAX_WAITING = 256
"""Commands that may wait for their answer at a time; one more is refused."""

Answer = Replied | Failed


class Waiting:
    """A future for each command that waits."""

    def __init__(self, clock: Clock, limit_s: Callable[[str], float]) -> None:
        """Begin with none.

        Args:
            clock: the time.
            limit_s: command → seconds after which nobody waits for it any longer.
        """
        self._clock = clock
        self._limit_s = limit_s
        self._limits_s: dict[str, float] = {}
        self._all: dict[int, tuple[asyncio.Future[Answer], float, str]] = {}
        """Number of the request → who waits, until when, and for which command."""
        self._alarm: Alarm | None = None
        self._alarm_s = 0.0

    @property
    def is_full(self) -> bool:
        """Whether no more may wait."""
        return len(self._all) >= MAX_WAITING

    def add(self, request: Request, answer: asyncio.Future[Answer], now: float) -> None:
        """Let `answer` wait for the end of a request that is made `now`."""
        name = request.command
        limit_s = self._limits_s.get(name)
        if limit_s is None:
            limit_s = self._limits_s[name] = self._limit_s(name)
        due_s = now + limit_s
        self._all[request.id] = (answer, due_s, name)
        if self._alarm is None or due_s < self._alarm_s:
            self._arm(due_s)

    def settle(self, answer: Answer) -> None:
        """Give the answer to whoever waits for it, if anybody does."""
        found = self._all.pop(answer.id, None)
        if found is not None and not found[0].done():
            found[0].set_result(answer)

    def forget(self, number: int) -> None:
        """Nobody waits for the answer to this request any more."""
        self._all.pop(number, None)

    def close(self, reason: str) -> None:
        """Fail all that wait, and leave no alarm behind."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        for number in list(self._all):
            self.settle(Failed(number, "", "disconnected", reason))

    def _arm(self, due_s: float) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
        self._alarm_s = due_s
        self._alarm = self._clock.call_at(due_s, self._ring)

    def _ring(self) -> None:
        """Fail those that are overdue. The alarm may have been set for one that is over."""
        self._alarm = None
        now = self._clock.now()
        for number, (_, due_s, name) in list(self._all.items()):
            if due_s <= now:
                text = f"no outcome within {self._limits_s[name]:g} s"
                self.settle(Failed(number, name, "timed-out", text))
        first_s = min((due_s for _, due_s, _ in self._all.values()), default=None)
        if first_s is not None:
            self._arm(first_s)


_SOONEST_S = 0.001
"""A tick that leaves work overdue is not repeated sooner, so that no engine can hold the loop."""
_AFTER_A_BUG_S = 1.0

log = logging.getLogger(__name__)


class EngineLike(Protocol):
    """What is used of `urc.protocol.engine.Engine`."""

    @property
    def deadline(self) -> float | None:
        """When `tick` wants to be called."""

    @property
    def calm_s(self) -> float:
        """Neither `receive` nor `command` makes a deadline that is nearer than this."""

    def start(self, transport: str, now: float) -> Sequence[Event]:
        """The transport is open."""

    def receive(self, transport: str, data: Payload, now: float) -> Sequence[Event]:
        """Bytes or an envelope arrived."""

    def closed(self, transport: str, reason: str, now: float) -> Sequence[Event]:
        """The transport is gone, or could not be opened."""

    def command(self, request: Request, now: float) -> Sequence[Event]:
        """Somebody wants this done."""

    def latch(self, reason: str, now: float) -> Sequence[Event]:
        """End every sequence, and begin nothing that moves by itself; "" ends that."""

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

    def send(self, sent: Send) -> None:
        """Write bytes or an envelope; secret ones are not shown to whoever watches the traffic."""

    def heard(self) -> None:
        """A good frame arrived."""

    def ready(self) -> None:
        """The steps of the connection are done."""

    def count(self, fault: Fault) -> None:
        """Something was not as declared."""

    def hang_up(self, reason: str) -> None:
        """Give the connection up, and tell the engine from the link's own task."""

    def publish(self) -> None:
        """Show the state, if it has changed."""


class Dispatcher:
    """Passes news to the engine and performs what it answers."""

    def __init__(
        self,
        engine: EngineLike,
        hub: Hub,
        clock: Clock,
        commands: Mapping[str, Command],
        limit_s: Callable[[str], float],
        reins: Mapping[str, Reins] = NOTHING,
    ) -> None:
        """Take an engine over.

        Args:
            engine: called by nobody else from now on.
            hub: takes readings and notes.
            clock: the time.
            commands: of the driver.
            limit_s: command → seconds after which its wait ends, whatever the engine says.
            reins: sequence → where it stands.
        """
        self._engine = engine
        self._hub = hub
        self._clock = clock
        self._commands = commands
        self._ports: dict[str, Port] = {}
        self._waiting = Waiting(clock, limit_s)
        self._reins = dict(reins)
        self._seen = dict.fromkeys(reins, 0)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._alarm: Alarm | None = None
        self._alarm_s: float | None = None
        self._calm_s = engine.calm_s
        self._is_stopped = False

    def attach(self, transport: str, port: Port) -> None:
        """Say which link serves `transport`."""
        self._ports[transport] = port

    def start(self, transport: str) -> None:
        """Tell the engine that a transport is open."""
        self._run(lambda now: self._engine.start(transport, now))

    def receive(self, transport: str, data: Payload, now: float) -> None:
        """Tell the engine what arrived; all readings in it reach the hub in one go."""
        if self._is_stopped:
            return
        try:
            events = self._engine.receive(transport, data, now)
        except Exception as bug:  # supervisor, as in `_run`
            self._survive(bug)
            return
        if events:
            self._perform(events, transport)
        self._arm_after(now)

    def closed(self, transport: str, reason: str) -> None:
        """Tell the engine that a transport is gone, or could not be opened."""
        self._run(lambda now: self._engine.closed(transport, reason, now))

    def command(self, request: Request) -> asyncio.Future[Answer]:
        """Start a command. The future gets exactly one answer, unless `forget` comes first."""
        loop = self._loop = self._loop or asyncio.get_running_loop()  # which costs a system call
        answer: asyncio.Future[Answer] = asyncio.Future(loop=loop)
        command = self._commands.get(request.command)
        port = self._ports.get(command.transport) if command else None
        if self._is_stopped or self._waiting.is_full or (port is not None and port.is_full):
            answer.set_result(self._refusal(request))
            return answer
        now = self._clock.now()
        self._waiting.add(request, answer, now)
        try:
            events = self._engine.command(request, now)
        except Exception as bug:  # supervisor, as in `_run`
            self._survive(bug)
            return answer
        if events:
            self._perform(events, None)
        self._arm_after(now)
        return answer

    def pull(self, sequence: str, what: Pull) -> None:
        """Let a sequence pause, go on, or end; nothing happens where there is none."""
        reins = self._reins.get(sequence)
        if reins is not None:
            reins.pull(what)
            self._run(self._engine.tick)

    def latch(self, reason: str) -> None:
        """End every sequence, and begin nothing that moves by itself; "" lets it be begun again."""
        self._run(lambda now: self._engine.latch(reason, now))

    def forget(self, request_id: int) -> None:
        """Nobody waits for this answer any more."""
        self._waiting.forget(request_id)

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
        self._waiting.close(reason)

    def _refusal(self, request: Request) -> Failed:
        """Return why the engine is not even asked."""
        if self._is_stopped:
            return Failed(request.id, request.command, "disconnected", "the session is closed")
        if self._waiting.is_full:
            text = f"{MAX_WAITING} commands are waiting already; this one was dropped"
        else:
            text = "the robot takes no more bytes at the moment; the command was dropped"
        return Failed(request.id, request.command, "queue-full", text)

    def _run(self, step: Callable[[float], Sequence[Event]]) -> None:
        if self._is_stopped:
            return
        try:
            events = step(self._clock.now())
        except Exception as bug:  # supervisor: one bad driver must not end the session
            self._survive(bug)
            return
        if events:
            self._perform(events, None)
        self._arm()

    def _perform(self, events: Sequence[Event], heard_on: str | None) -> None:
        ports = self._ports
        samples: list[Sample] = []
        answers: list[Answer] = []
        heard, is_changed = "", False
        for event in events:
            if isinstance(event, Samples):
                samples += event.samples
                if event.transport not in ("", heard):
                    heard = event.transport
                    ports[heard].heard()
            elif isinstance(event, Send):
                ports[event.transport].send(event)
            elif isinstance(event, (Replied, Failed)):
                answers.append(event)
                if isinstance(event, Replied) and heard_on is not None and not samples:
                    ports[heard_on].heard()
            else:
                is_changed = True
                self._change(event)
        if samples:
            self._hub.put(samples)
        # After the hub: whoever waits for a reply finds its readings there.
        for answer in answers:
            self._waiting.settle(answer)
        if is_changed:
            for port in ports.values():
                port.publish()

    def _change(self, event: Event) -> None:
        """Let a link take what changes its state."""
        match event:
            case Fault(transport):
                self._ports[transport].count(event)
            case Open(transport):
                self._ports[transport].want_open()
            case Ready(transport):
                self._ports[transport].ready()
            case Close(transport, reason):
                self._ports[transport].want_close(reason)

    def _arm_after(self, now: float) -> None:
        """Do what `_arm` does, unless there is no need to look: the alarm rings soon enough."""
        if self._alarm_s is None or self._alarm_s > now + self._calm_s:
            self._arm()

    def _look(self) -> None:
        """Show where the sequences stand."""
        for name, reins in self._reins.items():
            if reins.count != self._seen[name]:
                self._seen[name] = reins.count
                state: Literal["idle", "running", "paused"] = "idle"
                if reins.is_running:
                    state = "paused" if reins.is_paused else "running"
                self._hub.set_progress(Progress(name, reins.place, reins.of, state, reins.reason))

    def _arm(self, soonest_s: float = 0.0) -> None:
        if self._reins:
            self._look()
        due_s = self._engine.deadline
        if due_s is not None and soonest_s:
            due_s = max(due_s, self._clock.now() + soonest_s)
        # An alarm that rings too early costs less than a new one for every message.
        if due_s is None or (self._alarm_s is not None and self._alarm_s <= due_s):
            return
        if self._alarm is not None:
            self._alarm.cancel()
        self._alarm_s = due_s
        self._alarm = self._clock.call_at(due_s, self._tick)

    def _tick(self) -> None:
        self._alarm = self._alarm_s = None
        if self._is_stopped:
            return
        due_s = self._engine.deadline
        if due_s is None or due_s > self._clock.now():
            self._arm()  # it was set for something that came in the meantime
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
