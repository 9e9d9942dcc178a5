"""Commands that no control holds: permission checks, and the effect of STOP.

Layer 4. Only held commands require the lease. All other commands require the role ``drive`` or a
higher role, so a watcher cannot send commands. A command that starts autonomous motion (``moves``)
also fails while STOP is latched or another operator is driving. The engine checks the latch again,
because a command may have waited in a queue or for a confirmation.
"""

import asyncio
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import NamedTuple, Protocol

from urc.guard.goal_reports import GoalReports
from urc.model.driver import Command, Driver
from urc.model.payload import Envelope, Payload
from urc.model.role import Role, includes
from urc.model.values import NOTHING, Reading
from urc.motion.lease import WATCHES, Operator
from urc.protocol.events import Replied
from urc.protocol.requests.encode import BadArgument, check_arguments
from urc.protocol.sequences.sequence_control import Pull
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.clock import Clock
from urc.runtime.held_commands import MotionSession
from urc.runtime.hub import Hub
from urc.runtime.motion_controller import MotionController
from urc.runtime.running_goals import action_of
from urc.runtime.session import CommandFailed

__all__ = [
    "HELD",
    "OUT_OF_SCOPE",
    "CommandRefused",
    "Drivable",
    "OneShotCommands",
    "can_move",
    "needs_holding",
    "role_refusal",
    "starts_motion",
]

AGAIN_S = 1.0
"""Delay before an undelivered STOP is sent again, in seconds."""
LOOK_S = 0.1
"""Interval between checks for the answers to cancellations, in seconds."""
_STOP = Operator("", "STOP")
OUT_OF_SCOPE = "this token does not permit the command"
HELD = "this command moves the robot only while a control is held; it cannot be sent once"


class Drivable(MotionSession, Protocol):
    """The part of a robot's session that held and one-shot commands use."""

    @property
    def hub(self) -> Hub:
        """The hub with the values that all pages see."""

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading],
        *,
        on_sent: Callable[[Payload], None] | None = None,
    ) -> Replied:
        """Run a command and return its reply; raise `CommandFailed` if the command fails."""

    @property
    def goals(self) -> GoalReports:
        """The transports' reports about goals."""

    def latch(self, reason: str) -> None:
        """Latch STOP, end sequences and block autonomous motion; an empty `reason` resets STOP."""

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End unanswered cancellations of all goals of ROS actions."""


class CommandRefused(CommandFailed):
    """A command was refused before anything was sent to the robot."""


def can_move(driver: Driver) -> bool:
    """Return whether the robot can move and so needs STOP and the latch."""
    return any(one.hold is not None or one.moves or one.stops for one in driver.commands.values())


def needs_holding(driver: Driver, command: str) -> bool:
    """Return whether a command causes continuous motion, which requires a held control."""
    known = driver.commands.get(command)
    return known is not None and known.hold is not None


def starts_motion(command: Command, arguments: Mapping[str, object]) -> bool:
    """Return whether a command with these arguments starts autonomous motion."""
    if command.moves_if is None:
        return command.moves
    try:
        return command.moves_with(check_arguments(command, arguments))
    except BadArgument:
        return False  # the engine reports the mistake; nothing is sent


def role_refusal(client: Operator, needed: Role) -> str:
    """Return the reason why the role of `client` does not permit a command, or ""."""
    if includes(client.role, needed):
        return ""
    text = WATCHES if needed == "drive" else f"this command needs the role {needed}"
    return client.limit or text


class _Cancellation(NamedTuple):
    """A sent cancellation: its action, and the number of reports before it was sent."""

    action: str
    since: int


class OneShotCommands:
    """The commands of one robot that do not need a held control."""

    def __init__(
        self,
        driver: Driver,
        controller: Callable[[], MotionController],
        clock: Clock,
        recorder: AuditRecorder,
    ) -> None:
        """Prepare the commands; `controller` returns the current motion controller."""
        self.driver = driver
        self._controller = controller
        self._clock = clock
        self._recorder = recorder
        self._session: Drivable | None = None
        self.on_stopped: Callable[[], None] = _nobody
        """Callback for each press of STOP."""
        self._pressed = asyncio.Event()
        self._cancelled: dict[str, None] = {}
        """ROS actions of which STOP has cancelled all goals since the last reset."""

    def admit(
        self, client: Operator, command: str, arguments: Mapping[str, object], stops: int | None
    ) -> None:
        """Raise `CommandRefused` if the page may not run this command or sequence."""
        is_held = needs_holding(self.driver, command)
        reason = HELD if is_held else self.refusal(client, command, arguments, stops)
        if reason:
            raise CommandRefused("refused", reason)

    def refusal(
        self,
        client: Operator,
        command: str,
        arguments: Mapping[str, object] = NOTHING,
        stops: int | None = None,
    ) -> str:
        """Return the reason why the page may not run a command or sequence now, or "".

        `stops` is the number of STOPs known to the page when the operator clicked; None means the
        current number.
        """
        known = self.driver.commands.get(command)
        if known is not None and starts_motion(known, arguments):
            reason = self._controller().lease.interlock(client, stops)
            if reason:
                return reason
        return role_refusal(client, known.role if known is not None else "drive")

    def pull_refusal(self, client: Operator, sequence: str, what: Pull) -> str:
        """Return the reason why the operator may not control a sequence, or "".

        Any operator may pause or end a sequence.
        """
        if what in ("pause", "abort"):
            return role_refusal(client, "drive")
        return self.refusal(client, sequence)

    # -- session

    async def serve(self, session: Drivable) -> None:
        """Deliver every STOP to a session; deliver a latched or unacknowledged STOP immediately."""
        self._session = session
        self._pressed.clear()
        self._controller().owe_unanswered()
        if self._controller().lease.latched or self._controller().owed:
            self.stopped()
        try:
            async with asyncio.TaskGroup() as group:
                giving: asyncio.Task[None] | None = None
                while True:
                    await self._pressed.wait()
                    self._pressed.clear()
                    if giving is not None:
                        giving.cancel()  # each press starts a new stop
                    giving = group.create_task(self._give_stops(session))
        finally:
            self._session = None

    def stopped(self) -> None:
        """Start sending the stop commands after a press of STOP."""
        self.on_stopped()
        if self._session is not None:
            self._session.latch(self._controller().lease.latched)
            self._pressed.set()

    def reset(self) -> None:
        """Permit autonomous motion again after a reset, and end the cancellations of STOP.

        The cancellations of an operator's commands go on, because the reset does not concern them.
        """
        cancelled, self._cancelled = self._cancelled, {}
        if self._session is not None:
            self._session.end_cancellations(cancelled)
            self._session.latch("")

    async def _give_stops(self, session: Drivable) -> None:
        """Repeat the stop commands until the robot has acknowledged each command."""
        asked: dict[str, _Cancellation] = {}
        while self._controller().owed or asked:
            while owed := self._controller().owed:
                async with asyncio.TaskGroup() as group:
                    for command in owed:
                        group.create_task(self._give_stop(session, command, asked))
                if self._controller().owed:
                    await self._clock.sleep(AGAIN_S)
            await self._await_answers(session, asked)
        if self._controller().is_certain:
            session.hub.settle_goals()

    async def _await_answers(self, session: Drivable, asked: dict[str, _Cancellation]) -> None:
        """Wait until the robot has answered the cancellations; the transport repeats them.

        Return early if a cancellation has not left URC in time, or has ended without an answer; its
        command is then owed again.

        Args:
            session: the session that has sent the cancellations.
            asked: cancellation of each stop command that cancels goals, keyed by command.
        """
        until_s = self._clock.now() + AGAIN_S
        while asked:
            if not self._controller().lease.latched:
                asked.clear()
                return
            for command, (action, since) in tuple(asked.items()):
                line = self.driver.commands[command].transport
                answer = session.goals.answer(line, action, since)
                if answer == "answered":
                    del asked[command]
                    self._controller().answered(command)
                elif answer == "dropped" or (answer == "unsent" and self._clock.now() > until_s):
                    del asked[command]
                    self._controller().owe_unanswered((command,))
            if self._controller().owed:
                return
            await self._clock.sleep(LOOK_S)

    async def _give_stop(
        self, session: Drivable, command: str, asked: dict[str, _Cancellation]
    ) -> None:
        sent: list[Payload] = []
        since = session.goals.number
        outcome, is_heard = "done", True
        try:
            await session.command(command, {}, on_sent=partial(self._sent, sent))
        except CommandFailed as failed:
            outcome = f"{failed.code}: {failed.message}"
            # A refused stop is repeated, too: the robot may go on. A reset ends the retries.
            is_heard = bool(sent) and not self._controller().lease.latched
        if sent:
            self._recorder.ran(_STOP, command, {}, outcome, sent[-1])
        last = sent[-1] if sent else None
        if outcome == "done" and isinstance(last, Envelope) and last.verb == "cancel":
            asked[command] = _Cancellation(str(last.attributes.get("action")), since)
            self._controller().await_answer(command)
        if is_heard:
            self._controller().given(command)

    def _sent(self, sent: list[Payload], payload: Payload) -> None:
        """Note what a stop command is sending."""
        sent.append(payload)
        if action := action_of(payload, "cancel"):
            self._cancelled[action] = None


def _nobody() -> None:
    """Ignore a press of STOP."""
