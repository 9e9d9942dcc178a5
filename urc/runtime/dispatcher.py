"""The dispatcher: the only caller of a driver's engine.

All calls to the engine run on the event loop, one after another, and are never nested. To execute
an event, the dispatcher only changes the state of a `Link`, the hub or a future. The tasks of the
links react to the change later. A driver with several transports has one engine, one dispatcher,
and one link for each transport.
"""

import asyncio
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, Protocol

from urc.model.driver import Command
from urc.model.payload import Payload
from urc.model.values import NOTHING, Sample
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    MotionEvent,
    Noted,
    Open,
    Ready,
    Replied,
    Request,
    Samples,
    Send,
    Violation,
)
from urc.protocol.sequences.sequence_control import Pull, SequenceControl
from urc.runtime.clock import Clock, Timer
from urc.runtime.grid_encoder import GridEncoder
from urc.runtime.hub import Hub, LogEntry, SequenceProgress

__all__ = ["MAX_WAITING", "Dispatcher", "EngineLike", "LinkPort"]


MAX_WAITING = 256
"""Maximum number of pending commands; further commands are refused."""

Answer = Replied | Failed


class PendingCommands:
    """The futures of pending commands."""

    def __init__(self, clock: Clock, limit_s: Callable[[str], float]) -> None:
        """Create an empty table of pending commands.

        Args:
            clock: source of time.
            limit_s: function that returns the maximum wait for a command, in seconds.
        """
        self._clock = clock
        self._limit_s = limit_s
        self._limits_s: dict[str, float] = {}
        self._all: dict[int, tuple[asyncio.Future[Answer], float, str]] = {}
        """Future, deadline and command of each pending request, by request number."""
        self._alarm: Timer | None = None
        self._alarm_s = 0.0

    @property
    def is_full(self) -> bool:
        """Whether the maximum number of pending commands has been reached."""
        return len(self._all) >= MAX_WAITING

    def add(self, request: Request, answer: asyncio.Future[Answer], now: float) -> None:
        """Add the future of a request made at the time `now`."""
        name = request.command
        limit_s = self._limits_s.get(name)
        if limit_s is None:
            limit_s = self._limits_s[name] = self._limit_s(name)
        due_s = now + limit_s
        self._all[request.id] = (answer, due_s, name)
        if self._alarm is None or due_s < self._alarm_s:
            self._arm(due_s)

    def settle(self, answer: Answer) -> None:
        """Set the result of a pending command, if its caller is still waiting."""
        found = self._all.pop(answer.id, None)
        if found is not None and not found[0].done():
            found[0].set_result(answer)

    def forget(self, number: int) -> None:
        """Remove a pending command whose caller no longer waits."""
        self._all.pop(number, None)

    def close(self, reason: str) -> None:
        """Fail all pending commands and cancel the timer."""
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
        """Fail overdue commands; do nothing if the timer fires early."""
        self._alarm = None
        now = self._clock.now()
        for number, (_, due_s, name) in list(self._all.items()):
            if due_s <= now:
                text = f"the command has not finished within {self._limits_s[name]:g} s"
                self.settle(Failed(number, name, "timed-out", text))
        first_s = min((due_s for _, due_s, _ in self._all.values()), default=None)
        if first_s is not None:
            self._arm(first_s)


_SOONEST_S = 0.001
"""Minimum delay before the next tick when work is overdue, in seconds. The delay prevents an engine
from blocking the loop."""
_AFTER_A_BUG_S = 1.0

log = logging.getLogger(__name__)


class EngineLike(Protocol):
    """The methods of `urc.protocol.engine.Engine` that the dispatcher uses."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` must be called next; None if no call is needed."""

    @property
    def calm_s(self) -> float:
        """Minimum delay before any deadline that `receive` or `command` creates, in seconds."""

    def start(self, transport: str, now: float) -> Sequence[Event]:
        """Handle an opened transport."""

    def receive(
        self, transport: str, data: Payload, now: float, *, is_new: bool = True
    ) -> Sequence[Event]:
        """Handle received bytes or a received message, which may have arrived earlier."""

    def closed(self, transport: str, reason: str, now: float) -> Sequence[Event]:
        """Handle the loss of a transport, or a failed attempt to open it."""

    def command(self, request: Request, now: float) -> Sequence[Event]:
        """Start a command."""

    def latch(self, reason: str, now: float) -> Sequence[Event]:
        """End all sequences, and refuse autonomous motion until a call with an empty reason."""

    def finish(self, now: float) -> list[Event]:
        """Start an orderly close of every connection."""

    def tick(self, now: float) -> Sequence[Event]:
        """Handle the deadline."""


class LinkPort(Protocol):
    """The interface of a `Link` that the dispatcher uses.

    Implementations of the interface must not call the dispatcher.
    """

    @property
    def is_full(self) -> bool:
        """Whether the link's output buffer is too full for new commands."""

    def want_open(self) -> None:
        """Open the connection for a waiting request."""

    def want_close(self, reason: str) -> None:
        """Close the connection after all output, or immediately if there is a `reason`."""

    def send(self, sent: Send) -> None:
        """Write bytes or a message; secret data is hidden from the traffic view."""

    def frame_received(self) -> None:
        """Handle a valid frame."""

    def ready(self) -> None:
        """Handle the end of the connection's ``on_connect`` steps."""

    def count(self, fault: Violation) -> None:
        """Count a protocol violation."""

    def note(self, entry: Noted) -> None:
        """Log a message that the driver declares as a log entry."""

    def hang_up(self, reason: str) -> None:
        """Close the connection; the link's task later reports the end to the engine."""

    def publish(self) -> None:
        """Publish the link state if the state has changed."""


class Dispatcher:
    """The owner of an engine, which executes the engine's events."""

    def __init__(
        self,
        engine: EngineLike,
        hub: Hub,
        clock: Clock,
        commands: Mapping[str, Command],
        limit_s: Callable[[str], float],
        sequence_control: Mapping[str, SequenceControl] = NOTHING,
        motion: Callable[[MotionEvent], None] | None = None,
        grids: GridEncoder | None = None,
    ) -> None:
        """Create the dispatcher for an engine.

        Args:
            engine: the engine; from now on, only the dispatcher may call it.
            hub: destination of readings and log entries.
            clock: source of time.
            commands: the driver's commands, keyed by name.
            limit_s: function that returns the time in seconds after which a command fails, even if
                the engine is still working on it.
            sequence_control: state and controls of each sequence, by sequence name.
            motion: handler of held-command events; None ignores the events.
            grids: encoder of the occupancy grids that the engine does not encode; None if the
                engine encodes all grids.
        """
        self._engine = engine
        self._hub = hub
        self._clock = clock
        self._commands = commands
        self._ports: dict[str, LinkPort] = {}
        self._waiting = PendingCommands(clock, limit_s)
        self._motion = motion
        self._grids = grids
        self._sequence_control = dict(sequence_control)
        self._seen = dict.fromkeys(sequence_control, 0)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._alarm: Timer | None = None
        self._alarm_s: float | None = None
        self._calm_s = engine.calm_s
        self._is_stopped = False

    def attach(self, transport: str, port: LinkPort) -> None:
        """Set the link that serves `transport`."""
        self._ports[transport] = port

    def start(self, transport: str) -> None:
        """Report an opened transport to the engine."""
        self._run(lambda now: self._engine.start(transport, now))

    def receive(self, transport: str, data: Payload, now: float, *, is_new: bool = True) -> None:
        """Pass received data to the engine; publish all resulting readings together.

        Data that is not `is_new` does not show that the robot is alive.
        """
        if self._is_stopped:
            return
        try:
            events = self._engine.receive(transport, data, now, is_new=is_new)
        except Exception as bug:  # supervisor, as in `_run`
            self._survive(bug)
            return
        if events:
            self._perform(events, transport, is_new=is_new)
        self._arm_after(now)

    def closed(self, transport: str, reason: str) -> None:
        """Report a lost transport, or a failed attempt to open it, to the engine."""
        self._run(lambda now: self._engine.closed(transport, reason, now))

    def command(self, request: Request) -> asyncio.Future[Answer]:
        """Start a command.

        The future receives exactly one result, unless `forget` is called first.
        """
        loop = self._loop = (
            self._loop or asyncio.get_running_loop()
        )  # cached: the call costs a system call
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
        """Pass an operator's control request to a sequence; ignore an unknown sequence."""
        sequence_control = self._sequence_control.get(sequence)
        if sequence_control is not None:
            sequence_control.pull(what)
            self._run(self._engine.tick)

    def latch(self, reason: str) -> None:
        """End all sequences and refuse autonomous motion; an empty reason permits motion again."""
        self._run(lambda now: self._engine.latch(reason, now))

    def forget(self, request_id: int) -> None:
        """Remove a request whose caller no longer waits."""
        self._waiting.forget(request_id)

    def wind_up(self) -> None:
        """Start the timer for the engine's first deadline."""
        self._arm()

    def finish(self) -> None:
        """Start an orderly close of every open connection; the engine then completes each close."""
        try:
            events = self._engine.finish(self._clock.now())
        except Exception as bug:  # supervisor, as in `command`
            self._survive(bug)
            return
        self._perform(events, None)
        self._arm()

    def stop(self, reason: str) -> None:
        """Stop calling the engine and fail every pending command."""
        self._is_stopped = True
        if self._alarm is not None:
            self._alarm.cancel()
        self._waiting.close(reason)
        if self._grids is not None:
            self._grids.close()

    def _refusal(self, request: Request) -> Failed:
        """Return the failure of a request that is refused before it reaches the engine."""
        if self._is_stopped:
            return Failed(request.id, request.command, "disconnected", "the session is closed")
        if self._waiting.is_full:
            text = f"{MAX_WAITING} commands are already waiting; the new command was dropped"
        else:
            text = "the robot currently accepts no more bytes; the command was dropped"
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

    def _perform(
        self, events: Sequence[Event], heard_on: str | None, *, is_new: bool = True
    ) -> None:
        ports = self._ports
        samples: list[Sample] = []
        answers: list[Answer] = []
        heard, is_changed = "", False
        for event in events:
            if isinstance(event, Samples):
                samples += event.samples
                if event.transport not in ("", heard):
                    heard = event.transport
                    if is_new:
                        ports[heard].frame_received()
            elif isinstance(event, Send):
                ports[event.transport].send(event)
            elif isinstance(event, (Replied, Failed)):
                answers.append(event)
                is_heard = isinstance(event, Replied) and heard_on is not None and not samples
                if is_heard and is_new:
                    ports[heard_on or ""].frame_received()
            elif isinstance(event, MotionEvent):
                if self._motion is not None:
                    self._motion(event)
            else:
                is_changed = True
                self._change(event)
        if samples and self._grids is not None:
            samples = self._grids.take(samples)
        if samples:
            self._hub.publish(samples)
        # After the hub, because a caller that receives a reply must find the readings there.
        for answer in answers:
            self._waiting.settle(answer)
        if is_changed:
            for port in ports.values():
                port.publish()

    def _change(self, event: Event) -> None:
        """Pass an event to the link of the event's transport; the link changes its state."""
        match event:
            case Violation(transport):
                self._ports[transport].count(event)
            case Noted(transport):
                self._ports[transport].note(event)
            case Open(transport):
                self._ports[transport].want_open()
            case Ready(transport):
                self._ports[transport].ready()
            case Close(transport, reason):
                self._ports[transport].want_close(reason)

    def _arm_after(self, now: float) -> None:
        """Call `_arm`, unless the timer fires early enough for every deadline created at `now`."""
        # Without this check, a text poll costs 1.32 times as much as a hand-written driver, instead
        # of 1.2 times (decision 30).
        if self._alarm_s is None or self._alarm_s > now + self._calm_s:
            self._arm()

    def _show_sequences(self) -> None:
        """Publish the progress of the sequences."""
        for name, sequence_control in self._sequence_control.items():
            if sequence_control.count != self._seen[name]:
                self._seen[name] = sequence_control.count
                state: Literal["idle", "running", "paused"] = "idle"
                if sequence_control.is_running:
                    state = "paused" if sequence_control.is_paused else "running"
                self._hub.set_progress(
                    SequenceProgress(
                        name,
                        sequence_control.place,
                        sequence_control.of,
                        state,
                        sequence_control.reason,
                    )
                )

    def _arm(self, soonest_s: float = 0.0) -> None:
        if self._sequence_control:
            self._show_sequences()
        due_s = self._engine.deadline
        if due_s is not None and soonest_s:
            due_s = max(due_s, self._clock.now() + soonest_s)
        # A timer that fires too early costs less than a new timer for every message.
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
            self._arm()  # the deadline has moved in the meantime
            return
        try:
            events = self._engine.tick(self._clock.now())
        except Exception as bug:  # supervisor, as above
            self._survive(bug)
            return
        self._perform(events, None)
        self._arm(_SOONEST_S)

    def _survive(self, bug: Exception) -> None:
        """Report a bug in URC, reopen all connections, and keep the timer running."""
        log.error("the engine failed", exc_info=bug)
        text = f"internal error ({type(bug).__name__}): please report it with the log"
        self._hub.log(LogEntry(self._clock.now(), "error", "engine", text))
        for port in self._ports.values():
            port.hang_up(text)
        self._arm(_AFTER_A_BUG_S)
