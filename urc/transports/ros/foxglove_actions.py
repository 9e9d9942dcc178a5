"""Goals of ROS 2 actions over the Foxglove protocol, by the hidden services of each action.

Pure. The protocol has no actions. A bridge started with ``include_hidden: true`` offers what ROS 2
itself uses for an action. These are the services ``ACTION/_action/send_goal``, ``get_result`` and
``cancel_goal``, and the topic ``ACTION/_action/feedback``.

The engine encodes goals, because it knows the types. The bytes of a cancellation are fixed, so this
module makes them without the engine. The guard can cancel a goal even while the engine is frozen.

A `cancel` ends all goals of the action, those of other programs too. In addition, each goal of URC
is cancelled by its id. Both are repeated until the robot answers, on later connections too
(`urc.transports.ros.foxglove_cancellations`). A goal that has not left URC when its action is
cancelled is never sent.

A bridge announces its services just after the connection opens. Goals therefore wait a moment for
their services; a cancellation waits for as long as necessary.

Sources: ROS 2 design, Actions; action_msgs/msg/GoalStatus.
"""

import secrets
from typing import Final, Protocol

from urc.model.payload import UNKNOWN_END, Envelope
from urc.transports._faults import one_line
from urc.transports.ros.foxglove_cancellations import (
    CANCEL_GOAL,
    CancelCalls,
    GoalCancellations,
    first_value,
)
from urc.transports.ros.foxglove_frames import ServiceReply, ServiceType
from urc.transports.ros.foxglove_watches import StatusWatches
from urc.transports.ros.goals import MAX_GOALS, UnfinishedGoals
from urc.transports.topic_queue import TopicReceiveQueue

__all__ = ["FEEDBACK", "ActionCalls", "FoxgloveActions", "feedback_of"]

SEND_GOAL: Final = "/_action/send_goal"
GET_RESULT: Final = "/_action/get_result"
FEEDBACK: Final = "/_action/feedback"
_SERVICES_S: Final = 1.0
"""Maximum time for which a goal waits for its services, in seconds."""
_SHOWN: Final = 80
_CANCELLED: Final = "the action was cancelled"
HIDDEN: Final = "the bridge offers no actions: start it with include_hidden: true"


def feedback_of(topic: str) -> str:
    """Return the name of an action's feedback in documents; other topics keep their names."""
    return topic.removesuffix(FEEDBACK) + "/feedback" if topic.endswith(FEEDBACK) else topic


class ActionCalls(CancelCalls, Protocol):
    """The parts of a session that goals need."""

    queue: TopicReceiveQueue

    def has_service(self, suffix: str) -> bool:
        """Return whether the bridge offers a service whose name has this end."""

    def answer(self, number: object, reason: str = "", values: object = None) -> None:
        """Report the result of a request to the engine; a `reason` means failure."""

    def return_unencoded(
        self, service: ServiceType, attributes: dict[str, object], body: object
    ) -> None:
        """Return a request to the engine, which encodes it and sends it again."""


class FoxgloveActions:
    """The goals and cancellations of one connection."""

    def __init__(self, goals: UnfinishedGoals, calls: ActionCalls, states: StatusWatches) -> None:
        """Create the state of a new connection; `goals` also contains those of earlier ones."""
        self._goals = goals
        self._calls = calls
        self._unsent: dict[str, str] = {}
        """Action of each goal that waits for its service or for the engine, keyed by goal id."""
        self._cancellations = GoalCancellations(goals, calls, states)

    # -- starting

    def start(self, envelope: Envelope) -> None:
        """Have the engine encode a goal, or report why the goal cannot be sent."""
        goal, action = secrets.token_bytes(16), str(envelope.attributes.get("action") or "")
        while len(self._unsent) >= MAX_GOALS:
            del self._unsent[next(iter(self._unsent))]
        self._unsent[goal.hex()] = action
        if not self._return(goal, action, envelope):
            self._calls.repeat(lambda: self._return_late(goal, action, envelope), _SERVICES_S)

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
        self._cancellations.drop(action)
        self._cancellations.sent(goal, action)
        self._goals.add(goal, action)
        self._calls.call(service, data, lambda *reply: self._replied(goal, action, number, *reply))

    def _replied(
        self, goal: str, action: str, number: object, reply: ServiceReply | None, fault: str
    ) -> None:
        """Ask for the result of an accepted goal."""
        if reply is None:  # the robot may have received the goal
            self._cancellations.unanswered(goal)
            self.lose(number, fault)
            return
        if not first_value(reply, "accepted"):
            self.ended(goal)
            self._calls.answer(number, "the action was rejected")
            return
        self._cancellations.accepted(goal, action)
        service = self._calls.service(action + GET_RESULT)
        if service is None:
            self.lose(number, f"the bridge does not offer {action + GET_RESULT}")
            return
        body = {"goal_id": {"uuid": list(bytes.fromhex(goal))}}
        attributes = {"id": number, "result_of": goal}
        self._calls.return_unencoded(service, attributes, body)

    def lose(self, number: object, reason: str) -> None:
        """Report a goal whose result cannot arrive; the goal is kept, because it may go on."""
        attributes = {"id": number, "ok": False, "reason": reason, UNKNOWN_END: True}
        self._calls.queue.answer(Envelope("response", attributes))

    def ended(self, goal: str) -> str:
        """Forget a goal whose result has arrived; return the reason if it ended as cancelled."""
        why_cancelled = self._goals.why_cancelled(goal)
        self._cancellations.ended(goal)
        return why_cancelled

    # -- cancelling

    def cancel(self, action: str) -> None:
        """Cancel all goals of an action, and never send those that are being encoded."""
        self._unsent = {goal: name for goal, name in self._unsent.items() if name != action}
        self._cancellations.cancel(action)

    def drop_cancellation(self, action: str) -> None:
        """End the cancellation of all goals of an action without an answer."""
        self._cancellations.drop(action)

    def offered(self, name: str) -> None:
        """Send the unanswered cancellations of an action when its service appears.

        Args:
            name: name of a service that the bridge has begun to offer.
        """
        if name.endswith(CANCEL_GOAL):
            self._cancellations.offered(name.removesuffix(CANCEL_GOAL))
