"""Cancellations of ROS 2 goals over the Foxglove protocol, repeated until the robot answers.

Pure. Two kinds of cancellations exist. The zero id cancels all goals of an action, those of other
programs too. In addition, each goal of URC is cancelled by its own id, because a goal may reach the
robot after the cancellation of all goals.

Each cancellation is sent again after 1 s, 2 s, 4 s, 8 s and then every 10 s, without a limit. It
ends only when the robot's reply proves that the goal cannot drive the robot any more. A refusal, a
failure and a missing reply prove nothing. The cancellations are kept in `UnfinishedGoals`, so they
outlive the connection.

A goal whose acceptance is still to come can be unknown, or even count as terminated. Such a reply
proves nothing either: the goal is cancelled again at the moment of its acceptance.

A reply to the zero id does not prove that the goals end. The library rclpy reports a refusal as
success without goals, and a goal can take long to end. The cancellation of all goals is therefore
answered only when the action's status then shows no active goal. An action that has never had a
goal has no status. Its silence counts only if the bridge shows the topic, and the reply listed no
goals.

Sources: action_msgs/srv/CancelGoal; rcl_action and rclpy, handling of cancel requests.
"""

import json
from collections.abc import Callable
from typing import Any, Final, Protocol

from urc.transports._faults import one_line
from urc.transports.ros.foxglove_frames import ServiceReply, ServiceType
from urc.transports.ros.foxglove_watches import StatusWatches
from urc.transports.ros.goal_status import SILENT_S, STATUS
from urc.transports.ros.goals import FIRST_S, UnfinishedGoals, is_ros_id, longer

__all__ = ["CANCEL_GOAL", "CancelCalls", "GoalCancellations", "first_value"]

CANCEL_GOAL: Final = "/_action/cancel_goal"
MAX_KEPT: Final = 256
"""Maximum number of awaited goals, and of accepted goals; above it, the oldest is dropped."""
_SHOWN: Final = 80
_CDR_HEAD: Final = b"\x00\x01\x00\x00"
_CODE_AT: Final = 4
"""Position of the first value in CDR, after the header."""
_COUNT: Final = slice(8, 12)
"""Position of the number of goals that the robot now cancels, in a CDR reply."""
_ALL: Final = bytes(16).hex()
"""Goal id that means all goals of an action."""
_ACCEPTED, _REJECTED, _UNKNOWN, _TERMINATED = range(4)
_INVALID: Final = "the reply is invalid"


class CancelCalls(Protocol):
    """The parts of a session that cancellations need."""

    def service(self, name: str) -> ServiceType | None:
        """Return a service that the bridge offers, or None."""

    def call(
        self, service: ServiceType, data: bytes, done: Callable[[ServiceReply | None, str], None]
    ) -> int:
        """Call a service and return the call's number.

        `done` receives the reply, or None and the reason for a failure.
        """

    def forget_call(self, number: int) -> None:
        """Ignore the reply to a call of `call` from now on."""

    def tell(self, text: str) -> None:
        """Write a line to the robot's log, once per connection."""

    def repeat(self, work: Callable[[], None], after_s: float) -> None:
        """Run `work` after `after_s` seconds, unless the connection has ended."""


class _Attempt:
    """The newest call that cancels one goal, or all goals of an action."""

    __slots__ = ("action", "call", "fault", "goal", "is_looking", "wait_s", "watch")

    def __init__(self, action: str, goal: str, wait_s: float) -> None:
        self.action, self.goal, self.wait_s = action, goal, wait_s
        self.call = 0
        self.fault = f"no reply within {wait_s:g} s"
        """Why the attempt has not succeeded; "" if the reason is already told."""
        self.watch: int | None = None
        """Number of the watch of the goals' states, or None."""
        self.is_looking = False
        """Whether the latched status may still arrive."""


class GoalCancellations:
    """The cancellations of one connection."""

    def __init__(self, goals: UnfinishedGoals, calls: CancelCalls, states: StatusWatches) -> None:
        """Create the state of a new connection.

        Args:
            goals: record that contains what earlier connections left open.
            calls: the session.
            states: the session's watches of the states of goals.
        """
        self._goals = goals
        self._calls = calls
        self._states = states
        self._attempts: dict[tuple[str, str], _Attempt] = {}
        """Newest attempt of each unanswered cancellation, keyed by action and goal id."""
        self._awaited: dict[str, str] = {}
        """Action of each goal that was sent and neither accepted nor refused, oldest first."""
        self._doomed: set[str] = set()
        """Awaited goals that are to be cancelled when the robot accepts them."""
        self._started: dict[str, None] = {}
        """Goals that the robot has accepted on this connection, oldest first."""

    # -- the states of a goal

    def sent(self, goal: str, action: str) -> None:
        """Await the acceptance of a goal that is being sent now."""
        while len(self._awaited) >= MAX_KEPT:
            oldest = next(iter(self._awaited))
            del self._awaited[oldest]
            self._doomed.discard(oldest)
        self._awaited[goal] = action

    def unanswered(self, goal: str) -> None:
        """Stop waiting for the acceptance of a goal; the robot may have received the goal."""
        self._awaited.pop(goal, None)
        self._doomed.discard(goal)

    def accepted(self, goal: str, action: str) -> None:
        """Cancel an accepted goal at once if its cancellation came earlier."""
        is_doomed = goal in self._doomed or self._goals.is_cancelled(goal)
        self.unanswered(goal)
        while len(self._started) >= MAX_KEPT:
            del self._started[next(iter(self._started))]
        self._started[goal] = None
        if is_doomed:
            self._goals.cancel_late(goal, action)
            self._cancel(action, goal)

    def ended(self, goal: str) -> None:
        """Forget a goal that has ended."""
        self._goals.finish(goal)
        self._started.pop(goal, None)
        self.unanswered(goal)
        for key in [key for key in self._attempts if key[1] == goal]:
            self._drop(key)

    def drop(self, action: str) -> None:
        """End the cancellation of all goals without an answer, for a new goal of the action."""
        self._goals.drop(action)
        self._drop((action, _ALL))

    # -- cancelling

    def cancel(self, action: str) -> None:
        """Cancel all goals of an action, now and until the robot has answered."""
        self._doomed.update(goal for goal, name in self._awaited.items() if name == action)
        goals = self._goals.cancel(action)
        self._cancel(action, _ALL)
        for goal in goals:
            self._cancel(action, goal)
        if self._calls.service(action + CANCEL_GOAL) is None:
            self._calls.repeat(lambda: self._tell_missing(action), FIRST_S)

    def offered(self, action: str) -> None:
        """Send the unanswered cancellations of an action, now that the bridge offers the service.

        Earlier connections may have lost them.
        """
        if self._goals.owes(action):
            self._cancel(action, _ALL)
        for goal, name in self._goals.cancelled():
            if name == action:
                self._cancel(action, goal)

    def _tell_missing(self, action: str) -> None:
        if self._goals.owes(action) and self._calls.service(action + CANCEL_GOAL) is None:
            shown = one_line(action)[:_SHOWN]
            self._calls.tell(
                f"the goals of {shown} are not cancelled yet: the bridge offers no service for that"
            )

    def _cancel(self, action: str, goal: str, wait_s: float = FIRST_S) -> None:
        """Send one cancellation, and send it again after `wait_s` seconds."""
        key = action, goal
        self._drop(key)
        service = self._calls.service(action + CANCEL_GOAL)
        if service is None:  # `offered` sends it
            return
        if not is_ros_id(goal):  # from rosbridge; ended by the cancellation of all goals
            return
        attempt = self._attempts[key] = _Attempt(action, goal, wait_s)
        if goal == _ALL:
            self._goals.called(action)
        data = _cancellation(service, bytes.fromhex(goal))
        attempt.call = self._calls.call(
            service, data, lambda *reply: self._answered(attempt, *reply)
        )
        self._calls.repeat(lambda: self._again(attempt), wait_s)

    def _again(self, attempt: _Attempt) -> None:
        """Repeat a cancellation, unless it was answered or sent again since."""
        if not self._is_current(attempt):
            return
        if attempt.is_looking:  # for less than `SILENT_S`
            self._calls.repeat(lambda: self._again(attempt), SILENT_S)
            return
        if attempt.fault:
            self._calls.tell(f"the cancellation of {_what(attempt)} is repeated: {attempt.fault}")
        if self._is_open(attempt):
            self._cancel(attempt.action, attempt.goal, longer(attempt.wait_s))
        else:
            self._drop((attempt.action, attempt.goal))

    def _is_open(self, attempt: _Attempt) -> bool:
        if attempt.goal == _ALL:
            return self._goals.owes(attempt.action)
        return self._goals.is_cancelled(attempt.goal)

    def _drop(self, key: tuple[str, str]) -> None:
        attempt = self._attempts.pop(key, None)
        if attempt is not None:
            self._calls.forget_call(attempt.call)
            if attempt.watch is not None:
                self._states.end(attempt.watch)

    def _answered(self, attempt: _Attempt, reply: ServiceReply | None, fault: str) -> None:
        """Handle the robot's reply to a cancellation."""
        attempt.fault = ""
        if attempt.goal == _ALL and reply is not None:
            self._goals.replied(attempt.action)
        code = -1 if reply is None else first_value(reply, "return_code")
        if not _ACCEPTED <= code <= _TERMINATED:
            self._tell_failure(attempt, fault or _INVALID)
        elif code == _REJECTED:
            self._tell_refusal(attempt)
        elif attempt.goal == _ALL:
            if not self._is_followed(attempt.action, reply):
                self._look(attempt, reply)
        elif reply is not None and code == _ACCEPTED and not _cancels(reply):
            self._tell_refusal(attempt)  # rclpy reports a refusal like this
        elif attempt.goal in self._awaited:
            return  # the robot may still accept the goal
        elif attempt.goal in self._started:
            # The result ends an accepted goal; a goal that is over or unknown has no result.
            if code != _ACCEPTED:
                self.ended(attempt.goal)
            self._drop((attempt.action, attempt.goal))
        elif code != _UNKNOWN:
            self.ended(attempt.goal)  # no result follows on this connection

    def _look(self, attempt: _Attempt, reply: ServiceReply | None) -> None:
        """Wait until the robot's own status shows that no goal of the action is active."""
        attempt.fault = f"the bridge does not show {one_line(attempt.action + STATUS)[:_SHOWN]}"
        attempt.is_looking = True
        is_cancelling = reply is None or _cancels(reply)
        watch = self._states.watch(
            attempt.action, lambda is_active: self._seen(attempt, is_active=is_active)
        )
        if not self._is_current(attempt):  # a status that is already known has ended it
            if watch is not None:
                self._states.end(watch)
            return
        attempt.watch = watch
        self._calls.repeat(lambda: self._silent(attempt, is_cancelling=is_cancelling), SILENT_S)

    def _seen(self, attempt: _Attempt, *, is_active: bool) -> None:
        """Handle a status of the action after the robot's reply."""
        if not self._is_current(attempt):
            return
        attempt.is_looking = False
        attempt.fault = "the robot still follows a goal"
        if not is_active:
            self._settle(attempt)

    def _silent(self, attempt: _Attempt, *, is_cancelling: bool) -> None:
        """Take the silence of an action that has never had a goal as its end."""
        if not self._is_current(attempt) or not attempt.is_looking:
            return
        attempt.is_looking = False
        is_known = attempt.watch is not None and self._states.is_silent(attempt.watch)
        if is_known and not is_cancelling:
            self._settle(attempt)

    def _settle(self, attempt: _Attempt) -> None:
        """End the cancellation of all goals, unless the robot may still accept a goal."""
        if attempt.action not in self._awaited.values():
            self._goals.settle(attempt.action)
            self._drop((attempt.action, _ALL))

    def _is_current(self, attempt: _Attempt) -> bool:
        return self._attempts.get((attempt.action, attempt.goal)) is attempt

    def _is_followed(self, action: str, reply: ServiceReply | None) -> bool:
        """Return whether the robot may follow a goal despite its reply to the zero id."""
        if action in self._awaited.values():
            return True  # the robot may still accept it
        # rclpy reports a refusal as success without goals.
        is_empty = reply is None or not _cancels(reply)
        running = [goal for goal, name in self._goals.cancelled() if name == action]
        return is_empty and any(goal in self._started for goal in running)

    def _tell_refusal(self, attempt: _Attempt) -> None:
        self._calls.tell(f"the robot refused to cancel {_what(attempt)}; URC asks again")

    def _tell_failure(self, attempt: _Attempt, fault: str) -> None:
        self._calls.tell(f"the cancellation of {_what(attempt)} is repeated: {fault}")


def _what(attempt: _Attempt) -> str:
    which = "all goals" if attempt.goal == _ALL else "a goal"
    return f"{which} of {one_line(attempt.action)[:_SHOWN]}"


def _cancellation(service: ServiceType, goal: bytes) -> bytes:
    """Return the request of action_msgs/srv/CancelGoal with a zero time stamp."""
    if service.request[1] != "json":
        return _CDR_HEAD + goal + bytes(8)
    stamp = {"sec": 0, "nanosec": 0}
    return json.dumps({"goal_info": {"goal_id": {"uuid": list(goal)}, "stamp": stamp}}).encode()


def first_value(reply: ServiceReply, name: str) -> int:
    """Return the first value of a reply, which has one byte; -1 for an invalid reply."""
    if reply.encoding != "json":
        return reply.data[_CODE_AT] if len(reply.data) > _CODE_AT else -1
    try:
        said: Any = json.loads(reply.data)
        return int(said[name])
    except (ValueError, KeyError, TypeError, RecursionError):
        return -1


def _cancels(reply: ServiceReply) -> bool:
    """Return whether a reply lists a goal that the robot now cancels."""
    if reply.encoding != "json":
        return any(reply.data[_COUNT])  # not zero, in either byte order
    try:
        return bool(json.loads(reply.data)["goals_canceling"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return False
