"""Over the Foxglove protocol, the cancellation of all goals is answered when the status shows it.

rosbags writes the states, as messages of action_msgs.
"""

import json
import random

import pytest

from bench.rig.ros_messages import plain
from tests.e2e.transports.peers.foxglove_action import STORE
from tests.unit.transports.foxglove_bridge import (
    ALL,
    CANCEL,
    CHANNEL,
    INFO,
    STATUS,
    Bridge,
    answer,
    code,
    status,
)
from urc.transports.base import NOTICE
from urc.transports.ros.foxglove_topics import TopicWish
from urc.transports.ros.goal_status import bytes_show_active, shows_active
from urc.transports.ros.goals import UnfinishedGoals

ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(1, 7)
LISTED, EMPTY, NONE = answer(0, [INFO]), answer(0, []), code(2)
GRAPH = {"op": "serverInfo", "capabilities": ["connectionGraph"]}


def publishers(*nodes: str) -> dict[str, object]:
    """Return a report of the nodes that publish the status."""
    published = [{"name": STATUS, "publisherIds": list(nodes)}]
    return {"op": "connectionGraphUpdate", "publishedTopics": published}


class Robot:
    """A robot with goals of other programs, and the record of URC's cancellations."""

    def __init__(self, states: bytes | None, reply: bytes, wishes: tuple[TopicWish, ...] = ()):
        self.goals = UnfinishedGoals()
        self.bridge = Bridge(self.goals, wishes=wishes)
        self.bridge.states = states
        self.reply = reply

    def stop(self, *, shows_status: bool = True) -> "Robot":
        """Cancel all goals, and answer the first call."""
        self.bridge.offer(shows_status=shows_status)
        self.bridge.session.perform(CANCEL)
        self.answer()
        return self

    def answer(self) -> None:
        ((name, call),) = self.bridge.cancelled()
        assert name == ALL
        self.bridge.reply(call, self.reply)

    @property
    def is_stopped(self) -> bool:
        return not self.goals.owes("/dock")

    def notices(self) -> list[object]:
        return [one.body for one in self.bridge.told() if one.verb == NOTICE]


@pytest.mark.parametrize("reply", [LISTED, EMPTY, NONE], ids=["listed", "empty", "none"])
@pytest.mark.parametrize("states", [(), (SUCCEEDED,), (CANCELED, ABORTED, CANCELED)])
def test_a_status_without_active_goals_answers_at_once(
    reply: bytes, states: tuple[int, ...]
) -> None:
    robot = Robot(status(*states), reply).stop()
    assert robot.is_stopped
    assert robot.bridge.status_calls == []
    robot.bridge.advance(60)
    assert robot.bridge.cancelled() == []
    assert robot.notices() == []


@pytest.mark.parametrize("reply", [LISTED, EMPTY, NONE], ids=["listed", "empty", "none"])
@pytest.mark.parametrize("active", [ACCEPTED, EXECUTING, CANCELING])
def test_a_goal_of_another_program_that_goes_on_keeps_stop_unconfirmed(
    reply: bytes, active: int
) -> None:
    """rclpy reports a refusal as success without goals; other goals take long to end."""
    robot = Robot(status(SUCCEEDED, active), reply).stop()
    times_s = []
    for _ in range(20):
        robot.bridge.advance(1)
        for _, call in robot.bridge.cancelled():
            robot.bridge.reply(call, reply)
            times_s.append(robot.bridge.now_s)
        assert not robot.is_stopped
    assert times_s == [1, 3, 7, 15]
    head = "the cancellation of all goals of /dock is repeated: "
    assert robot.notices() == [f"{head}the robot still follows a goal"]
    robot.bridge.states = status(SUCCEEDED, CANCELED)
    robot.bridge.show()
    assert robot.is_stopped, "as soon as the goal has ended"
    assert robot.bridge.status_calls == []


@pytest.mark.parametrize("has_graph", [False, True])
def test_the_silence_of_a_shown_status_means_that_there_was_never_a_goal(has_graph: bool) -> None:
    robot = Robot(None, NONE)
    if has_graph:
        robot.bridge.hear(GRAPH)
        robot.bridge.hear(publishers("/robot"))
    robot.stop()
    robot.bridge.advance(0.9)
    assert not robot.is_stopped, "the latched status may still arrive"
    robot.bridge.advance(0.2)
    assert robot.is_stopped
    robot.bridge.advance(60)
    assert robot.bridge.cancelled() == []


def test_a_status_that_arrives_late_counts() -> None:
    robot = Robot(None, EMPTY).stop()
    robot.bridge.advance(0.9)
    robot.bridge.states = status(EXECUTING)
    robot.bridge.show()
    robot.bridge.advance(0.5)
    assert not robot.is_stopped


@pytest.mark.parametrize("case", ["withheld", "listed", "not published", "refused", "other type"])
def test_a_silence_that_may_hide_a_goal_keeps_stop_unconfirmed(case: str) -> None:
    robot = Robot(None, LISTED if case == "listed" else EMPTY)
    if case == "not published":
        robot.bridge.hear(GRAPH)
        robot.bridge.hear(publishers())
    if case == "other type":
        robot.bridge.show_topic("std_msgs/msg/String")
    robot.stop(shows_status=case not in ("withheld", "other type"))
    if case == "refused":
        text = f"Channel {CHANNEL} is not available; ignoring subscription"
        robot.bridge.hear({"op": "status", "level": 2, "message": text})
    robot.bridge.advance(3)
    assert not robot.is_stopped
    head = "the cancellation of all goals of /dock is repeated: "
    assert f"{head}the bridge does not show {STATUS}" in robot.notices()


def test_a_topic_that_disappears_proves_nothing() -> None:
    robot = Robot(None, EMPTY).stop()
    robot.bridge.hear({"op": "unadvertise", "channelIds": [CHANNEL]})
    robot.bridge.advance(5)
    assert not robot.is_stopped


def test_the_drivers_own_subscription_to_the_status_is_used() -> None:
    """A bridge refuses a second subscription of a client to the same channel."""
    robot = Robot(status(EXECUTING), EMPTY, (TopicWish(STATUS),))
    robot.bridge.show_topic()
    robot.bridge.session.reconcile()
    robot.bridge.take()
    (driver,) = robot.bridge.status_calls
    robot.stop(shows_status=False)
    robot.bridge.advance(0.5)
    assert not robot.is_stopped
    assert robot.bridge.status_calls == [driver]
    robot.bridge.states = status(CANCELED)
    robot.bridge.show()
    assert robot.is_stopped
    robot.bridge.session.perform(CANCEL)
    robot.answer()
    assert robot.is_stopped, "its newest message counts"
    assert robot.bridge.status_calls == [driver]


def test_a_new_goal_and_a_reset_end_the_watch() -> None:
    robot = Robot(status(EXECUTING), EMPTY).stop()
    assert len(robot.bridge.status_calls) == 1
    robot.bridge.session.drop_cancellation("/dock")
    robot.bridge.take()
    assert robot.bridge.status_calls == []
    robot.bridge.session.perform(CANCEL)
    robot.answer()
    robot.bridge.start()
    assert robot.bridge.status_calls == []
    assert robot.goals.record.dropped == ("/dock",)


def test_states_are_read_from_bytes_as_rosbags_writes_them() -> None:
    chance = random.Random(5)  # noqa: S311 - a test
    types, name = STORE.types, "action_msgs/msg/GoalStatusArray"
    for _ in range(500):
        states = [chance.choice((0, 4, 5, 6, *range(7))) for _ in range(chance.randrange(5))]
        goals = [types["action_msgs/msg/GoalStatus"](goal_info=INFO, status=one) for one in states]
        message = types[name](status_list=goals)
        expected = shows_active({"status_list": [{"status": one} for one in states]})
        assert expected == any(one in (1, 2, 3) for one in states)
        for is_little in (False, True):
            data = bytes(STORE.serialize_cdr(message, name, little_endian=is_little))
            assert bytes_show_active(data, "cdr") == expected
            for size in range(len(data) - 1 if states else 8):
                assert bytes_show_active(data[:size], "cdr"), "a part does not show the end"
        assert (
            bytes_show_active(json.dumps(plain(message), default=list).encode(), "json") == expected
        )
    for wrong in (b"", b"{", b"[]", b'{"status_list": [7]}'):
        assert bytes_show_active(wrong, "json")
    assert bytes_show_active(status(SUCCEEDED)[:-1] + b"\x09", "cdr"), "an unknown state"
