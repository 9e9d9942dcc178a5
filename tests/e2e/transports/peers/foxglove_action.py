"""A ROS 2 action behind the server of the Foxglove SDK, for tests; rosbags writes its messages.

foxglove_bridge offers the hidden services of an action like this if it runs with
``include_hidden: true``. It lists the fields of a goal next to the goal's id; the definitions of
ROS 2 have them in a field of their own. The bytes are the same.
"""

import threading
import time
from dataclasses import dataclass, field
from typing import Any, Final

from foxglove import Channel, MessageSchema, Schema, Service, ServiceRequest, ServiceSchema
from foxglove.websocket import ConnectionGraph
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.e2e.transports.peers.foxglove import FoxgloveRobot

__all__ = ["ACCEPTED", "REJECTED", "TERMINATED", "UNKNOWN", "RouteAction", "Goal"]

ACCEPTED, REJECTED, UNKNOWN, TERMINATED = range(4)
EXECUTING, SUCCEEDED, CANCELED, ABORTED = 2, 4, 5, 6
STATUS_TYPE: Final = "action_msgs/msg/GoalStatusArray"
WAIT_S = 60.0
KIND: Final = "nav2_msgs/action/FollowWaypoints"
PARTS: Final = {
    "Goal": "uint32 number_of_loops\nuint32 goal_index\ngeometry_msgs/PoseStamped[] poses",
    "Result": "nav2_msgs/MissedWaypoint[] missed_waypoints",
    "Feedback": "uint32 current_waypoint",
}
"""The parts of nav2_msgs/action/FollowWaypoints in ROS 2 Jazzy."""
ID: Final = "unique_identifier_msgs/UUID goal_id\n"
TYPES: Final = {
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid",
    "nav2_msgs/msg/MissedWaypoint": (
        "uint32 index\ngeometry_msgs/PoseStamped goal\nuint16 error_code"
    ),
    **{f"nav2_msgs/msg/FollowWaypoints_{part}": text for part, text in PARTS.items()},
    "nav2_msgs/msg/FollowWaypoints_SendGoal_Request": ID + "nav2_msgs/FollowWaypoints_Goal goal",
    "nav2_msgs/msg/FollowWaypoints_SendGoal_Response": (
        "bool accepted\nbuiltin_interfaces/Time stamp"
    ),
    "nav2_msgs/msg/FollowWaypoints_GetResult_Request": ID,
    "nav2_msgs/msg/FollowWaypoints_GetResult_Response": (
        "int8 status\nnav2_msgs/FollowWaypoints_Result result"
    ),
    "nav2_msgs/msg/FollowWaypoints_FeedbackMessage": (
        ID + "nav2_msgs/FollowWaypoints_Feedback feedback"
    ),
    "action_msgs/msg/GoalInfo": ID + "builtin_interfaces/Time stamp",
    "action_msgs/msg/CancelGoal_Request": "action_msgs/GoalInfo goal_info",
    "action_msgs/msg/CancelGoal_Response": (
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling"
    ),
}
FLAT: Final = {
    "FollowWaypoints_SendGoal_Request": ID + PARTS["Goal"],
    "FollowWaypoints_GetResult_Response": "int8 status\n" + PARTS["Result"],
    "FollowWaypoints_FeedbackMessage": ID + PARTS["Feedback"],
}
"""Definitions as foxglove_bridge announces them, without the dependencies."""


def _store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in TYPES.items():
        if name not in store.types:
            store.register(get_types_from_msg(text, name))
    return store


STORE: Final = _store()


@dataclass
class Goal:
    """A goal that the action has accepted."""

    request: Any
    status: int = 0
    ended: threading.Event = field(default_factory=threading.Event)


class RouteAction:
    """The action of one robot."""

    def __init__(
        self, robot: FoxgloveRobot, name: str = "/follow_waypoints", *, is_flat: bool = True
    ) -> None:
        """Offer the action; `is_flat` selects the definitions of foxglove_bridge."""
        self._robot = robot
        self._name = name
        self._is_flat = is_flat
        self._feedback: Channel | None = None
        self.goals: dict[str, Goal] = {}
        self.accepts = True
        self.refuses = False
        """Whether the robot refuses every cancellation."""
        self.missed: list[int] = []
        self.cancels: list[tuple[str, int]] = []
        """Goal id and return code of each cancellation; the id of all goals is zero."""
        self.breaks = False
        """Whether the call fails that sends a goal, although the robot follows the goal."""
        self.hides = False
        """Whether the robot reports success for cancellations, but ends no goal, as rclpy can."""
        self.forgets = 0
        """Number of further cancellations by id that arrive before their goal, as after a delay."""
        text = str(STORE.generate_msgdef(STATUS_TYPE, ros_version=2)[0])
        robot.offer_topic(f"{name}/_action/status", STATUS_TYPE, text)
        graph = ConnectionGraph()
        graph.set_published_topic(f"{name}/_action/status", ["/robot"])
        robot.server.publish_connection_graph(graph)
        self._offer("send_goal", KIND + "_SendGoal", self._send_goal)
        self._offer("get_result", KIND + "_GetResult", self._get_result)
        self._offer("cancel_goal", "action_msgs/srv/CancelGoal", self._cancel_goal)

    @property
    def running(self) -> list[str]:
        return [one for one, goal in self.goals.items() if not goal.status]

    def finish(self, goal: str, status: int = SUCCEEDED) -> None:
        """End a goal."""
        self.goals[goal].status = status
        self._publish_status()
        self.goals[goal].ended.set()

    def end_all(self) -> None:
        """End all goals, so that no thread waits."""
        for goal in self.running:
            self.finish(goal, ABORTED)

    def _publish_status(self) -> None:
        """Latch the states of all goals, as the server of an action does."""
        kinds = STORE.types
        stamp = kinds["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
        listed = [
            kinds["action_msgs/msg/GoalStatus"](
                goal_info=kinds["action_msgs/msg/GoalInfo"](
                    goal_id=_uuid(bytes.fromhex(one)), stamp=stamp
                ),
                status=goal.status or EXECUTING,
            )
            for one, goal in list(self.goals.items())
        ]
        message = kinds[STATUS_TYPE](status_list=listed)
        self._robot.latch(f"{self._name}/_action/status", _packed(message, STATUS_TYPE))

    def publish_feedback(self, waypoint: int) -> None:
        """Publish the progress of the route."""
        name = "FollowWaypoints_FeedbackMessage"
        if self._feedback is None:
            schema = Schema(
                name=f"nav2_msgs/action/{name}", encoding="ros2msg", data=self._text(name)
            )
            self._feedback = Channel(
                f"{self._name}/_action/feedback",
                message_encoding="cdr",
                schema=schema,
                context=self._robot.context,
            )
        inner = _made("FollowWaypoints_Feedback", current_waypoint=waypoint)
        message = _made(name, goal_id=_uuid(bytes(16)), feedback=inner)
        self._feedback.log(_packed(message, f"nav2_msgs/msg/{name}"), log_time=time.time_ns())

    # -- services, each call in a thread of its own

    def _send_goal(self, data: bytes) -> bytes:
        name = "nav2_msgs/msg/FollowWaypoints_SendGoal_Request"
        request = STORE.deserialize_cdr(data, name)
        if self.accepts:
            self.goals[bytes(request.goal_id.uuid).hex()] = Goal(request.goal)
            self._publish_status()
        if self.breaks:
            raise TimeoutError("the call took too long")
        stamp = STORE.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
        name = "FollowWaypoints_SendGoal_Response"
        return _packed(_made(name, accepted=self.accepts, stamp=stamp), f"nav2_msgs/msg/{name}")

    def _get_result(self, data: bytes) -> bytes:
        request = STORE.deserialize_cdr(data, "nav2_msgs/msg/FollowWaypoints_GetResult_Request")
        goal = self.goals[bytes(request.goal_id.uuid).hex()]
        goal.ended.wait(WAIT_S)
        poses = goal.request.poses
        missed = [
            _made("MissedWaypoint", index=one, goal=poses[one], error_code=3) for one in self.missed
        ]
        result = _made("FollowWaypoints_Result", missed_waypoints=missed)
        name = "FollowWaypoints_GetResult_Response"
        return _packed(_made(name, status=goal.status, result=result), f"nav2_msgs/msg/{name}")

    def _cancel_goal(self, data: bytes) -> bytes:
        """As rclcpp does: a zero id and a zero time mean all goals."""
        request = STORE.deserialize_cdr(data, "action_msgs/msg/CancelGoal_Request").goal_info
        wanted = bytes(request.goal_id.uuid).hex()
        is_zero = not request.stamp.sec and not request.stamp.nanosec
        assert is_zero, "a time would cancel other goals"
        code = ACCEPTED
        if not int(wanted, 16):
            ending = self.running
            code = ACCEPTED if ending else UNKNOWN
        elif self.forgets:
            self.forgets -= 1
            ending, code = [], UNKNOWN
        else:
            known = self.goals.get(wanted)
            ending = [wanted] if wanted in self.running else []
            code = UNKNOWN if known is None else ACCEPTED if ending else TERMINATED
        if self.refuses:
            code, ending = REJECTED, []
        if self.hides:
            code, ending = ACCEPTED, []
        self.cancels.append((wanted, code))
        for goal in ending:
            self.finish(goal, CANCELED)
        stamp = STORE.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
        infos = [
            STORE.types["action_msgs/msg/GoalInfo"](goal_id=_uuid(bytes.fromhex(one)), stamp=stamp)
            for one in ending
        ]
        response = STORE.types["action_msgs/msg/CancelGoal_Response"](
            return_code=code, goals_canceling=infos
        )
        return _packed(response, "action_msgs/msg/CancelGoal_Response")

    def _offer(self, service: str, kind: str, handler: Any) -> None:
        package, _, name = kind.rpartition("/")
        parts = []
        for part in ("Request", "Response"):
            text = self._text(f"{name}_{part}", package.partition("/")[0])
            schema = Schema(name=f"{kind}_{part}", encoding="ros2msg", data=text)
            parts.append(MessageSchema(encoding="cdr", schema=schema))

        def answer(request: ServiceRequest) -> bytes:
            return bytes(handler(request.payload))

        described = ServiceSchema(name=kind, request=parts[0], response=parts[1])
        offered = Service(name=f"{self._name}/_action/{service}", schema=described, handler=answer)
        self._robot.server.add_services([offered])

    def _text(self, name: str, package: str = "nav2_msgs") -> bytes:
        """Return the text of a definition, with the definitions that it needs."""
        whole = str(STORE.generate_msgdef(f"{package}/msg/{name}", ros_version=2)[0])
        if self._is_flat and name in FLAT:
            _, line, rest = whole.partition("=" * 80)
            whole = f"{FLAT[name]}\n{line}{rest}"
        return whole.encode()


def _made(name: str, **fields: Any) -> Any:
    return STORE.types[f"nav2_msgs/msg/{name}"](**fields)


def _uuid(data: bytes) -> Any:
    import numpy as np

    return STORE.types["unique_identifier_msgs/msg/UUID"](uuid=np.frombuffer(data, dtype=np.uint8))


def _packed(message: Any, name: str) -> bytes:
    return bytes(STORE.serialize_cdr(message, name))
