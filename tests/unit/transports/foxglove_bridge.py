"""A session with a bridge that offers the action /dock, for tests; rosbags writes its bytes."""

import asyncio
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.e2e.transports.peers.foxglove_action import STORE
from urc.model.payload import Envelope
from urc.protocol.ros.topic_codec import TopicCodec
from urc.transports.ros.foxglove_session import FoxgloveSession
from urc.transports.ros.foxglove_topics import TopicWish
from urc.transports.ros.goals import UnfinishedGoals
from urc.transports.ros.graph import TopicGraph
from urc.transports.topic_queue import TopicReceiveQueue

DOCK = Envelope("goal", {"action": "/dock", "id": 7, "stops": [0]}, {"speed": 0.5})
CANCEL = Envelope("cancel", {"action": "/dock"})
TEXTS = {
    "send_goal": ("unique_identifier_msgs/UUID goal_id\nfloat32 speed", "bool accepted"),
    "get_result": ("unique_identifier_msgs/UUID goal_id", "int8 status\nfloat32 way"),
    "cancel_goal": ("action_msgs/GoalInfo goal_info", "int8 return_code"),
}
STATUS = "/dock/_action/status"
CHANNEL = 3
UUID = "\n" + "=" * 80 + "\nMSG: unique_identifier_msgs/UUID\nuint8[16] uuid"


INFO = STORE.types["action_msgs/msg/GoalInfo"](
    goal_id=STORE.types["unique_identifier_msgs/msg/UUID"](uuid=np.ones(16, dtype=np.uint8)),
    stamp=STORE.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2),
)


def status(*states: int) -> bytes:
    """Return the states of an action's goals."""
    goal, array = (
        STORE.types[f"action_msgs/msg/{name}"] for name in ("GoalStatus", "GoalStatusArray")
    )
    listed = array(status_list=[goal(goal_info=INFO, status=state) for state in states])
    return bytes(STORE.serialize_cdr(listed, "action_msgs/msg/GoalStatusArray"))


class Bridge:
    """A session with a bridge that offers the action /dock, and what it was sent.

    The bridge sends the latched status of the action's goals to each new subscriber.
    """

    def __init__(
        self,
        goals: UnfinishedGoals | None = None,
        encoding: str = "cdr",
        wishes: tuple[TopicWish, ...] = (),
    ) -> None:
        self.states: bytes | None = status()
        """Latched status; None if the action has never had a goal."""
        self.status_calls: list[int] = []
        """Subscriptions to the status that have not ended."""
        self._frames: list[bytes] = []
        self.queue = TopicReceiveQueue()
        self.later: list[tuple[float, Callable[[], None]]] = []
        self.now_s = 0.0
        self.codec = TopicCodec()
        self.encoding = encoding
        self.session = FoxgloveSession(
            self.queue,
            wishes,
            TopicGraph(lambda _: None, 2),
            call_at=lambda at_s, work: self.later.append((at_s, work)),
            clock=lambda: self.now_s,
            published={},
            goals=goals,
            flush=self.take,
        )

    def take(self) -> None:
        """Receive what the session has written."""
        for frame, is_text in self.session.written():
            if not is_text:
                self._frames.append(frame)
                continue
            said = json.loads(frame)
            for number in said.get("subscriptionIds", ()):
                self.status_calls.remove(number)
            for one in said.get("subscriptions", ()):
                assert one["channelId"] == CHANNEL
                self.status_calls.append(one["id"])
                self.show()

    def show(self) -> None:
        """Send the status to its newest subscriber."""
        if self.states is not None and self.status_calls:
            head = struct.pack("<BIQ", 1, self.status_calls[-1], 0)
            self.session.arrived(head + self.states)

    def show_topic(self, kind: str = "action_msgs/msg/GoalStatusArray") -> None:
        """Announce the topic of the action's states."""
        channel = {"id": CHANNEL, "topic": STATUS, "encoding": "cdr", "schemaName": kind}
        self.hear({"op": "advertise", "channels": [channel | {"schema": ""}]})

    def offer(self, *names: str, shows_status: bool = True) -> "Bridge":
        if shows_status:
            self.show_topic()
        services = []
        for number, name in enumerate(names or TEXTS):
            parts = [
                {"encoding": self.encoding, "schemaName": f"a/action/Dock_{name}_{part}",
                 "schemaEncoding": "ros2msg", "schema": text + UUID}
                for part, text in zip(("Request", "Response"), TEXTS[name], strict=True)
            ]  # fmt: skip
            services.append(
                {"id": 10 + list(TEXTS).index(name), "name": f"/dock/_action/{name}",
                 "type": "a/action/Dock", "request": parts[0], "response": parts[1]}
            )  # fmt: skip
            assert number < 3
        self.hear({"op": "advertiseServices", "services": services})
        return self

    def advance(self, seconds: float) -> None:
        """Let time pass, and run what becomes due."""
        until_s = self.now_s + seconds
        while due := [one for one in self.later if one[0] <= until_s]:
            first = min(due, key=lambda one: one[0])
            self.later.remove(first)
            self.now_s = first[0]
            first[1]()
        self.now_s = until_s

    def hear(self, said: dict[str, Any]) -> None:
        self.session.arrived(json.dumps(said).encode())

    def reply(self, call: int, data: bytes) -> None:
        name = self.encoding.encode()
        self.session.arrived(struct.pack("<BIII", 3, 0, call, len(name)) + name + data)

    def sent(self) -> list[tuple[str, int, bytes]]:
        """Return service, call number and request of each call since the last time."""
        self.take()
        found, frames = [], self._frames
        self._frames = []
        for frame in frames:
            _, service, call, size = struct.unpack_from("<BIII", frame)
            found.append((list(TEXTS)[service - 10], call, frame[13 + size :]))
        return found

    def told(self) -> list[Envelope]:
        """Return what the engine has been told since the last time."""

        end = Envelope("end")
        self.queue.answer(end)

        async def take() -> list[Envelope]:
            found = []
            while (one := await self.queue.pop()) is not end:
                found.append(one)
            return found

        return asyncio.run(take())

    def encode(self) -> None:
        """Encode what came back unencoded, as the engine does."""
        for envelope in self.told():
            reply = self.codec.received(envelope).reply
            assert reply is not None, envelope
            self.session.perform(reply)

    def start(self) -> tuple[int, str]:
        """Send a goal; return the number of the call and the goal's id."""
        self.session.perform(DOCK)
        self.encode()
        ((name, call, data),) = self.sent()
        assert name == "send_goal"
        assert data[20:] == struct.pack("<f", 0.5)
        return call, data[4:20].hex()

    def cancelled(self) -> list[tuple[str, int]]:
        """Return the goal id and the call of each cancellation since the last time."""
        found = []
        for name, call, data in self.sent():
            if name != "cancel_goal":
                continue
            message = STORE.deserialize_cdr(data, "action_msgs/msg/CancelGoal_Request")
            assert message.goal_info.stamp.sec == message.goal_info.stamp.nanosec == 0
            found.append((bytes(message.goal_info.goal_id.uuid).hex(), call))
        return found


ALL = "0" * 32
YES = b"\0\1\0\0\1"
NO = b"\0\1\0\0\0"


def code(number: int) -> bytes:
    """Return the reply of rclcpp, which lists the goals that it now cancels."""
    return answer(number, [INFO] if number == 0 else [])


def answer(number: int, cancelling: list[Any]) -> bytes:
    name = "action_msgs/msg/CancelGoal_Response"
    said = STORE.types[name](return_code=number, goals_canceling=cancelling)
    return bytes(STORE.serialize_cdr(said, name))
