"""The dashboard's robots and the code that opens and closes their sessions.

Layer 5. A robot's session opens when the first client connects and closes shortly after the last
client disconnects. Reloading a page therefore keeps the robot connected. When the last page is
closed, the robot is disconnected.
"""

import asyncio
import logging
import secrets
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Collection, Iterator, Mapping
from contextlib import (
    AbstractAsyncContextManager,
    AsyncExitStack,
    asynccontextmanager,
    contextmanager,
)
from dataclasses import dataclass
from typing import Protocol

from urc.guard.goal_reports import GoalReports
from urc.model.payload import Payload
from urc.model.profile import Profile, Setting
from urc.model.values import Reading, Value
from urc.problems import UrcError
from urc.protocol.events import Replied
from urc.protocol.sequences.sequence_control import Pull
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.clock import Clock, LoopClock
from urc.runtime.held_commands import MotionSession
from urc.runtime.hub import Hub
from urc.runtime.latch import LatchStore
from urc.runtime.robot_alarms import RobotAlarms
from urc.runtime.running_goals import RunningGoals
from urc.web.drive.command_runner import CommandRunner
from urc.web.drive.control_service import ControlService
from urc.web.drive.two_person import TwoPersonRule
from urc.web.feed.alarm_feed import AlarmFeed
from urc.web.feed.client_socket import SocketPeer
from urc.web.feed.fanout import Fanout
from urc.web.feed.picture_line import PicturePages
from urc.web.feed.topic_watch import TopicWatch

__all__ = [
    "Glimpse",
    "LiveSession",
    "Robot",
    "SessionFailed",
    "SessionLike",
    "RobotService",
    "Playback",
    "keep_all_signals",
    "missing_settings",
]


class Playback(Protocol):
    """A recording shown instead of a robot."""

    @property
    def began_s(self) -> float:
        """Start time of the recording, in seconds since 1970."""

    @property
    def length_s(self) -> float:
        """Length of the recording, in seconds."""

    @property
    def position_s(self) -> float:
        """Playback position, in seconds from the beginning."""

    @property
    def is_playing(self) -> bool:
        """Whether the playback is running."""

    @property
    def speed(self) -> float:
        """Playback speed; 1 is real time."""

    def play(self) -> None:
        """Start the playback; at the end of the recording, restart from the beginning."""

    def pause(self) -> None:
        """Pause the playback at the current position."""

    def seek(self, position_s: float) -> None:
        """Move the playback to a position, in seconds from the beginning."""


LINGER_S = 2.0
OPEN_TIMEOUT_S = 10.0
RETRY_S = 1.0
CLIENTS = 256
CLIENTS_OF_UNKNOWN, CLIENTS_OF_KNOWN = 8, 64
"""Maximum clients of one robot: for unknown visitors at one address, and for a known visitor."""
CLOSE_TIMEOUT_S = 8.0
"""Maximum wait for a session to end, in seconds."""
STOP_WITHIN_S = 1.0
"""Maximum wait for a robot to receive a STOP requested over HTTP, in seconds."""
STOP_DUE_S = 600.0
"""Maximum time for which a session without clients tries to deliver a stop, in seconds."""
_LOOK_S = 0.01
_SELDOM_S = 0.1
PICTURE_BYTES = 256 * 1024
"""Maximum size of the image that is stored after a session ends, in bytes."""

log = logging.getLogger(__name__)


class SessionLike(MotionSession, Protocol):
    """An open session, as the dashboard uses it."""

    @property
    def hub(self) -> Hub:
        """The latest values and link states."""

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading],
        *,
        confirmed_by: tuple[str, ...] = (),
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
        on_goal: Callable[[str, bool], None] | None = None,
    ) -> Replied:
        """Run a command and return its reply; raise `CommandFailed` if the command fails."""

    def reconnect(self) -> None:
        """Retry all lost connections now, without waiting for their backoff."""

    def pull(self, sequence: str, what: Pull) -> None:
        """Pause, step, resume or end a running sequence."""

    @property
    def goals(self) -> GoalReports:
        """The transports' reports about goals."""

    def latch(self, reason: str) -> None:
        """Latch STOP, end sequences and block autonomous motion; an empty `reason` resets STOP."""

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End unanswered cancellations of all goals of ROS actions."""


Glimpse = bytes | Mapping[str, Reading] | None
"""An image, or values keyed by signal; None if the robot's state is unknown."""


@dataclass(frozen=True, slots=True)
class Robot:
    """One robot of the dashboard."""

    profile: Profile
    settings: Mapping[str, Value]
    """Current values of the settings, with defaults."""
    open_session: Callable[[], AbstractAsyncContextManager[SessionLike]]
    """Function that returns a context, which keeps the robot connected while the context is open.
    Entering the context must not wait for a reply from the robot."""
    glimpse: Callable[[], Glimpse] | None = None
    """Function that returns a view of an emulated robot without connecting. None for a real
    robot."""
    is_emulated: bool = False
    """Whether the robot is emulated. Real and emulated robots with the same name share no stored
    state."""
    playback: Playback | None = None
    """The playback shown instead of a robot; None for a robot."""
    is_monitored: bool = False
    """Whether the robot stays connected without open pages, so that its alarms are monitored."""


@dataclass(frozen=True, slots=True)
class LiveSession:
    """An open session of a robot, with the fan-out to the robot's pages."""

    session: SessionLike
    fanout: Fanout
    number: str
    """Number of the session, unique even across server restarts."""
    ended: asyncio.Event
    """Event that is set when the session ends, for any reason."""
    began_s: float
    """Start time of the session on the service's clock, in seconds."""
    topics: TopicWatch
    """Watcher of the topics of a ROS robot."""


class SessionFailed(UrcError):
    """The session could not be opened, or has ended."""


def missing_settings(robot: Robot) -> tuple[Setting, ...]:
    """Return the required settings without a value; URC cannot connect without them."""
    return tuple(
        setting
        for name, setting in robot.profile.settings.items()
        if setting.is_missing(robot.settings.get(name, setting.default))
    )


def keep_all_signals(profile: Profile) -> frozenset[str]:
    """Return the signals for which a widget of the robot shows every reading."""
    uses = [*profile.slots.values()]
    for interface in profile.interfaces.values():
        uses += interface.widgets.values()
    found: set[str] = set()
    for use in uses:
        widget = profile.widgets.get(use.widget)
        for port in widget.inputs.values() if widget is not None else ():
            if port.keeps_all:
                found |= {*use.lists.get(port.name, ())} | {use.inputs.get(port.name, "")}
    return frozenset(found & profile.driver.signals.keys())


class RobotService:
    """Opens a robot's session for the first client, and closes it after the last has left."""

    def __init__(
        self,
        robot: Robot,
        *,
        linger_s: float = LINGER_S,
        clock: Clock | None = None,
        latch: LatchStore | None = None,
        recorder: AuditRecorder | None = None,
        start_lock: asyncio.Lock | None = None,
        alarms: RobotAlarms | None = None,
    ) -> None:
        """Prepare the service; the session opens for the first client.

        Args:
            robot: the robot.
            linger_s: how long the session stays open after the last client has left, in seconds.
            clock: the clock.
            latch: store that preserves a latched STOP across restarts; None to store no latch.
            recorder: receives the audit events; None to record no events.
            start_lock: lock shared by all of a server's robots, so that sessions start one at a
                time.
            alarms: the robot's alarms; None to create alarms that are not stored.
        """
        self.robot = robot
        self.clock: Clock = clock or LoopClock()
        self.controls = ControlService(robot.profile.driver, self.clock, latch, recorder)
        self.consent = TwoPersonRule(lambda: self.controls.operators, self.clock)
        self.controls.once.on_stopped = self.consent.stop
        self.commands = CommandRunner(self.controls, self.consent, self.clock)
        self.alarms = alarms or RobotAlarms(robot.profile.driver, self.clock, time.time)
        self.alarm_feed = AlarmFeed(self.alarms, self.clock)
        self.picture_pages = PicturePages()
        self._linger_s = linger_s
        self._start_lock = start_lock or asyncio.Lock()
        self._visitors = 0
        self._operators: Counter[str] = Counter()
        self._changed = asyncio.Event()
        self._next: asyncio.Future[LiveSession] | None = None
        self._is_open = False
        self._held_off = 0
        """Number of callers that currently need the robot disconnected."""
        self._successor: tuple[Robot, LatchStore | None] | None = None
        self._last_picture: bytes | None = None
        self._goals = RunningGoals()
        """Goals of all sessions; a later page must see a goal of an earlier session."""

    @property
    def is_used(self) -> bool:
        """Whether a page or program uses the robot."""
        return self._visitors > 0

    @property
    def is_heard(self) -> bool:
        """Whether a connection to the robot is live."""
        live = self.open_session
        return live is not None and any(
            link.state == "live" for link in live.session.hub.links.values()
        )

    @property
    def is_full(self) -> bool:
        """Whether the robot has reached its maximum number of clients."""
        return self._visitors >= CLIENTS

    def has_room_for(self, peer: SocketPeer) -> bool:
        """Return whether `peer` may open one more page or stream of the robot."""
        most = CLIENTS_OF_KNOWN if peer.is_known else CLIENTS_OF_UNKNOWN
        return not peer.who or self._operators[peer.who] < most

    @contextmanager
    def visit(self, who: str = "") -> Iterator[None]:
        """Count a client while the context is open; see `SocketPeer.who` for `who`."""
        self._visitors += 1
        self._operators[who] += 1
        self._changed.set()
        try:
            yield
        finally:
            self._visitors -= 1
            self._operators[who] -= 1
            self._operators += Counter()  # drops zero counts
            self._changed.set()

    async def live(self) -> LiveSession:
        """Return the open session; raise `SessionFailed` if the session does not open."""
        try:
            async with asyncio.timeout(OPEN_TIMEOUT_S):
                return await asyncio.shield(self._next_session())
        except TimeoutError:
            raise SessionFailed("the robot's session did not open in time") from None

    @property
    def open_session(self) -> LiveSession | None:
        """The open session; None if no session is open."""
        coming = self._next
        if coming is None or not coming.done() or coming.cancelled() or coming.exception():
            return None
        return coming.result()

    def glimpse(self) -> Glimpse:
        """Return a view of the robot, without opening a connection.

        Without a session, a real robot's view is the last image of its previous session. An
        emulated robot without a picture shows its world.
        """
        if self.robot.glimpse is not None and not self.robot.profile.picture:
            return self.robot.glimpse()
        live = self.open_session
        if live is None:
            return self._last_picture
        hub = live.session.hub
        name = _first_image(hub)
        if name:
            hub.viewers.glance(name, self.clock.now())
        return _view(hub)

    def _keep_picture(self, hub: Hub) -> None:
        """Store the last image of a session for the menu."""
        seen = _view(hub)
        if isinstance(seen, bytes):
            self._last_picture = seen if len(seen) <= PICTURE_BYTES else None

    async def deliver_stop(self, within_s: float = STOP_WITHIN_S) -> bool:
        """Wait for at most `within_s` seconds; return whether the stop is certain."""
        controller = self.controls.controller
        end_s = self.clock.now() + within_s
        with self.visit():
            while not controller.is_certain and self.clock.now() < end_s:
                if controller.is_confirmed and not controller.has_own_stop:
                    break
                await self.clock.sleep(_LOOK_S)
        return controller.is_certain

    def control_state(self) -> dict[str, str | bool]:
        """Return the lease and the state of STOP, as `urc.web.manage.wire.ControlState`."""
        state = self.controls.controller.lease.state
        holder = "" if state.holder is None else state.holder.name or "another screen"
        is_emulated = self.robot.is_emulated or self.robot.playback is not None
        return {"holder": holder, "latched": state.latched_by, "emulated": is_emulated}

    @property
    def has_goal(self) -> bool:
        """Whether the robot follows a goal, or may follow a lost one."""
        return any(self._goals)

    @property
    def is_at_rest(self) -> bool:
        """Whether no one drives the robot, it has received every stop, and it follows no goal."""
        controller = self.controls.controller
        is_free = controller.lease.state.holder is None and not controller.is_stop_due
        return is_free and not self.has_goal

    @property
    def is_switching(self) -> bool:
        """Whether another version of the robot waits for the end of the open session."""
        return self._successor is not None

    @property
    def is_open(self) -> bool:
        """Whether a session is open, opening or closing."""
        return self._is_open

    @asynccontextmanager
    async def held_off(self) -> AsyncIterator[None]:
        """Keep the robot disconnected while the context is open.

        Callers that connect to the robot themselves need the context, because many robots accept
        only one connection. The caller must ensure that no operator is driving the robot. An open
        session ends first, and clients wait for the next session.
        """
        self._held_off += 1
        self._changed.set()
        try:
            end_s = self.clock.now() + CLOSE_TIMEOUT_S
            while self._is_open and self.clock.now() < end_s:
                await self.clock.sleep(_LOOK_S)
            yield
        finally:
            self._held_off -= 1
            self._changed.set()

    def replace(self, robot: Robot, latch: LatchStore | None = None) -> None:
        """Switch to another version of the robot for its next session; end any open session.

        The robot must be at rest (`is_at_rest`), because the switch disconnects it briefly.
        """
        self._successor = (robot, latch)
        if not self._is_open:
            self._succeed()
        self._changed.set()

    def _succeed(self) -> None:
        self._is_open = False
        if self._successor is not None:
            (self.robot, latch), self._successor = self._successor, None
            self._last_picture = None  # it may show another robot
            self.controls.renew(self.robot.profile.driver, latch)
            self.alarms.renew(self.robot.profile.driver, is_monitored=self._wants_monitoring)

    async def run(self) -> None:
        """Open and end the robot's sessions as they are needed, until cancelled."""
        self.alarms.start()
        try:
            await self._supervise()
        finally:
            self.alarms.stop()

    async def _supervise(self) -> None:
        while True:
            self._succeed()
            await self._wait_for(present=True)
            self._is_open = True
            try:
                async with self._opened() as session:
                    await self._serve(session)
            except UrcError as error:
                self._fail(str(error))
                await self.clock.sleep(RETRY_S)
            except Exception:  # a supervisor: one robot's bug must not end other robots' sessions
                log.exception("the session of %s failed", self.robot.profile.name)
                self._fail("the robot's session failed; the reason is in the server's log")
                await self.clock.sleep(RETRY_S)

    @asynccontextmanager
    async def _opened(self) -> AsyncIterator[SessionLike]:
        async with AsyncExitStack() as stack:
            # Starting a session compiles the driver and launches the guard, which blocks the loop
            # for up to 40 ms. The pause lets the loop read the input for driven robots between two
            # starts.
            async with self._start_lock:
                session = await stack.enter_async_context(self.robot.open_session())
                await asyncio.sleep(0)
            yield session

    async def _serve(self, session: SessionLike) -> None:
        session.hub.share_goals(self._goals)
        each = keep_all_signals(self.robot.profile)
        commands = self.robot.profile.driver.commands
        movers = [name for name, one in commands.items() if one.moves and one.steps]
        fanout = Fanout(session.hub, clock=self.clock, each=each, movers=movers)
        topics = TopicWatch(self.robot.profile, dict(self.robot.settings), session, self.clock)
        number, now_s = secrets.token_hex(8), self.clock.now()
        live = LiveSession(session, fanout, number, asyncio.Event(), now_s, topics)
        opened = self._next_session()
        opened.set_result(live)
        self.controls.recorder.attend(session.hub, self.clock.now)
        names = {"settings": self.robot.settings}
        try:
            with self.alarms.attending(session.hub, names):
                async with asyncio.TaskGroup() as group:
                    tasks = [
                        group.create_task(work)
                        for work in (fanout.run(), topics.run(), self.controls.serve(session))
                    ]
                    await self._until_deserted()
                    self._next = None  # later clients wait for the next session
                    for task in tasks:
                        task.cancel()
        finally:
            if self._next is opened:  # otherwise, a client is already waiting for the next session
                self._next = None
            self._keep_picture(session.hub)
            self.controls.recorder.attend(None, self.clock.now)
            await self.commands.end()
            live.ended.set()
            live.fanout.flush()  # wakes every client, so that each sees the end

    async def _until_deserted(self) -> None:
        while True:
            await self._wait_for(present=False)
            # The alarm, not the clock, decides when the wait ends: a loop timer may fire a fraction
            # of a millisecond early, and would then not fire again.
            rung = asyncio.Event()

            def ring(rung: asyncio.Event = rung) -> None:
                rung.set()
                self._changed.set()

            alarm = self.clock.call_at(self.clock.now() + self._linger_s, ring)
            while not (self._has_clients or self._is_unwanted or rung.is_set()):
                self._changed.clear()
                await self._changed.wait()
            alarm.cancel()
            await self._until_stopped()
            await self._until_arrived()
            if not self._has_clients or self._is_unwanted:
                return

    async def _until_arrived(self) -> None:
        """Wait for the replies to all goals; each reply has a time limit.

        Without the session, the replies would be lost, and a later page could not tell whether the
        robot still follows the goals.
        """
        while self._goals.is_awaited and not (self._has_clients or self._is_unwanted):
            await self.clock.sleep(_SELDOM_S)

    async def _until_stopped(self) -> None:
        """Wait until every stop has reached the robot, for at most `STOP_DUE_S` seconds.

        A latched STOP also waits for the answers to its cancellations, which the transport repeats.
        """
        end_s = self.clock.now() + STOP_DUE_S
        while self._is_stopping and self.clock.now() < end_s:
            if self._has_clients or self._is_unwanted:
                return
            await self.clock.sleep(_SELDOM_S)

    @property
    def _is_stopping(self) -> bool:
        controller = self.controls.controller
        awaits_answers = bool(controller.lease.latched) and controller.is_unanswered
        return controller.is_stop_due or awaits_answers

    @property
    def _is_unwanted(self) -> bool:
        """Whether an open session must end even though it has clients."""
        return self._successor is not None or self._held_off > 0

    async def _wait_for(self, *, present: bool) -> None:
        """Wait until a session is needed or, if `present` is false, until no session is needed."""
        while not (self._is_wanted if present else not self._has_clients or self._is_unwanted):
            self._changed.clear()
            await self._changed.wait()

    @property
    def _is_wanted(self) -> bool:
        return (self._has_clients and not self._held_off) or self._successor is not None

    @property
    def _has_clients(self) -> bool:
        """Whether a page, a program or alarm monitoring needs the robot."""
        return self._visitors > 0 or self.is_monitored

    @property
    def is_monitored(self) -> bool:
        """Whether the robot stays connected to monitor its alarms."""
        is_ready = self.alarms.has_limits and not missing_settings(self.robot)
        return self._wants_monitoring and is_ready

    @property
    def _wants_monitoring(self) -> bool:
        return self.robot.is_monitored and self.robot.playback is None

    def _next_session(self) -> asyncio.Future[LiveSession]:
        if self._next is None:
            self._next = asyncio.get_running_loop().create_future()
        return self._next

    def _fail(self, reason: str) -> None:
        coming, self._next = self._next, None
        if coming is not None and not coming.done():
            coming.set_exception(SessionFailed(reason))
            coming.exception()  # marks the exception as retrieved


def _first_image(hub: Hub) -> str:
    """Return the name of the first signal with an image; "" if no image has arrived."""
    samples = ((name, hub.latest(name)) for name in hub.signals)
    return next(
        (name for name, one in samples if one is not None and isinstance(one.value, bytes)), ""
    )


def _view(hub: Hub) -> Glimpse:
    """Return a robot's first image, or its values if it has no image; None without data."""
    image = hub.latest(_first_image(hub))
    if image is not None:
        return image.value if isinstance(image.value, bytes) else None
    samples = {name: hub.latest(name) for name in hub.signals}
    return {name: one.value for name, one in samples.items() if one is not None} or None
