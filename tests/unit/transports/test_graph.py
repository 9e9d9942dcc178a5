"""Faults of how a ROS system's topics are used, each in one line, once."""

import pytest

from urc.transports.ros.graph import TopicGraph, version_of

TYPES = {"/odom": "nav_msgs/msg/Odometry", "/cmd_vel": "geometry_msgs/msg/TwistStamped"}


def graph(ros: int | None = None) -> tuple[TopicGraph, list[str]]:
    told: list[str] = []
    return TopicGraph(told.append, ros), told


def test_a_topic_without_a_publisher_is_told_once() -> None:
    """The feedback of an action is no topic of its own in ROS 2."""
    known, told = graph()
    for _ in range(2):
        known.learn(TYPES)
        known.subscribed({"/odom": "nav_msgs/Odometry", "/lidar": "", "/dock/feedback": ""})
    assert told == ["nothing publishes /lidar"]


def test_a_topic_of_another_type_is_told() -> None:
    """From Jazzy on it is the commonest fault: Twist into a topic of TwistStamped."""
    known, told = graph(2)
    known.learn(TYPES)
    known.subscribed({"/odom": "sensor_msgs/Imu"})
    assert known.publishes("/cmd_vel", "geometry_msgs/Twist")
    assert told == [
        "/odom carries nav_msgs/Odometry, not sensor_msgs/Imu",
        "/cmd_vel takes geometry_msgs/TwistStamped, not geometry_msgs/Twist",
    ]


def test_a_topic_without_a_subscriber_is_told() -> None:
    """It is asked about at the first message of a connection, and not again."""
    known, told = graph()
    known.learn(TYPES)
    assert known.publishes("/nobody", "geometry_msgs/Twist")
    assert not known.publishes("/nobody", "geometry_msgs/Twist")
    known.subscribers("/nobody", [])
    known.subscribers("/cmd_vel", ["/base"])
    assert told == ["nothing subscribes to /nobody: its messages have no effect"]
    known.learn(TYPES)
    assert known.publishes("/nobody", "geometry_msgs/Twist"), "a new connection is asked again"


@pytest.mark.parametrize(
    ("types", "version"),
    [(["std_msgs/String", ""], 1), (["std_msgs/msg/String"], 2), ([""], None), ([], None)],
)
def test_the_version_of_ros_shows_in_its_types(types: list[str], version: int | None) -> None:
    assert version_of(types) == version


def test_another_version_than_the_documents_is_told() -> None:
    known, told = graph(2)
    known.learn({"/odom": "nav_msgs/Odometry"})
    assert told == ["this bridge is ROS 1: write 'version: 1' or 'version: auto'"]
