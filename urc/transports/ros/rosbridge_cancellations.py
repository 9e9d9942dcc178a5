"""Cancellations of all goals of an action over rosbridge, by the hidden service of ROS 2 actions.

rosbridge cancels only goals that were sent through it, by their ids. Goals of other programs, and
of URC's own earlier processes, are known only to the robot. The hidden service `CANCEL_GOAL` of the
action cancels all goals if the request has a zero id and a zero time stamp. The request is empty,
because the bridge sets omitted fields to zero.

A bridge up to version 2.1 handles the operations of a client one after another. A service call
without an answer then blocks all later operations, and also stops. The calls therefore use
connections of their own, one for each attempt. A blocked call delays only itself.

An attempt is repeated after 1 s, 2 s, 4 s, 8 s and then every 10 s, without a limit, until the
robot answers. A refusal, a failure and a missing reply are no answers. A new goal of the action
ends the attempts, because they would also cancel the new goal.

A reply does not prove that the goals end: rclpy reports a refusal as success without goals, and a
goal can take long to end. An attempt therefore succeeds only after the topic `STATUS` of the action
shows no active goal. An action that has never had a goal has no status. Its silence counts only if
rosapi knows the topic's publisher, because a bridge can also withhold the topic.

Sources: action_msgs/srv/CancelGoal; action_msgs/msg/GoalStatusArray; ROS 2 design, Actions;
rosbridge protocol specification, ``call_service`` and ``subscribe``.
"""

import asyncio
import secrets
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final, Protocol

from urc.model.payload import Payload
from urc.transports._faults import one_line
from urc.transports.base import TransportError
from urc.transports.ros.goal_status import SILENT_S, STATUS, STATUS_TYPE, shows_active
from urc.transports.ros.goals import FIRST_S, UnfinishedGoals, longer
from urc.transports.ros.rosbridge_operations import BadOperation, OperationReader, encode_operation

__all__ = ["CANCEL_GOAL", "CancelWire", "ActionCancellations"]

CANCEL_GOAL: Final = "/_action/cancel_goal"
"""End of the name of the service that cancels goals."""
ATTEMPT_S: Final = 5.0
"""Time limit of one attempt, from connecting to the end of all goals, in seconds."""
MAX_AT_ONCE: Final = 8
"""Maximum number of simultaneous attempts; each one needs a connection."""
_SHOWN: Final = 80
_REJECTED, _TERMINATED = 1, 3
_GOES_ON: Final = "the robot still follows a goal"


class CancelWire(Protocol):
    """The parts of a WebSocket transport that an attempt needs."""

    async def open(self, timeout_s: float) -> None:
        """Connect within `timeout_s` seconds, or raise `TransportError`."""

    async def send(self, data: Payload) -> None:
        """Send one frame; raise `TransportError` on failure."""

    async def receive(self) -> bytes:
        """Return the next frame; raise `TransportError` at the end of the connection."""

    async def abort(self) -> None:
        """Close the connection immediately; never raises."""


class ActionCancellations:
    """The repeated cancellations of one rosbridge session, one task for each action."""

    def __init__(
        self,
        wire: Callable[[], CancelWire],
        owes: Callable[[str], bool],
        answered: Callable[[str, bool], bool],
        tell: Callable[[str], None],
        goals: UnfinishedGoals,
    ) -> None:
        """Prepare without connecting.

        Args:
            wire: function that returns a new, closed transport to the bridge.
            owes: function that returns whether the robot still owes an action's cancellation.
            answered: function that takes an action, and whether the robot has listed goals that it
                now cancels. It returns False if the answer does not prove that all goals end.
            tell: function that writes a line to the robot's log.
            goals: record that keeps which actions have an unanswered call.
        """
        self._wire = wire
        self._owes = owes
        self._answered = answered
        self._tell = tell
        self._goals = goals
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._room = asyncio.Semaphore(MAX_AT_ONCE)

    def begin(self, action: str) -> None:
        """Cancel all goals of an action from now on, until the robot answers."""
        self.drop(action)
        task = self._tasks[action] = asyncio.create_task(self._run(action))
        task.add_done_callback(lambda _: self._done(action, task))

    def drop(self, action: str) -> None:
        """End the cancellation of an action, because a new goal is being sent."""
        task = self._tasks.pop(action, None)
        if task is not None:
            task.cancel()

    async def end(self) -> None:
        """End all attempts and close their connections."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _done(self, action: str, task: asyncio.Task[None]) -> None:
        if self._tasks.get(action) is task:
            del self._tasks[action]

    async def _run(self, action: str) -> None:
        """Repeat attempts until the robot has answered."""
        wait_s, clock = FIRST_S, asyncio.get_running_loop().time
        while self._owes(action):
            next_s = clock() + wait_s
            async with self._room:
                fault = await self._attempt(action)
            if not fault or not self._owes(action):
                return
            shown = one_line(action)[:_SHOWN]
            self._tell(f"the cancellation of all goals of {shown} is repeated: {fault}")
            await asyncio.sleep(max(0.0, next_s - clock()))
            wait_s = longer(wait_s)

    async def _attempt(self, action: str) -> str:
        """Cancel all goals over a new connection; return why the goals may go on, or ""."""
        bridge = _Bridge(self._wire())
        late = f"no reply within {ATTEMPT_S:g} s"
        try:
            async with asyncio.timeout(ATTEMPT_S):
                await bridge.open()
                if not self._owes(action):
                    return ""
                self._goals.called(action)
                reply = await bridge.call(action + CANCEL_GOAL, {})
                self._goals.replied(action)
                why_not, is_cancelling = _outcome(reply)
                if why_not:
                    return why_not
                late = _GOES_ON
                why_not = await _rest(bridge, action + STATUS, is_cancelling=is_cancelling)
        except TimeoutError:
            return late
        except TransportError as fault:
            return str(fault)
        finally:
            await bridge.abort()
        if not why_not and not self._answered(action, is_cancelling):
            return _GOES_ON
        return why_not


class _Bridge:
    """The connection of one attempt."""

    def __init__(self, wire: CancelWire) -> None:
        self._wire = wire
        self._reader = OperationReader()

    async def open(self) -> None:
        """Connect, or raise `TransportError`."""
        await self._wire.open(ATTEMPT_S)

    async def abort(self) -> None:
        """Close the connection immediately; never raises."""
        await self._wire.abort()

    async def call(self, service: str, arguments: Mapping[str, object]) -> Mapping[str, Any]:
        """Call a service and return the response's operation."""
        number = f"call_service:{service}:{secrets.token_hex(8)}"
        call = {"op": "call_service", "id": number, "service": service, "args": arguments}
        await self._wire.send(encode_operation({**call, "timeout": ATTEMPT_S}))
        while True:
            said = await self._next("service_response")
            if said.get("id") == number:
                return said

    async def subscribe(self, topic: str, kind: str) -> None:
        """Subscribe to a topic; a latched message arrives soon."""
        await self._wire.send(encode_operation({"op": "subscribe", "topic": topic, "type": kind}))

    async def message(self, topic: str) -> Any:
        """Return the next message on a subscribed topic."""
        while True:
            said = await self._next("publish")
            if said.get("topic") == topic:
                return said.get("msg")

    async def _next(self, operation: str) -> Mapping[str, Any]:
        while True:
            frame = await self._wire.receive()
            with suppress(BadOperation):  # such frames prove nothing
                said = self._reader.read(frame)
                if said is not None and said["op"] == operation:
                    return said


async def _rest(bridge: _Bridge, topic: str, *, is_cancelling: bool) -> str:
    """Wait until an action has no active goal; return why that cannot be seen, or "".

    Args:
        bridge: connection over which all goals of the action were cancelled.
        topic: the topic with the states of the goals.
        is_cancelling: whether the robot has listed goals that it now cancels. Such an action has a
            status.
    """
    await bridge.subscribe(topic, STATUS_TYPE)
    try:
        async with asyncio.timeout(SILENT_S):
            said = await bridge.message(topic)
    except TimeoutError:
        is_shown = not is_cancelling and await _is_published(bridge, topic)
        return "" if is_shown else f"the bridge does not show {one_line(topic)[:_SHOWN]}"
    while shows_active(said):
        said = await bridge.message(topic)
    return ""


async def _is_published(bridge: _Bridge, topic: str) -> bool:
    """Return whether rosapi knows a publisher of a topic."""
    said = await bridge.call("/rosapi/publishers", {"topic": topic})
    values = said.get("values")
    if said.get("result") is False or not isinstance(values, Mapping):
        return False
    return bool(values.get("publishers"))


def _outcome(reply: Mapping[str, Any]) -> tuple[str, bool]:
    """Return why a reply is no answer, or "", and whether the robot lists goals that it cancels."""
    values = reply.get("values")
    if reply.get("result") is False or not isinstance(values, Mapping):
        text = one_line(values)[:_SHOWN] if isinstance(values, str) and values else "it failed"
        return f"the bridge reports: {text}", False
    code = values.get("return_code")
    if isinstance(code, bool) or not isinstance(code, int) or not 0 <= code <= _TERMINATED:
        return "the reply is invalid", False
    if code == _REJECTED:
        return "the robot refused", False
    return "", bool(values.get("goals_canceling"))
