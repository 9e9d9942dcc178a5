"""Goals of ROS 2 actions over the Foxglove protocol, by the hidden services of each action.

Pure. The protocol has no actions. A bridge started with ``include_hidden: true`` offers what ROS 2
itself uses for an action. These are the services ``ACTION/_action/send_goal``, ``get_result`` and
``cancel_goal``, and the topic ``ACTION/_action/feedback``.

The engine encodes goals, because it knows the types. The bytes of a cancellation are fixed, so this
module makes them without the engine. The guard can cancel a goal even while the engine is frozen.

A `cancel` ends all goals of the action, those of other programs too. In addition, each goal of URC
is cancelled by its id. This is repeated on later connections, and while the robot does not know the
goal: the bridge may deliver a goal late, after the cancellation. A goal that has not left URC when
its action is cancelled is never sent.

A bridge announces its services just after the connection opens. Goals and cancellations therefore
wait a moment for their services.

Sources: ROS 2 design, Actions; action_msgs/srv/CancelGoal; action_msgs/msg/GoalStatus.
"""

import json
import secrets
from collections.abc import Callable
from typing import Any, Final, Protocol

from urc.model.payload import Envelope
from urc.transports._faults import one_line
from urc.transports.ros.foxglove_frames import ServiceReply, ServiceType
from urc.transports.ros.goals import MAX_GOALS, UnfinishedGoals

__all__ = ["FEEDBACK", "ActionCalls", "FoxgloveActions", "feedback_of"]

SEND_GOAL: Final = "/_action/send_goal"
GET_RESULT: Final = "/_action/get_result"
CANCEL_GOAL: Final = "/_action/cancel_goal"
FEEDBACK: Final = "/_action/feedback"
AGAIN_S: Final = 1.0
"""Time after which a cancellation is repeated if the robot does not know the goal, in seconds."""
MAX_CANCELS: Final = 10
"""Maximum number of cancellations of one goal on one connection."""
_SHOWN: Final = 80
_CDR_HEAD: Final = b"\x00\x01\x00\x00"
_CODE_AT: Final = 4
"""Position of the first value in CDR, after the header."""
_ALL: Final = bytes(16)
"""Goal id that means all goals of an action."""
_ACCEPTED, _REJECTED, _UNKNOWN = 0, 1, 2
_CANCELLED: Final = "the action was cancelled"
HIDDEN: Final = "the bridge offers no actions: start it with include_hidden: true"


def feedback_of(topic: str) -> str:
    """Return the name of an action's feedback in documents; other topics keep their names."""
    return topic.removesuffix(FEEDBACK) + "/feedback" if topic.endswith(FEEDBACK) else topic


class ActionCalls(Protocol):
    """The parts of a session that goals need."""

    def service(self, name: str) -> ServiceType | None:
        """Return a service that the bridge offers, or None."""

    def has_service(self, suffix: str) -> bool:
        """Return whether the bridge offers a service whose name has this end."""

    def call(
        self, service: ServiceType, data: bytes, done: Callable[[ServiceReply | None, str], None]
    ) -> None:
        """Call a service; `done` receives the reply, or None and the reason for a failure."""

    def answer(self, number: object, reason: str = "", values: object = None) -> None:
        """Report the result of a request to the engine; a `reason` means failure."""

    def return_unencoded(
        self, service: ServiceType, attributes: dict[str, object], body: object
    ) -> None:
        """Return a request to the engine, which encodes it and sends it again."""

    def tell(self, text: str) -> None:
        """Write a line to the robot's log, once per connection."""

    def repeat(self, work: Callable[[], None]) -> None:
        """Run `work` after `AGAIN_S` seconds, unless the connection has ended."""


class FoxgloveActions:
    """The goals and cancellations of one connection."""

    def __init__(self, goals: UnfinishedGoals, calls: ActionCalls) -> None:
        """Create the state of a new connection; `goals` also contains those of earlier ones."""
        self._goals = goals
        self._calls = calls
        self._unsent: dict[str, str] = {}
        """Action of each goal that waits for its service or for the engine, keyed by goal id."""
        self._owed: set[str] = set()
        """Actions whose goals are to be cancelled as soon as the bridge offers the service."""
        self._started: set[str] = set()
        """Goals that the robot has accepted on this connection."""
        self._cancels: dict[str, int] = {}
        """Number of cancellations of each goal on this connection."""

    # -- starting

    def start(self, envelope: Envelope) -> None:
        """Have the engine encode a goal, or report why the goal cannot be sent."""
        goal, action = secrets.token_bytes(16), str(envelope.attributes.get("action") or "")
        while len(self._unsent) >= MAX_GOALS:
            del self._unsent[next(iter(self._unsent))]
        self._unsent[goal.hex()] = action
        if not self._return(goal, action, envelope):
            self._calls.repeat(lambda: self._return_late(goal, action, envelope))

    def _return(self, goal: bytes, action: str, envelope: Envelope) -> bool:
        """Return a goal to the engine; return False if the bridge lacks a service of the action."""
        service = self._calls.service(action + SEND_GOAL)
        if service is None or self._calls.service(action + CANCEL_GOAL) is None:
            return False
        said = envelope.attributes
        attributes = {"id": said.get("id"), "goal": goal.hex(), "stops": said.get("stops")}
        body = {"goal_id": {"uuid": list(goal)}, "goal": envelope.body or {}}
        self._calls.return_unencoded(service, attributes, body)
        return True

    def _return_late(self, goal: bytes, action: str, envelope: Envelope) -> None:
        """Return a goal to the engine that has waited for its services."""
        number = envelope.attributes.get("id")
        if goal.hex() not in self._unsent:
            self._calls.answer(number, _CANCELLED)
        elif not self._return(goal, action, envelope):
            del self._unsent[goal.hex()]
            self._calls.answer(number, self._hindrance(one_line(action)[:_SHOWN], action))

    def _hindrance(self, shown: str, action: str) -> str:
        """Return the reason why no goal can be sent to an action."""
        if self._calls.service(action + SEND_GOAL) is not None:
            return f"the bridge offers no service that cancels {shown}, so no goal is sent"
        if self._calls.has_service(SEND_GOAL):
            return f"there is no action {shown}"
        return HIDDEN

    def send(self, goal: str, number: object, service: ServiceType, data: bytes) -> None:
        """Send an encoded goal, unless its action has been cancelled since."""
        action = self._unsent.pop(goal, None)
        if action is None:
            self._calls.answer(number, _CANCELLED)
            return
        self._goals.add(goal, action)
        self._calls.call(service, data, lambda *reply: self._replied(goal, action, number, *reply))

    def _replied(
        self, goal: str, action: str, number: object, reply: ServiceReply | None, fault: str
    ) -> None:
        """Ask for the result of an accepted goal."""
        if reply is None:  # the goal is kept, because the robot may have received it
            self._calls.answer(number, fault)
            return
        if not _first(reply, "accepted"):
            self._goals.finish(goal)
            self._calls.answer(number, "the action was rejected")
            return
        self._started.add(goal)
        if any(goal == one for one, _ in self._goals.cancelled()):
            self._cancel(goal, action)  # cancelled before the robot had accepted it
        service = self._calls.service(action + GET_RESULT)
        if service is None:
            self._calls.answer(number, f"the bridge does not offer {action + GET_RESULT}")
            return
        body = {"goal_id": {"uuid": list(bytes.fromhex(goal))}}
        attributes = {"id": number, "result_of": goal}
        self._calls.return_unencoded(service, attributes, body)

    def ended(self, goal: str) -> None:
        """Forget a goal whose result has arrived."""
        self._goals.finish(goal)
        self._started.discard(goal)
        self._cancels.pop(goal, None)

    # -- cancelling

    def cancel(self, action: str) -> None:
        """Cancel all goals of an action, and never send those that are being encoded."""
        self._unsent = {goal: name for goal, name in self._unsent.items() if name != action}
        goals = self._goals.cancel(action)
        service = self._calls.service(action + CANCEL_GOAL)
        if service is not None:
            self._calls.call(service, _cancellation(service, _ALL), _ignore)
            for goal in goals:
                self._cancels.pop(goal, None)
                self._cancel(goal, action)
        elif len(self._owed) < MAX_GOALS:
            self._owed.add(action)
            self._calls.repeat(lambda: self._give_up(action, has_goals=bool(goals)))

    def _give_up(self, action: str, *, has_goals: bool) -> None:
        """Stop waiting for the service that cancels all goals of an action."""
        is_missing = action in self._owed
        self._owed.discard(action)
        if is_missing and not has_goals:
            shown = one_line(action)[:_SHOWN]
            self._calls.tell(f"no unfinished goal of {shown} is known: none is cancelled")

    def offered(self, name: str) -> None:
        """Repeat the cancellations that earlier connections may have lost, now that it is possible.

        Args:
            name: name of a service that the bridge has begun to offer.
        """
        if not name.endswith(CANCEL_GOAL):
            return
        action, service = name.removesuffix(CANCEL_GOAL), self._calls.service(name)
        if action in self._owed and service is not None:
            self._owed.discard(action)
            self._calls.call(service, _cancellation(service, _ALL), _ignore)
        self._cancel_again(action)

    def _cancel_again(self, action: str) -> None:
        for goal, name in self._goals.cancelled():
            if name == action:
                self._cancel(goal, name)

    def _cancel(self, goal: str, action: str) -> None:
        service = self._calls.service(action + CANCEL_GOAL)
        if service is None or self._cancels.get(goal, 0) >= MAX_CANCELS:
            return
        self._cancels[goal] = self._cancels.get(goal, 0) + 1
        data = _cancellation(service, bytes.fromhex(goal))
        self._calls.call(service, data, lambda *reply: self._cancelled(goal, action, *reply))

    def _cancelled(self, goal: str, action: str, reply: ServiceReply | None, fault: str) -> None:
        """Handle the robot's reply to a cancellation."""
        code = -1 if reply is None else _first(reply, "return_code")
        is_kept = any(goal == one for one, _ in self._goals.cancelled())
        if not is_kept:
            return
        if code == _REJECTED:
            self._calls.tell(f"the robot refused to cancel a goal of {one_line(action)[:_SHOWN]}")
        elif code == -1 or (code == _UNKNOWN and goal not in self._started):
            if code == -1:
                self._calls.tell(f"a goal of {one_line(action)[:_SHOWN]} is not cancelled: {fault}")
            self._calls.repeat(lambda: self._repeat(goal, action))
        elif code != _ACCEPTED or goal not in self._started:
            self.ended(goal)  # no result follows on this connection

    def _repeat(self, goal: str, action: str) -> None:
        if any(goal == one for one, _ in self._goals.cancelled()):
            self._cancel(goal, action)


def _cancellation(service: ServiceType, goal: bytes) -> bytes:
    """Return the request of action_msgs/srv/CancelGoal with a zero time stamp."""
    if service.request[1] != "json":
        return _CDR_HEAD + goal + bytes(8)
    stamp = {"sec": 0, "nanosec": 0}
    return json.dumps({"goal_info": {"goal_id": {"uuid": list(goal)}, "stamp": stamp}}).encode()


def _first(reply: ServiceReply, name: str) -> int:
    """Return the first value of a reply, which has one byte; -1 for an invalid reply."""
    if reply.encoding != "json":
        return reply.data[_CODE_AT] if len(reply.data) > _CODE_AT else -1
    try:
        said: Any = json.loads(reply.data)
        return int(said[name])
    except (ValueError, KeyError, TypeError, RecursionError):
        return -1


def _ignore(reply: ServiceReply | None, fault: str) -> None:
    """Ignore the reply: the goals are also cancelled by their ids."""
