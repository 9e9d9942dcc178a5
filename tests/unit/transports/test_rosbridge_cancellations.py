"""The cancellation of all goals over rosbridge: which replies and states prove that none goes on.

The states are messages of action_msgs, whose definitions come with the rosbags library.
"""

import asyncio
import json
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from urc.model.payload import Payload
from urc.transports.ros import rosbridge_cancellations
from urc.transports.ros.goals import UnfinishedGoals
from urc.transports.ros.rosbridge_cancellations import ActionCancellations

pytestmark = pytest.mark.anyio

TYPES = get_typestore(Stores.ROS2_HUMBLE).types
GOAL = {"goal_id": {"uuid": [7] * 16}, "stamp": {"sec": 0, "nanosec": 0}}
EXECUTING, CANCELING, ENDED = (
    TYPES["action_msgs/msg/GoalStatus"].STATUS_EXECUTING,  # type: ignore[attr-defined] # made at run time
    TYPES["action_msgs/msg/GoalStatus"].STATUS_CANCELING,  # type: ignore[attr-defined] # made at run time
    TYPES["action_msgs/msg/GoalStatus"].STATUS_CANCELED,  # type: ignore[attr-defined] # made at run time
)


def status(*states: int) -> dict[str, Any]:
    """Return the states of an action's goals as rosbridge sends them."""
    uuid, info = TYPES["unique_identifier_msgs/msg/UUID"], TYPES["action_msgs/msg/GoalInfo"]
    stamp, one = TYPES["builtin_interfaces/msg/Time"], TYPES["action_msgs/msg/GoalStatus"]
    array = TYPES["action_msgs/msg/GoalStatusArray"]
    goal = info(goal_id=uuid(uuid=np.full(16, 7, np.uint8)), stamp=stamp(sec=1, nanosec=2))
    listed = array(status_list=[one(goal_info=goal, status=state) for state in states])
    found: dict[str, Any] = json.loads(
        json.dumps(asdict(listed), default=lambda some: some.tolist())
    )
    found.pop("__msgtype__", None)
    return found


class FakeBridge:
    """Answers like a bridge, on any number of connections."""

    def __init__(
        self, reply: dict[str, Any], states: list[Any], publishers: list[str] | None
    ) -> None:
        self.reply, self.states, self.publishers = reply, states, publishers
        self.calls = 0
        self.topics: list[tuple[str, str]] = []

    def connect(self) -> "FakeWire":
        return FakeWire(self)


class FakeWire:
    """One connection to a `FakeBridge`."""

    def __init__(self, bridge: FakeBridge) -> None:
        self._bridge = bridge
        self._out: asyncio.Queue[bytes] = asyncio.Queue()

    async def open(self, timeout_s: float) -> None:
        """Connect at once."""

    async def abort(self) -> None:
        """Close at once."""

    async def receive(self) -> bytes:
        return await self._out.get()

    async def send(self, data: Payload) -> None:
        assert isinstance(data, bytes)
        said, bridge = json.loads(data), self._bridge
        if said["op"] == "subscribe":
            bridge.topics.append((said["topic"], said["type"]))
            for one in bridge.states:
                self._write({"op": "publish", "topic": said["topic"], "msg": one})
            return
        is_publishers = said["service"] == "/rosapi/publishers"
        bridge.calls += not is_publishers
        values = {"publishers": bridge.publishers} if is_publishers else bridge.reply
        is_ok = not is_publishers or bridge.publishers is not None
        answer = {"op": "service_response", "id": said["id"], "service": said["service"]}
        self._write({**answer, "values": values if is_ok else "no rosapi", "result": is_ok})

    def _write(self, operation: dict[str, Any]) -> None:
        self._out.put_nowait(json.dumps(operation).encode())


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rosbridge_cancellations, "SILENT_S", 0.05)
    monkeypatch.setattr(rosbridge_cancellations, "ATTEMPT_S", 0.3)
    monkeypatch.setattr(rosbridge_cancellations, "FIRST_S", 0.02)


EMPTY = {"return_code": 0, "goals_canceling": []}
LISTED = {"return_code": 0, "goals_canceling": [GOAL]}
ENDS = {
    "no goal": (EMPTY, [{"status_list": []}], None),
    "ended goals": (EMPTY, [status(ENDED, ENDED)], None),
    "a goal that ends": (LISTED, [status(CANCELING), status(ENDED)], None),
    "an action without goals": (EMPTY, [], ["/robot"]),
}
GOES_ON = {
    "a refusal by rclpy": (EMPTY, [status(EXECUTING)], ["/robot"], "still follows a goal"),
    "one of two goals": (LISTED, [status(ENDED, EXECUTING)], ["/robot"], "still follows a goal"),
    "a goal that does not end": (LISTED, [status(CANCELING)], ["/robot"], "still follows a goal"),
    "a topic without a publisher": (EMPTY, [], [], "does not show /dock/_action/status"),
    "a bridge without rosapi": (EMPTY, [], None, "does not show /dock/_action/status"),
    "a status that is withheld": (LISTED, [], ["/robot"], "does not show /dock/_action/status"),
    "an invalid status": (EMPTY, [{"status_list": [None]}], ["/robot"], "still follows a goal"),
}


async def test_the_status_is_subscribed_with_its_type() -> None:
    bridge = FakeBridge(EMPTY, [{"status_list": []}], None)
    await cancelled(bridge, lambda answers, told: bool(answers))
    assert bridge.topics == [("/dock/_action/status", "action_msgs/msg/GoalStatusArray")]


@pytest.mark.parametrize("case", ENDS)
async def test_a_cancellation_is_answered_when_no_goal_is_active(case: str) -> None:
    reply, states, publishers = ENDS[case]
    bridge = FakeBridge(reply, states, publishers)
    answers, told = await cancelled(bridge, lambda answers, told: bool(answers))
    assert (answers, told) == ([("/dock", reply is LISTED)], [])
    assert bridge.calls == 1


@pytest.mark.parametrize("case", GOES_ON)
async def test_a_cancellation_is_repeated_and_reported_while_a_goal_may_go_on(case: str) -> None:
    reply, states, publishers, fault = GOES_ON[case]
    bridge = FakeBridge(reply, states, publishers)
    answers, told = await cancelled(bridge, lambda answers, told: bridge.calls >= 2)
    assert answers == []
    assert fault in told[0]


async def cancelled(
    bridge: FakeBridge, is_over: Callable[[list[tuple[str, bool]], list[str]], bool]
) -> tuple[list[tuple[str, bool]], list[str]]:
    """Cancel the goals of /dock; return the answers, and the lines for the robot's log."""
    answers: list[tuple[str, bool]] = []
    told: list[str] = []

    def answered(action: str, is_cancelling: bool) -> bool:
        answers.append((action, is_cancelling))
        return True

    goals = UnfinishedGoals()
    work = ActionCancellations(
        bridge.connect, lambda action: not answers, answered, told.append, goals
    )
    work.begin("/dock")
    try:
        end_s = time.monotonic() + 10
        while not is_over(answers, told):
            assert time.monotonic() < end_s
            await asyncio.sleep(0.01)
    finally:
        await work.end()
    return answers, told
