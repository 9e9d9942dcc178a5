"""What a driver and its ROS robot disagree about, and what is not known."""

from pathlib import Path
from typing import Any

import pytest

from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.topic_check import TopicUse, find_mismatches, topic_uses
from urc.transports.ros.topic_list import TopicList, TopicRow

ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  base: { type: string, default: /base }
  imu: { type: string, required: false }
transports: { ros: { type: ros, host: 127.0.0.1, version: 2 }, other: { type: udp, host: 127.0.0.1, port: 7 } }
signals: { x: {}, y: {}, lean: {} }
messages:
  odom: { from: ros, subscribe: { topic: "{{ settings.base }}/odom", type: nav_msgs/Odometry }, json: { x: pose.x, y: pose.y, _z: pose.z } }
  imu: { from: ros, subscribe: { topic: "{{ settings.imu }}", type: sensor_msgs/Imu }, json: { lean: a } }
commands:
  drive:
    to: ros
    args: { speed: { type: number, default: 0 } }
    send: { publish: { topic: "{{ settings.base }}/cmd_vel", type: geometry_msgs/Twist, stamped: true, json: { linear: { x: "{{ speed }}" } } } }
  say:
    to: ros
    args: { to: { type: string } }
    send: { publish: { topic: "{{ to }}", type: std_msgs/String, json: { data: hello } } }
  reset: { to: ros, send: { call: { service: /reset, type: std_srvs/Trigger, json: {} } } }
  blink: { to: other, send: blink }
"""  # noqa: E501
ODOM = TopicUse("ros", "/base/odom", "nav_msgs/Odometry", False, ("x", "y"))
DRIVE = TopicUse("ros", "/base/cmd_vel", "geometry_msgs/TwistStamped", True, ("drive",))


def test_the_uses_of_topics_follow_the_settings(tmp_path: Path) -> None:
    """A topic that is off, and one that depends on an argument, cannot be checked."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    driver = load_profile(str(file), built_in_catalog()).driver
    assert topic_uses(driver, {"base": "/base", "imu": ""}) == [ODOM, DRIVE]
    names = [one.topic for one in topic_uses(driver, {"base": "/b", "imu": "/imu"})]
    assert names == ["/b/odom", "/imu", "/b/cmd_vel"]


def codes(use: TopicUse, row: TopicRow, **how: Any) -> list[tuple[str, str, str]]:
    """Return the mismatches about one topic."""
    listed = TopicList((row,), 1, 2, True, False)._replace(**how)
    return [(code, found, wanted) for code, _, found, wanted in
            find_mismatches([use], {"ros": listed}, {"ros": 2})]  # fmt: skip


TWIST, STAMPED = ("geometry_msgs/msg/Twist",), ("geometry_msgs/msg/TwistStamped",)


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        (TopicRow("/base/cmd_vel", STAMPED, STAMPED, (), ("/base",)), []),
        (TopicRow("/base/cmd_vel", None, ("geometry_msgs/TwistStamped",), (), ("/base",)), []),
        (TopicRow("/base/cmd_vel", None, None, (), ()), [("no-subscriber", "", "")]),
        (TopicRow("/base/cmd_vel", STAMPED, STAMPED, (), ()), [("no-subscriber", "", "")]),
        (
            TopicRow("/base/cmd_vel", STAMPED, TWIST, ("/joy",), ("/base",)),
            [("takes-type", "geometry_msgs/Twist", "geometry_msgs/TwistStamped")],
        ),
        (TopicRow("/base/cmd_vel", TWIST, TWIST + STAMPED, None, None), []),
        (TopicRow("/base/cmd_vel"), []),
        (TopicRow("/other", None, None, (), ()), []),
    ],
)
def test_a_command_that_cannot_work_is_found(
    row: TopicRow, expected: list[tuple[str, str, str]]
) -> None:
    """And where the connection knows nothing, nothing is said."""
    assert codes(DRIVE, row) == expected


def test_a_signal_that_cannot_arrive_is_found() -> None:
    silent, odd = TopicRow("/base/odom", publishers=()), TopicRow("/base/odom", carries=TWIST)
    assert codes(ODOM, silent) == [("no-publisher", "", "")]
    assert codes(ODOM, odd) == [("carries-type", "geometry_msgs/Twist", "nav_msgs/Odometry")]
    assert codes(ODOM._replace(type=""), odd) == []
    for topic in ("/dock/feedback", "parameter:/base.rate"):
        assert codes(ODOM._replace(topic=topic), silent._replace(name=topic)) == []


def test_another_version_of_ros_explains_all_else() -> None:
    """Unless the version is unknown or the bridge cannot list topics."""
    row = TopicRow("/base/odom", carries=("nav_msgs/Odometry",), publishers=())
    assert codes(ODOM, row, version=1) == [("ros-version", "1", "2")]
    assert codes(ODOM, row, version=None) == [("no-publisher", "", "")]
    assert codes(ODOM, row, is_known=False) == []
    listed = TopicList((row,), 1, 1, True, False)
    assert not find_mismatches([ODOM], {}, {"ros": 2})
    (found,) = find_mismatches([ODOM], {"ros": listed}, {"ros": "auto"})
    assert found.code == "no-publisher"
