"""Execution of a command from a page or program: rights, interlock, confirmation, reply and audit.

Layer 5. Pages and the HTTP API share this code, so both perform the same checks. Each command has
exactly one outcome and one audit log entry.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, Final, NamedTuple, Protocol, TypeVar

from urc.guard.goal_reports import GoalReports
from urc.model.payload import Payload
from urc.model.values import NOTHING, Reading
from urc.protocol.events import Replied
from urc.protocol.requests.bounds import longest_s
from urc.protocol.sequences.sequence_control import Pull
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.runtime.one_shot_commands import (
    LOOK_S,
    OUT_OF_SCOPE,
    CommandRefused,
    role_refusal,
    starts_motion,
)
from urc.runtime.running_goals import RunningGoal, action_of, places_of
from urc.runtime.session import CommandFailed
from urc.web.drive.control_service import ControlService, OperatorSession
from urc.web.drive.two_person import TwoPersonRule
from urc.wire.client_messages import CommandRequest

__all__ = ["COMMAND_TIMEOUT_S", "CommandOutcome", "CommandRunner", "CommandTarget"]

COMMAND_TIMEOUT_S: Final = 30.0
"""Longest wait for the reply to a command that does not declare a longer one, in seconds."""
SETTLE_S: Final = 60.0
"""Longest wait for the answer to a cancellation, in seconds."""
LOST: Final = ("disconnected", "timed-out", "stopped")
"""Codes of failures after which a robot may still be on its way to a goal."""
_Result = TypeVar("_Result")
NOT_AWAITED: Final = "the page or program that sent the command no longer waits for its reply"


class CommandTarget(Protocol):
    """The part of a robot's session that runs commands and sequences."""

    @property
    def hub(self) -> Hub:
        """The hub with the values that all pages see."""

    @property
    def goals(self) -> GoalReports:
        """The transports' reports about goals."""

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

    def pull(self, sequence: str, what: Pull) -> None:
        """Pause, step, continue or end a sequence."""


class CommandOutcome(NamedTuple):
    """The outcome of a command: the values of its reply, or the reason for its failure."""

    values: Mapping[str, Reading] = NOTHING
    """Values from the reply."""
    code: str = ""
    """Failure code; "" after success."""
    message: str = ""
    is_ours: bool = False
    """Whether the server refused the command before sending anything."""


class CommandRunner:
    """Runs the commands of one robot."""

    def __init__(self, controls: ControlService, consent: TwoPersonRule, clock: Clock) -> None:
        self._controls = controls
        self._consent = consent
        self._clock = clock
        self._followed: set[asyncio.Task[Any]] = set()
        """Commands with autonomous motion, and cancellations, that have not ended."""

    async def run(
        self,
        operator: OperatorSession,
        asked: CommandRequest,
        target: CommandTarget,
        *,
        timeout_s: float | None = None,
    ) -> CommandOutcome:
        """Run a command and return its outcome.

        Args:
            operator: the session of the page or program that sends the command.
            asked: the command with its arguments.
            target: the open session of the robot.
            timeout_s: longest wait for the reply, in seconds. None means the time that the driver
                declares for a command, at least `COMMAND_TIMEOUT_S`, and no limit for a sequence.
        """
        sent: deque[Payload] = deque(maxlen=1)  # the last sent frame
        people: tuple[str, ...] = ()
        is_over = False
        limit_s = self._limit_s(asked.command) if timeout_s is None else timeout_s
        try:
            people = await self._confirmed(operator, asked)
            async with asyncio.timeout(limit_s):
                with self._ended_with_right(operator, asked.command, target):
                    unless = self._late_check(operator, asked, lambda: is_over)
                    replied = await self._replied(operator, asked, target, people, sent, unless)
        except asyncio.CancelledError:
            recorder = self._controls.recorder
            text = "no client waited for the answer"
            recorder.ran(operator.client, asked.command, asked.arguments, text, _last(sent))
            raise
        except TimeoutError:
            outcome = CommandOutcome(code="timed-out", message=f"no answer within {limit_s:g} s")
        except CommandRefused as refused:
            return self.refuse(operator, asked, refused.code, refused.message)
        except CommandFailed as failed:
            outcome = CommandOutcome(code=failed.code, message=failed.message)
        else:
            outcome = CommandOutcome(replied.values)
        finally:
            is_over = True
        self._record(operator, asked, outcome, people, _last(sent))
        return outcome

    def refuse(
        self, operator: OperatorSession, asked: CommandRequest, code: str, message: str
    ) -> CommandOutcome:
        """Record and return the refusal of a command that was not sent."""
        self._controls.recorder.refused(operator.client, asked.command, message, self._clock.now())
        return CommandOutcome(code=code, message=message, is_ours=True)

    @contextmanager
    def _ended_with_right(
        self, operator: OperatorSession, command: str, target: CommandTarget
    ) -> Iterator[None]:
        """End a sequence as soon as its operator loses the right to run it."""
        known = self._controls.once.driver.commands.get(command)
        if known is None or not known.steps:
            yield
            return

        def check() -> None:
            reason = role_refusal(operator.client, known.role)
            if reason:
                target.pull(command, "abort")
                recorder = self._controls.recorder
                recorder.ran(operator.client, command, {}, f"ended, because {reason}")

        operator.on_role.add(check)
        try:
            yield
        finally:
            operator.on_role.discard(check)

    async def _replied(
        self,
        operator: OperatorSession,
        asked: CommandRequest,
        target: CommandTarget,
        people: tuple[str, ...],
        sent: deque[Payload],
        unless: Callable[[], str] | None,
    ) -> Replied:
        """Run a command and return its reply.

        Autonomous motion is shown on all pages until its reply, even if its own page is closed:
        the robot goes on. A command that has not been sent by then fails (`unless`).
        """
        known = self._controls.once.driver.commands.get(asked.command)
        if known is None or not starts_motion(known, asked.arguments):
            since = target.goals.number
            replied = await target.command(
                asked.command,
                asked.arguments,
                confirmed_by=people,
                on_sent=sent.append,
                unless=unless,
            )
            if known is not None and (action := action_of(_last(sent), "cancel")):
                self._start(self._settle(target, known.transport, action, since))
            return replied
        following = self._start(self._follow(operator, asked, target, people, sent, unless))
        outcome = await asyncio.shield(following)
        if isinstance(outcome, CommandFailed):
            raise outcome
        return outcome

    def _start(self, work: Coroutine[Any, Any, _Result]) -> asyncio.Task[_Result]:
        """Run work until it ends, or until the session ends."""
        task = asyncio.create_task(work)
        self._followed.add(task)
        task.add_done_callback(self._followed.discard)
        return task

    async def _settle(self, target: CommandTarget, line: str, action: str, since: int) -> None:
        """Drop the lost goals of an action after the robot has answered their cancellation.

        Without an answer in time, or if a newer goal ends the cancellation, they stay.
        """
        end_s = self._clock.now() + SETTLE_S
        while self._clock.now() < end_s:
            answer = target.goals.answer(line, action, since)
            if answer == "answered":
                target.hub.settle_goals(action)
            if answer in ("answered", "dropped"):
                return
            await self._clock.sleep(LOOK_S)

    async def _follow(
        self,
        operator: OperatorSession,
        asked: CommandRequest,
        target: CommandTarget,
        people: tuple[str, ...],
        sent: deque[Payload],
        unless: Callable[[], str] | None,
    ) -> Replied | CommandFailed:
        """Run a command that starts motion, and show it on all pages until it has ended."""
        client, hub, loop = operator.client, target.hub, asyncio.get_running_loop()
        known = self._controls.once.driver.commands[asked.command]
        goal = RunningGoal(
            0,
            asked.command,
            places_of(asked.arguments),
            client.name,
            client.id,
            self._clock.now(),
            title=known.title,
        )
        number, is_lost = hub.begin_goal(goal), True

        def on_goal(action: str, is_over: bool) -> None:
            # Later, because the engine is at work now.
            loop.call_soon(partial(hub.sent_goal, number, action, is_over=is_over))

        def on_sent(payload: Payload) -> None:
            sent.append(payload)
            on_goal(action_of(payload, "goal"), False)

        try:
            replied = await target.command(
                asked.command,
                asked.arguments,
                confirmed_by=people,
                on_sent=on_sent,
                unless=unless,
                on_goal=on_goal,
            )
            is_lost = False
        except CommandFailed as failed:
            # A sequence that has failed ends none of its goals.
            is_lost = failed.code in LOST or bool(known.steps)
            return failed
        finally:
            hub.end_goal(number, is_lost=is_lost)
        return replied

    def dismiss(self, operator: OperatorSession, number: int, hub: Hub) -> None:
        """Drop a lost goal that an operator knows to have ended; ignore unknown numbers."""
        goal = next((one for one in hub.goals if one.number == number and one.is_lost), None)
        if goal is None:
            return
        self._controls.recheck(operator)
        client, recorder = operator.client, self._controls.recorder
        reason = role_refusal(client, "drive")
        if not operator.rights.may_give(goal.command):
            reason = OUT_OF_SCOPE
        if reason:
            recorder.refused(client, goal.command, reason, self._clock.now())
            return
        hub.dismiss_goal(number)
        recorder.ran(client, goal.command, {}, "dismissed: the operator says that it has ended")

    async def end(self) -> None:
        """Stop following the motion of a session that has ended."""
        tasks = tuple(self._followed)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _limit_s(self, command: str) -> float | None:
        driver = self._controls.once.driver
        known = driver.commands.get(command)
        if known is not None and known.steps:
            return None
        return max(COMMAND_TIMEOUT_S, longest_s(driver, command))

    async def _confirmed(self, operator: OperatorSession, asked: CommandRequest) -> tuple[str, ...]:
        """Return the names of the people who confirmed a command, or raise `CommandFailed`."""
        self._admit(operator, asked)
        known = self._controls.once.driver.commands.get(asked.command)
        if known is None:
            return ()
        people = await self._consent.people(operator, asked.id, known, asked.arguments, asked.token)
        self._admit(operator, asked)  # checked again, because a confirmation takes time
        return people

    def _admit(self, operator: OperatorSession, asked: CommandRequest) -> None:
        """Raise `CommandRefused` if the page or program may not run the command now."""
        self._controls.recheck(operator)
        if not operator.rights.may_give(asked.command):
            raise CommandRefused("refused", OUT_OF_SCOPE)
        self._controls.once.admit(operator.client, asked.command, asked.arguments, asked.stops)

    def _late_check(
        self, operator: OperatorSession, asked: CommandRequest, is_over: Callable[[], bool]
    ) -> Callable[[], str] | None:
        """Return the check of a command that starts motion at the moment of its sending.

        The command may wait in a queue, and a goal may wait for its services. Meanwhile, the
        operator may lose the right, another operator may take the lease, or the page may be closed.
        Other commands are not checked: a command that stops the robot is always sent.
        """
        known = self._controls.once.driver.commands.get(asked.command)
        if known is None or known.stops:
            return None
        is_goal = known.send.options.get("verb") == "goal"
        if not is_goal and not starts_motion(known, asked.arguments):
            return None
        stops = asked.stops
        if stops is None:
            stops = self._controls.controller.lease.state.stops

        def check() -> str:
            """Read the rights only: the engine, which asks, must not be called from here."""
            if is_over() and not known.steps:  # a sequence goes on without its page
                return NOT_AWAITED
            if not operator.rights.may_give(asked.command):
                return OUT_OF_SCOPE
            client = operator.client._replace(role=operator.rights.role())
            return self._controls.once.refusal(client, asked.command, asked.arguments, stops)

        return check

    def _record(
        self,
        operator: OperatorSession,
        asked: CommandRequest,
        outcome: CommandOutcome,
        people: tuple[str, ...],
        sent: Payload,
    ) -> None:
        text = f"{outcome.code}: {outcome.message}" if outcome.code else "done"
        if people and not outcome.code:
            text += f"; confirmed by {', '.join(people)}"
        self._controls.recorder.ran(
            operator.client, asked.command, asked.arguments, text, sent, answer=outcome.values
        )


def _last(sent: deque[Payload]) -> Payload:
    return sent[-1] if sent else b""
