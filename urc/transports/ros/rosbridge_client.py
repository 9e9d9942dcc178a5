"""The roslibpy protocol of a rosbridge connection, without roslibpy's network connection.

roslibpy implements the rosbridge operations, their ids, and the handling of pending requests.
roslibpy's network connections are not used. After a reconnection, roslibpy would send old messages
again. roslibpy also fails on binary frames, and never checks whether the bridge still responds.
Measurements of roslibpy's network connections are recorded in docs/decisions. In this module,
roslibpy's protocol writes frames to a list, and the transport sends these frames over URC's socket.
The transport passes received data to the protocol. Each object serves only one connection.
Only the unfinished goals are carried over to the next connection, so that STOP can cancel them.

The client does no I/O and uses no tasks or threads.
"""

import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, cast

from roslibpy import ActionClient, Goal, Message, Ros, Service, Topic
from roslibpy.comm.comm import RosBridgeProtocol
from roslibpy.event_emitter import EventEmitterMixin

from urc.model.payload import Envelope
from urc.model.values import NOTHING
from urc.transports._faults import one_line
from urc.transports.base import TransportError
from urc.transports.ros.goals import FIRST_S, UnfinishedGoals, is_ros_id, longer
from urc.transports.ros.robot_time import CLOCK_TOPIC, RobotTime
from urc.transports.ros.rosbridge_operations import BadOperation, encode_operation
from urc.transports.ros.types import is_video, spelled
from urc.transports.topic_queue import TopicReceiveQueue

__all__ = ["RosSubscription", "RosClient"]

MAX_PENDING = 256
"""Maximum number of pending calls and goals; beyond this limit, the oldest is dropped."""
_NAME_SHOWN = 80
KNOWN_TOPICS = 256
"""Maximum number of remembered topics, services and actions."""


class RosSubscription(NamedTuple):
    """One subscription, as sent to the bridge."""

    topic: str
    type: str = ""
    throttle_ms: int = 0
    queue_length: int = 0
    compression: str = "none"
    is_packed: bool = False
    """Whether arrays of ``int8`` in the topic's messages are wanted as bytes."""


class RosClient:
    """Converts between envelopes and rosbridge operations, for one connection."""

    def __init__(
        self,
        queue: TopicReceiveQueue,
        ros: int | None,
        goals: UnfinishedGoals | None = None,
        clock: Callable[[], float] = time.monotonic,
        clock_only: bool | None = None,
    ) -> None:
        """Initialise the state for a new connection.

        Args:
            queue: queue that receives messages and replies.
            ros: ROS version of type names; None keeps names as written.
            goals: unfinished goals of this and earlier connections; None for no earlier goals.
            clock: monotonic clock, in seconds.
            clock_only: None if the bridge replaces ``now`` by its own time; otherwise, see
                `RobotTime`.
        """
        self._time = RobotTime(clock_only)
        self._queue = queue
        self._ros_version = ros
        self._protocol = _Protocol()
        self._ros = _Ros(self._protocol)
        self._size_bytes = 0
        self._topics: dict[str, Any] = {}
        self._services: dict[str, Any] = {}
        self._goals = UnfinishedGoals() if goals is None else goals
        self._clock = clock
        self._repeats: dict[str, tuple[float, float]] = {}
        """Time of the next cancellation of each cancelled goal, and the wait after it, in seconds.
        """
        self._listened: dict[str, tuple[RosSubscription, _Topic]] = {}
        """Topics that were subscribed on this connection."""
        self._own: dict[str, None] = {}
        """Goals of this connection whose results have not arrived, oldest first."""
        self._all_cancelled: set[str] = set()
        """Actions of which the robot has answered the cancellation of all goals."""
        self.received: dict[str, int] = {}
        """Number of received messages, keyed by subscribed topic."""

    @property
    def unanswered(self) -> int:
        """Number of pending calls and goals."""
        return self._protocol.unanswered

    def spell(self, ros: int | None) -> None:
        """Use the type names of ROS version `ros` from now on; None keeps names as written."""
        self._ros_version = ros

    # -- sending; each method returns the frames to write

    def listen(self, wanted: RosSubscription) -> list[bytes]:
        """Subscribe to one topic; return the frames to send."""
        topic = _Topic(
            self._ros,
            wanted.topic,
            spelled(wanted.type, "msg", self._ros_version) or None,
            compression=wanted.compression,
            throttle_rate=wanted.throttle_ms,
            queue_length=wanted.queue_length,
            reconnect_on_close=False,
        )
        self.received[wanted.topic] = 0
        if is_video(wanted.type):
            self._queue.keep_groups(wanted.topic)
        topic.subscribe(lambda body: self._message(wanted.topic, body))
        self._listened[wanted.topic] = wanted, topic
        return self._protocol.written()

    def pause(self, name: str) -> list[bytes]:
        """Unsubscribe from a topic of `listen`; return the frames to send."""
        known = self._listened.get(name)
        if known is not None and known[1].is_subscribed:
            known[1].unsubscribe()
        return self._protocol.written()

    def resume(self, name: str) -> list[bytes]:
        """Subscribe to a paused topic again; return the frames to send."""
        known = self._listened.get(name)
        return [] if known is None or known[1].is_subscribed else self.listen(known[0])

    def cancel_due(self) -> list[bytes]:
        """Repeat the due cancellations without results; on a new connection, all are due."""
        now_s = self._clock()
        cancelled = self._cancelled()
        self._repeats = {one: self._repeats.get(one, (now_s, FIRST_S)) for one in cancelled}
        for goal, (at_s, wait_s) in tuple(self._repeats.items()):
            if at_s <= now_s:
                self._cancel_goal(goal, cancelled[goal], wait_s)
        return self._protocol.written()

    def cancel_wait_s(self) -> float | None:
        """Return the time until a cancellation is due, in seconds; None if nothing is cancelled."""
        due_s = [self._repeats[one][0] for one in self._cancelled() if one in self._repeats]
        return max(0.0, min(due_s) - self._clock()) if due_s else None

    def _cancelled(self) -> dict[str, str]:
        """Return the action of each cancelled goal without a result, keyed by goal id."""
        return {one: name for one, name in self._goals.cancelled() if not is_ros_id(one)}

    def call_service(
        self,
        service: str,
        callback: Callable[[Mapping[str, Any]], None],
        arguments: Mapping[str, object] = NOTHING,
        errback: Callable[[object], None] | None = None,
    ) -> list[bytes]:
        """Call a service for internal use; on failure, only `errback` is called."""
        call = Service(self._ros, service, "").call
        call(dict(arguments), callback=callback, errback=errback or _ignore)
        return self._protocol.written()

    def perform(self, envelope: Envelope) -> list[bytes]:
        """Execute an envelope's operation; return the frames to send.

        Raises:
            TransportError: rosbridge does not support the operation.
        """
        work = {
            "publish": self._publish,
            "call": self._call,
            "goal": self._goal,
            "cancel": self._cancel,
        }.get(envelope.verb)
        if work is None:
            raise TransportError(
                f"rosbridge cannot {envelope.verb}; supported: publish, call, goal, cancel"
            )
        try:
            work(envelope.attributes, envelope.body)
        except BadOperation as problem:
            self._protocol.written()
            raise TransportError(str(problem)) from problem
        return self._protocol.written()

    def _publish(self, attributes: Mapping[str, object], body: object) -> None:
        name, kind = _text(attributes, "topic"), str(attributes.get("type") or "")
        body = self._timed(body)
        if not kind:  # the bridge can find the type if another client uses the topic
            operation = {"op": "publish", "topic": name, "msg": _fields(body)}
            self._protocol.send_ros_message(Message(operation))
            return
        topic = self._topics.get(name)
        if topic is None:
            topic = Topic(
                self._ros,
                name,
                spelled(kind, "msg", self._ros_version),
                latch=attributes.get("retain") is True,
                reconnect_on_close=False,
            )
            while len(self._topics) >= KNOWN_TOPICS:
                self._topics.pop(next(iter(self._topics))).unadvertise()
            self._topics[name] = topic
        topic.publish(_fields(body))

    def _timed(self, body: object) -> object:
        """Return a message with the simulated time; otherwise, the bridge replaces ``now``."""
        return self._time.timed(body, time.time_ns()) if self._time.is_simulated else body

    def _call(self, attributes: Mapping[str, object], body: object) -> None:
        name, number = _text(attributes, "service"), attributes.get("id")
        service = self._services.get(name)
        if service is None:
            if len(self._services) >= KNOWN_TOPICS:
                self._services.clear()
            kind = spelled(str(attributes.get("type") or ""), "srv", self._ros_version)
            service = self._services[name] = Service(self._ros, name, kind)
        service.call(
            _fields(self._timed(body)),
            callback=lambda values: self._answer(number, True, dict(values)),
            errback=lambda values: self._answer(number, False, values),
        )

    def _goal(self, attributes: Mapping[str, object], body: object) -> None:
        name, number = _text(attributes, "action"), attributes.get("id")
        kind = spelled(str(attributes.get("type") or ""), "action", self._ros_version)
        wants_feedback = attributes.get("feedback") is not False
        self._protocol.wants_feedback = wants_feedback
        goal: str = ActionClient(self._ros, name, kind, reconnect_on_close=False).send_goal(
            Goal(_fields(self._timed(body))),
            resultback=lambda result: self._result(goal, number, True, result),
            feedback=lambda values: self._feedback(name, number, values),
            errback=lambda result: self._result(goal, number, False, result),
        )
        self.drop(name)
        self._goals.add(goal, name)
        while len(self._own) >= MAX_PENDING:
            del self._own[next(iter(self._own))]
        self._own[goal] = None

    def _cancel(self, attributes: Mapping[str, object], body: object) -> None:
        """Cancel all unfinished goals of an action, including those of earlier connections."""
        name = _text(attributes, "action")
        goals = [one for one in self._goals.cancel(name) if not is_ros_id(one)]
        for goal in goals:
            self._cancel_goal(goal, name)
        self._all_cancelled.discard(name)

    def drop(self, action: str) -> None:
        """End the cancellation of all goals of an action without an answer."""
        self._all_cancelled.discard(action)
        self._goals.drop(action)

    def owes(self, action: str) -> bool:
        """Return whether the robot still owes the cancellation of all goals of an action."""
        return self._goals.owes(action) and action not in self._all_cancelled

    def all_cancelled(self, action: str, is_cancelling: bool) -> bool:
        """Note the robot's answer to the cancellation of all goals of an action.

        The answer proves nothing about a goal that the bridge has not passed on yet. The result of
        each goal of this connection must therefore arrive, too.

        Args:
            action: name of the action.
            is_cancelling: whether the robot has listed goals that it now cancels.

        Returns:
            Whether the answer ends the repetition. rclpy reports a refusal as success without
            goals. This is no answer while a goal of this connection goes on.
        """
        if not is_cancelling and self._is_followed(action):
            return False
        self._all_cancelled.add(action)
        self._settle(action)
        return True

    def _is_followed(self, action: str) -> bool:
        """Return whether a cancelled goal of this connection has no result yet."""
        goals = self._goals.cancelled()
        return any(name == action and goal in self._own for goal, name in goals)

    def _settle(self, action: str) -> None:
        """End the cancellation of an action if all its answers have arrived."""
        if action in self._all_cancelled and not self._is_followed(action):
            self._all_cancelled.discard(action)
            self._goals.settle(action)

    def _finish(self, goal: str) -> None:
        """Forget an ended goal, whose result may be the last missing answer."""
        action = self._goals.action(goal)
        self._own.pop(goal, None)
        self._goals.finish(goal)
        self._settle(action)

    def _cancel_goal(self, goal: str, action: str, wait_s: float = FIRST_S) -> None:
        self._repeats[goal] = self._clock() + wait_s, longer(wait_s)
        ActionClient(self._ros, action, "", reconnect_on_close=False).cancel_goal(goal)

    # -- receiving

    def arrived(self, operation: dict[str, Any], size_bytes: int) -> None:
        """Process one operation from the bridge.

        Raises:
            BadOperation: the operation is invalid.
        """
        self._size_bytes = size_bytes
        self._protocol.arrived(operation)

    def _message(self, topic: str, body: object) -> None:
        envelope = Envelope("message", {"topic": topic}, body)
        self.received[topic] += 1
        if self._time.is_simulated and topic == CLOCK_TOPIC:
            restarted = self._time.clock(None, body)
            if restarted is not None:
                self._queue.answer(restarted)
            if self._time.is_clock_only:
                return
        self._queue.message(topic, envelope, self._size_bytes)

    def _answer(self, number: object, is_ok: bool, values: object) -> None:
        attributes = {"id": number, "ok": is_ok}
        if not is_ok:
            said = one_line(values) if isinstance(values, str) else ""
            attributes["reason"] = said or "the service refused"
        self._queue.answer(Envelope("response", attributes, values), self._size_bytes)

    def _feedback(self, action: str, number: object, values: Any) -> None:
        attributes = {"action": action, "id": number}
        self._queue.answer(Envelope("feedback", attributes, dict(values)), self._size_bytes)

    def _result(self, goal: str, number: object, is_ok: bool, result: Any) -> None:
        status, values = result["status"], result["values"]
        why = self._goals.why_cancelled(goal) if status == _CANCELLED else ""
        self._finish(goal)
        attributes = {"id": number, "ok": is_ok, "status": status}
        if not is_ok:
            said = one_line(values) if isinstance(values, str) else _OUTCOMES.get(status, "failed")
            attributes["reason"] = why or (f"the action was {said}" if said in _ENDS else said)
        self._queue.answer(Envelope("response", attributes, values), self._size_bytes)


_CANCELLED = 5
_OUTCOMES = {4: "succeeded", _CANCELLED: "cancelled", 6: "aborted"}
_NOT_REACHED = (5, 6)
_ENDS = frozenset(_OUTCOMES.values())


class _Protocol(RosBridgeProtocol):  # type: ignore[misc] # roslibpy ships no types
    """A version of roslibpy's protocol class that writes to a list."""

    def __init__(self) -> None:
        super().__init__()
        self.factory = _Factory(self)
        self.wants_feedback = True
        self._frames: list[bytes] = []
        self._message_handlers["status"] = _ignore

    @property
    def unanswered(self) -> int:
        return len(self._pending_service_requests) + len(self._pending_action_requests)

    def written(self) -> list[bytes]:
        """Remove and return the frames that were written since the last call."""
        frames, self._frames = self._frames, []
        return frames

    def arrived(self, operation: dict[str, Any]) -> None:
        """Pass an operation to roslibpy; raise `BadOperation` for an invalid operation."""
        handler: Callable[[Any], None] | None = self._message_handlers.get(operation["op"])
        if handler is None:
            unknown = one_line(repr(operation["op"]), _NAME_SHOWN)
            raise BadOperation(f"the bridge sent an unknown operation {unknown}")
        try:
            handler(operation)
        except Exception as problem:  # roslibpy does not validate its input
            name = operation.get("id") or operation.get("topic")
            shown = one_line(repr(name), _NAME_SHOWN) if isinstance(name, str) else "?"
            raise BadOperation(f"{operation['op']} of {shown} is invalid") from problem

    # -- overridden methods of roslibpy

    def send_message(self, payload: bytes) -> None:
        self._frames.append(payload)

    def send_ros_message(self, message: Any) -> None:
        """Add an operation to the frames to send; unlike roslibpy, raise an error on failure."""
        self.send_message(encode_operation(dict(message)))

    def send_ros_service_request(self, message: Any, callback: Any, errback: Any) -> None:
        """Call a service like roslibpy, but permit NaN values and limit pending requests."""
        self.send_ros_message(message)
        _keep(self._pending_service_requests, message["id"], (callback, errback))

    def send_ros_action_goal(
        self, message: Any, resultback: Any, feedback: Any, errback: Any
    ) -> None:
        """Send an action goal like roslibpy, but permit NaN values and limit pending goals."""
        self.send_ros_message({**message, "feedback": self.wants_feedback})
        _keep(self._pending_action_requests, message["id"], (resultback, feedback, errback))

    def _handle_action_result(self, message: Any) -> None:
        """Process an action result like roslibpy, but accept any status number."""
        resultback, _, errback = self._pending_action_requests.pop(message["id"])
        values = message.get("values", {})
        status = message.get("status")
        if status is None and isinstance(values, dict):
            status = values.get("status")
        # Some versions of rosbridge report `result: true` for cancelled and aborted goals, too.
        is_ok = message.get("result") is not False and status not in _NOT_REACHED
        done = resultback if is_ok else errback
        done({"status": status, "values": values})


class _Factory(EventEmitterMixin):  # type: ignore[misc] # roslibpy ships no types
    """A version of roslibpy's connection factory that always appears to be connected."""

    is_connected = True

    def __init__(self, protocol: _Protocol) -> None:
        super().__init__()
        self._protocol = protocol

    def on_ready(self, callback: Callable[[Any], object]) -> None:
        callback(self._protocol)


class _Ros(Ros):  # type: ignore[misc] # roslibpy ships no types
    """A version of roslibpy's client that uses a given protocol instead of a network connection."""

    def __init__(self, protocol: _Protocol) -> None:
        # A bridge keeps goals by id for all its clients, so a repeated id would replace the goal of
        # an earlier connection or of another client. Each connection counts from a random number.
        self._id_counter = secrets.randbits(62)
        self.factory = protocol.factory
        self.is_connecting = False


class _Topic(Topic):  # type: ignore[misc] # roslibpy ships no types
    """A topic with optional CBOR messages, which are decoded before roslibpy receives them."""

    SUPPORTED_COMPRESSION_TYPES = ("none", "png", "cbor")


def _ignore(said: object) -> None:
    """Ignore the status or failure of an internal query; the bridge logs failures."""


def _keep(table: dict[str, object], name: str, waiting: object) -> None:
    while len(table) >= MAX_PENDING:
        del table[next(iter(table))]
    table[name] = waiting


def _text(attributes: Mapping[str, object], name: str) -> str:
    value = attributes.get(name)
    if not isinstance(value, str) or not value:
        raise TransportError(f"ros: {name} must be non-empty text, not {value!r}")
    return value


def _fields(body: object) -> dict[str, object]:
    if body is None:
        return {}
    if not isinstance(body, Mapping):
        raise TransportError("a ROS message must be an object with fields; use json")
    return dict(cast("Mapping[str, object]", body))
