"""A session: an open profile with its engine, links and hub."""

import asyncio
import secrets
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from functools import partial
from itertools import count
from random import random as random_share
from types import TracebackType
from typing import TYPE_CHECKING, Literal

from urc.guard.goal_reports import GoalReports
from urc.model.driver import STOPPED, Driver
from urc.model.payload import Envelope, Payload
from urc.model.profile import Profile
from urc.model.values import NOTHING, Reading, Value
from urc.problems import UrcError
from urc.protocol.engine import Engine
from urc.protocol.events import Failed, MotionEvent, Replied, Request, Send
from urc.protocol.requests.bounds import GOOD_BYE_S, lines_of, longest_s
from urc.protocol.sequences.sequence_control import PAUSE_S, Pull
from urc.protocol.values.time_and_nonce import TimeAndNonce
from urc.registry import Table
from urc.runtime.clock import Clock, LoopClock, within
from urc.runtime.command_failed import CommandFailed
from urc.runtime.dispatcher import Dispatcher
from urc.runtime.grid_encoder import GridEncoder
from urc.runtime.held_commands import is_lossy
from urc.runtime.hub import TRANSPORT, Hub, LogEntry
from urc.runtime.image_demand import ImageDemand, low_streams, pausable_topics
from urc.runtime.link import Link
from urc.runtime.motion_controller import MotionFrames
from urc.runtime.redaction import Redactor
from urc.runtime.settings import resolve_settings
from urc.runtime.transport_chain import absent_cameras, make_transports, without
from urc.transports.base import GoalRecord, SupportsGoals, Transport

if TYPE_CHECKING:
    from urc.guard.guard_client import GuardClient

__all__ = ["CommandFailed", "Motion", "Session", "FifoEvent", "resolve_settings"]


class FifoEvent:
    """An event whose waiters continue in the order in which they began to wait."""

    def __init__(self, event: asyncio.Event) -> None:
        """Store the event, which must never be cleared."""
        self._event = event
        self._turn = asyncio.Lock()  # FIFO
        self._waiting = 0

    @property
    def is_open(self) -> bool:
        """Whether the event is set and no earlier caller is still waiting."""
        return self._event.is_set() and not self._waiting

    async def wait(self) -> None:
        """Wait for the event and all earlier callers; a cancelled caller leaves the queue."""
        self._waiting += 1
        try:
            async with self._turn:
                await self._event.wait()
        finally:
            self._waiting -= 1


Motion = Literal["none", "here", "guarded"]
"""The writer of motion frames: none, a guard in this process, or a guard process. If URC fails,
only a guard process can still stop the robot."""

_LOOK_S = 0.02
new = tuple.__new__
"""Function that creates named tuples faster than their constructors do; each command creates
several named tuples."""
_GRACE_S = 2.0
"""Time that is added to the sum of a command's declared timeouts, in seconds."""


def _check_settings(profile: Profile, settings: Mapping[str, Value]) -> None:
    missing = [name for name in profile.settings if settings.get(name) is None]
    if missing:
        raise UrcError(f"{profile.name} needs a value for: {', '.join(missing)}")


class Session:
    """One robot, connected while the context is open. A session can be opened only once.

    ``async with Session(profile, settings, catalog.transports) as session:`` starts the links and
    returns immediately; `hub` publishes their state.
    """

    def __init__(
        self,
        profile: Profile,
        settings: Mapping[str, Value],
        transports: Table,
        *,
        clock: Clock | None = None,
        random: Callable[[], float] = random_share,
        motion: Motion = "none",
        pauses_images: bool = False,
    ) -> None:
        """Prepare the session without opening connections.

        Args:
            profile: the loaded profile.
            settings: a value for every setting of the profile, as returned by `resolve_settings`.
            transports: table of the available transport types.
            clock: source of time; None for the clock of the running event loop.
            random: function that returns a number in [0, 1) for the jitter of the backoff.
            motion: writer of held-command frames; see `Motion`.
            pauses_images: whether to pause topics of images without viewers in ``hub.viewers``.

        Raises:
            UrcError: a setting has no value, or a transport cannot be built with the settings.
        """
        _check_settings(profile, settings)
        self.profile = profile
        self.settings = dict(settings)
        driver = profile.driver
        self.absent = absent_cameras(driver, self.settings, transports)
        """Cameras without a link, because their package is not installed, each with the reason."""
        self._redactor = Redactor.of(profile, self.settings)
        self.hub = Hub(driver.signals, self._redactor, _streams(driver))
        self._clock: Clock = clock or LoopClock()
        fresh = TimeAndNonce(time.time, secrets.token_bytes)
        engine = Engine(driver, self.settings, fresh=fresh, is_compiled=True)
        self.frames: MotionFrames = engine.motions
        """Renderer of held commands' frames."""
        self.backend = self._make_backend(engine, transports, motion)
        """Writer of held-command frames; None if the session cannot hold commands."""
        self._dispatcher = Dispatcher(
            engine,
            self.hub,
            self._clock,
            driver.commands,
            partial(_limit_s, driver),
            {name: program.sequence_control for name, program in engine.programs.items()},
            self._tell_motion,
            self._made_encoder(engine),
        )
        self._links = self._made_links(transports, random)
        self.on_motion: Callable[[MotionEvent], None] | None = None
        """Handler of the engine's held-command events, set by `MotionController.attach`."""
        self._stops = 0
        self._untried = {name: FifoEvent(link.tried) for name, link in self._links.items()}
        """Links before the end of their first attempt; commands wait for it in order of arrival."""
        self._numbers = count(1)
        self._group = asyncio.TaskGroup()
        self._tasks: list[asyncio.Task[None]] = []
        self._pauses_images = pauses_images

    def _make_backend(
        self, engine: Engine, transports: Table, motion: Motion
    ) -> "GuardClient | None":
        driver = without(self.profile.driver, self.absent)
        if motion == "none" or all(one.hold is None for one in driver.commands.values()):
            return None
        from urc.runtime.guarding import start_guard_client  # takes 20 ms, so only with motion

        backend = start_guard_client(
            driver, self.settings, transports, self._clock, is_guarded=motion == "guarded"
        )
        engine.motions.share([name for name in driver.transports if is_lossy(driver, name)])
        backend.on_stand = partial(self._counters_told, engine)
        return backend

    def _made_encoder(self, engine: Engine) -> GridEncoder | None:
        """Return the encoder of the robot's occupancy grids; None for a robot without grids."""
        if all(one.type != "occupancy_grid" for one in self.profile.driver.signals.values()):
            return None
        engine.readings.defer_grids()
        return GridEncoder(self.hub.publish)

    def _made_links(self, table: Table, random: Callable[[], float]) -> dict[str, Link]:
        driver = without(self.profile.driver, self.absent)
        self.hub.low_streams = low_streams(driver)
        transports: Mapping[str, Transport]
        self._goals = GoalReports(())  # used without a backend
        if self.backend is not None:
            # Cameras stay out of the guard: they move nothing, and their images are large.
            cameras = make_transports(driver, self.settings, table, only_cameras=True)
            transports = {**self.backend.transports, **cameras}
        else:
            transports = make_transports(driver, self.settings, table)
            known = {n: one for n, one in transports.items() if isinstance(one, SupportsGoals)}
            self._goals = GoalReports(known)
            for name, one in known.items():
                one.keep_goals(GoalRecord(), partial(self._goals.changed, name))
        self._transports = transports
        links = {
            name: Link(
                spec,
                transports[name],
                self._dispatcher,
                self.hub,
                clock=self._clock,
                random=random,
                expects_frames=_expects_frames(driver, name),
            )
            for name, spec in driver.transports.items()
        }
        for name, link in links.items():
            self._dispatcher.attach(name, link)
        return links

    def _send_message(self, transport: str, envelope: Envelope) -> None:
        self._links[transport].send(Send(transport, envelope))

    def _tell_motion(self, event: MotionEvent) -> None:
        if self.on_motion is not None:
            self.on_motion(event)

    def _counters_told(
        self, engine: Engine, line: str, stand: Mapping[str, int], is_settled: bool
    ) -> None:
        for event in engine.motions.set_counters(line, stand, is_settled=is_settled):
            self._tell_motion(event)

    async def __aenter__(self) -> "Session":
        await self._group.__aenter__()
        for name, fault in self.absent.items():
            entry = LogEntry(self._clock.now(), "warning", f"{TRANSPORT}{name}", str(fault))
            self.hub.log(entry)
        if self.backend is not None:
            self.backend.start()
        self._tasks = [self._group.create_task(link.run()) for link in self._links.values()]
        if self._pauses_images:
            topics = pausable_topics(self.profile.driver, self.settings)
            demand = ImageDemand(topics, self.hub, self._send_message, self._clock)
            self._tasks.append(self._group.create_task(demand.run()))
        self._dispatcher.wind_up()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self.backend is not None:
                # Before the on_close steps, which may take time.
                self.backend.stop_all(self.frames.stop_frame)
            try:
                await self._say_goodbye()
            finally:  # a link that outlived a cancelled goodbye would connect again
                await self._end(kind, error, trace)
        finally:
            if self.backend is not None:
                await self.backend.finish()

    async def _end(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._dispatcher.stop("the session was closed")
        self.hub.tell_rest(self._clock.now())
        for task in self._tasks:
            task.cancel()
        # An error in the block is passed to the caller unchanged, not in an exception group. Only a
        # cancellation is passed to the task group, which may have requested the cancellation.
        if isinstance(error, asyncio.CancelledError):
            await self._group.__aexit__(kind, error, trace)
        else:
            await self._group.__aexit__(None, None, None)

    async def _say_goodbye(self) -> None:
        """Run the `on_close` steps of the driver, within their time limit."""
        polite = [
            link
            for name, link in self._links.items()
            if self.profile.driver.transports[name].on_close and link.is_connected
        ]
        if not polite:
            return
        self._dispatcher.finish()
        until = self._clock.now() + GOOD_BYE_S + _GRACE_S
        while any(link.is_connected for link in polite) and self._clock.now() < until:
            await self._clock.sleep(_LOOK_S)

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading] | None = None,
        *,
        confirmed_by: tuple[str, ...] = (),
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
        on_goal: Callable[[str, bool], None] | None = None,
    ) -> Replied:
        """Run a command and return its reply; the wait always has a time limit.

        A command waits for the first connection attempt of a persistent link.

        Args:
            name: name of the command in the driver.
            arguments: values of the arguments, by name; missing arguments use their defaults.
            confirmed_by: people who confirmed the command, for the two-person rule.
            on_sent: callback that receives each sent payload, except secrets and sequence payloads.
            unless: function that returns why the command may no longer start, or ""; called when
                the frame leaves URC.
            on_goal: callback for the goals that the command sends; see `Request.on_goal`.

        Raises:
            CommandFailed: the command was refused, timed out, or lost its connection.
        """
        given = arguments or NOTHING
        if self._untried:
            await self._first_attempt(name, given)
        number = next(self._numbers)
        request = new(Request, (number, name, given, confirmed_by, on_sent, unless, on_goal))
        try:
            outcome = await self._dispatcher.command(request)
        except asyncio.CancelledError:
            self._dispatcher.forget(request.id)
            raise
        if isinstance(outcome, Failed):
            raise CommandFailed(outcome.code, self._redactor.text(outcome.message))
        if outcome.values and self._redactor.is_needed:
            return outcome._replace(values=self._redactor.value(outcome.values))
        return outcome

    async def settle(self) -> str:
        """Wait until all sent data has arrived, so that closing the session loses none of it.

        Returns:
            A message about undelivered bytes, or "". The wait lasts a few seconds at most.
        """
        found = await asyncio.gather(*(link.settle() for link in self._links.values()))
        return "; ".join(filter(None, found))

    def reconnect(self) -> None:
        """Try to reopen all lost connections without waiting for their backoff."""
        for link in self._links.values():
            link.reconnect()

    def ask_topics(self, transport: str, names: Iterable[str], *, is_all: bool) -> None:
        """Request the topics of a ROS robot; see `Link.ask_topics`."""
        self._links[transport].ask_topics(names, is_all=is_all)

    def pull(self, sequence: str, what: Pull) -> None:
        """Pause, step, continue or end a sequence.

        If the sequence is not running, ``step`` makes its next run pause before the first step. All
        other verbs then only cancel an earlier ``step``.
        """
        self._dispatcher.pull(sequence, what)

    @property
    def goals(self) -> GoalReports:
        """The transports' reports about goals."""
        return self._goals if self.backend is None else self.backend.goals

    def latch(self, reason: str) -> None:
        """End all running sequences and refuse autonomous motion after a press of STOP.

        Args:
            reason: reason to display; "" permits autonomous motion again.
        """
        self._stops += reason != ""
        self._dispatcher.latch(reason)

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End unanswered cancellations of all goals of `actions`, which would also end new goals.

        A reset of STOP ends those that STOP has sent. Those of commands go on.
        """
        if self.backend is not None:
            self.backend.end_cancellations(actions)
            return
        for line in self._goals.end(actions):
            transport = self._transports[line]
            if isinstance(transport, SupportsGoals):
                transport.end_cancellations(actions)

    async def _first_attempt(self, name: str, given: Mapping[str, Reading]) -> None:
        """Wait, within a time limit, until the first attempt of a command's links has ended.

        Raises:
            CommandFailed: STOP was pressed during the wait for a command that moves the robot.
        """
        driver, stops = self.profile.driver, self._stops
        command = driver.commands.get(name)
        untried = [line for line in lines_of(name, driver) if line in self._untried]
        if command is None or not untried:
            return
        for line in untried:
            await self._until_tried(line)
        if stops != self._stops and command.moves_with(given):
            raise CommandFailed("not-allowed", STOPPED)

    async def _until_tried(self, line: str) -> None:
        turnstile = self._untried.get(line)
        if turnstile is None:
            return  # another command has waited already
        timeouts = self.profile.driver.transports[line].timeouts
        with suppress(TimeoutError):  # the engine then reports the missing connection
            async with within(self._clock, timeouts.connect_s + _GRACE_S):
                await turnstile.wait()
        if turnstile.is_open:
            self._untried.pop(line, None)


def _streams(driver: Driver) -> list[str]:
    """Return the transports that may split one message into several pieces."""
    return [name for name, one in driver.transports.items() if one.framing.type != "datagram"]


def _limit_s(driver: Driver, name: str) -> float:
    """Return the declared time limit of a command, plus a tolerance, in seconds."""
    known = driver.commands.get(name)
    paused_s = PAUSE_S if known is not None and known.steps else 0.0
    return longest_s(driver, name) + paused_s + _GRACE_S


def _expects_frames(driver: Driver, transport: str) -> bool:
    """Return whether the robot sends frames on this transport without requests."""
    polls = any(poll.transport == transport and poll.reply for poll in driver.polls)
    return polls or any(message.transport == transport for message in driver.messages.values())
