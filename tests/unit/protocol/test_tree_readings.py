"""Signals in other coordinate frames, from the document to the samples of the engine."""

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bench.rig.ros_messages import ROS2
from tests.unit.protocol.test_transform_tree import stamped
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.model.values import Sample
from urc.protocol.engine import Engine
from urc.protocol.events import Samples, Violation
from urc.protocol.forms.topics import listened
from urc.runtime.registries import built_in_catalog

PROFILE = """
urc: 1
kind: robot
name: rover
settings:
  host: { type: host, default: 127.0.0.1 }
  map: { type: string, default: map, title: Map frame }
transports: { ros: { type: ros, via: auto, host: "{{ settings.host }}", version: 2 } }
signals:
  frames: { type: transform_tree, stale_after: 4s }
  odom_frame: { type: string }
  x: { unit: m, frame: "{{ odom_frame }}" }
  y: { unit: m, frame: "{{ odom_frame }}" }
  ranges: { type: array, unit: m, frame: laser }
  place: { type: array, size: 3, value: "[x, y, 0]", frame: "{{ settings.map }}", transform: pose }
  dots: { type: array, unit: m, value: "ranges | scan_points(0, 1.5707963267948966)", frame: map, transform: points }
  map_x: { unit: m, value: "(place | default([none, none, none]))[0]" }
messages:
  odometry:
    subscribe: { topic: /odom, type: nav_msgs/Odometry, throttle: 100ms, queue_length: 1 }
    json: { odom_frame: header.frame_id, x: pose.x, y: pose.y }
  scan:
    subscribe: { topic: /scan, type: sensor_msgs/LaserScan }
    json: { ranges: ranges }
  moving:
    subscribe: { topic: /tf, type: tf2_msgs/TFMessage, throttle: 500ms, queue_length: 1 }
    json: { frames: "@" }
  fixed:
    subscribe: { topic: /tf_static, type: tf2_msgs/TFMessage }
    json: { frames: "@" }
"""  # noqa: E501 - one line per signal, as in documents


class Robot:
    """An engine that is connected to a robot."""

    def __init__(self, tmp_path: Path, text: str = PROFILE) -> None:
        path = tmp_path / "rover.yaml"
        path.write_text(text)
        self.driver = load_profile(path, built_in_catalog()).driver
        self.engine = Engine(self.driver, {"host": "127.0.0.1", "map": "map"}, is_compiled=True)
        self.engine.tick(0)
        self.engine.start("ros", 0)

    def hear(self, topic: str, body: object, now: float) -> dict[str, Sample]:
        """Return the samples of a message, keyed by signal; a fault fails the test."""
        events = self.engine.receive("ros", Envelope("message", {"topic": topic}, body), now)
        assert not [one for one in events if isinstance(one, Violation)]
        return samples(events)

    def faults(self, topic: str, body: object, now: float) -> list[str]:
        events = self.engine.receive("ros", Envelope("message", {"topic": topic}, body), now)
        return [one.message for one in events if isinstance(one, Violation)]

    def tf(self, now: float, *transforms: dict[str, Any]) -> dict[str, Sample]:
        return self.hear("/tf", {"transforms": list(transforms)}, now)

    def odometry(self, now: float, x: float, y: float) -> dict[str, Sample]:
        body = {"header": {"frame_id": "odom"}, "pose": {"x": x, "y": y}}
        return self.hear("/odom", body, now)


def samples(events: list[Any]) -> dict[str, Sample]:
    return {
        one.signal: one for event in events if isinstance(event, Samples) for one in event.samples
    }


QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


def test_a_pose_in_odom_is_shown_on_the_map(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tf(1, stamped("map", "odom", (10, 20, 0), QUARTER))
    found = robot.odometry(1.1, 2, 1)
    assert found["place"].value == pytest.approx((9, 22, math.pi / 2))
    assert found["map_x"].value == pytest.approx(9)


def test_a_laser_scan_goes_through_static_transforms(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tf(1, stamped("map", "odom", (1, 0, 0)), stamped("odom", "base", (1, 0, 0), QUARTER))
    robot.hear("/tf_static", {"transforms": [stamped("base", "laser", (0.5, 0, 0.2))]}, 1.1)
    found = robot.hear("/scan", {"ranges": [1, None, 2, 0.0]}, 1.2)
    assert found["dots"].value == pytest.approx((2, 1.5, 2, -1.5))


def test_every_message_moves_the_pose_although_the_tree_is_sampled_rarely(tmp_path: Path) -> None:
    """The throttle of 500 ms holds back samples of the tree, not transforms."""
    robot = Robot(tmp_path)
    assert "frames" in robot.tf(1, stamped("map", "odom", (1, 0, 0)))
    assert robot.tf(1.1, stamped("map", "odom", (2, 0, 0))) == {}
    assert robot.odometry(1.15, 0, 0)["map_x"].value == 2
    assert robot.tf(1.2, stamped("map", "odom", (3, 0, 0))) == {}
    assert robot.engine.deadline == 1.5
    late = samples(robot.engine.tick(1.5))
    assert late["frames"].value["frames"][1]["age"] == pytest.approx(0.3)
    assert late["map_x"].value == 3
    assert late["frames"].time_s == 1.2
    assert robot.engine.deadline is None


def test_the_last_transforms_of_a_burst_are_shown_in_a_live_session(tmp_path: Path) -> None:
    """A link that knew of no short deadlines would not wake for the sample after a burst."""
    robot = Robot(tmp_path)
    robot.tf(1, stamped("map", "odom", (1, 0, 0)))
    robot.tf(1.45, stamped("map", "odom", (2, 0, 0)))
    assert robot.engine.deadline is not None
    assert robot.engine.deadline - 1.45 >= robot.engine.calm_s
    assert samples(robot.engine.tick(1.5))["frames"].value["frames"][1]["translation"][0] == 2


def test_the_bridge_never_throttles_transforms(tmp_path: Path) -> None:
    """Several programs publish on /tf; a throttle in the bridge would drop most of them."""
    topics = listened(Robot(tmp_path).driver, "ros", {"host": "", "map": "map"})
    assert topics["/tf"] == {"type": "tf2_msgs/TFMessage"}
    assert topics["/odom"]["throttle"] == 0.1


def test_a_pose_is_as_old_as_its_oldest_transform(tmp_path: Path) -> None:
    """Odometry goes on, but localisation has died: the place on the map must not look live."""
    robot = Robot(tmp_path)
    robot.tf(1, stamped("map", "odom"))
    for second in range(2, 9):
        robot.tf(float(second), stamped("odom", "base", sec=second))
        found = robot.odometry(float(second), 1, 1)
    # Transforms are stale after 4 s, odometry after 5 s; the pose after the shorter time.
    assert robot.driver.signals["place"].stale_after_s == 4
    assert found["place"].time_s == 1
    assert found["x"].time_s == 8


def test_a_place_is_unknown_while_the_frames_are_not_connected(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    assert "place" not in robot.odometry(0.5, 2, 1)
    robot.tf(1, stamped("odom", "base"))
    found = robot.odometry(1.1, 2, 1)
    assert found["place"].value is None
    assert found["map_x"].value is None
    robot.tf(2, stamped("map", "odom"))
    assert robot.odometry(2.1, 2, 1)["map_x"].value == 2


def test_a_message_without_a_frame_has_no_place(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tf(1, stamped("map", "odom"))
    body = {"header": {"frame_id": ""}, "pose": {"x": 1, "y": 2}}
    assert robot.hear("/odom", body, 1.1)["place"].value is None


def test_the_same_frame_needs_no_transform(tmp_path: Path) -> None:
    """A robot without localisation may publish its odometry in the frame of the map."""
    body = {"header": {"frame_id": "map"}, "pose": {"x": 1, "y": 2}}
    assert Robot(tmp_path).hear("/odom", body, 1)["place"].value == (1, 2, 0)


def test_a_reconnection_forgets_all_frames(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    robot.tf(1, stamped("map", "odom"))
    robot.engine.closed("ros", "gone", 2)
    robot.engine.start("ros", 3)
    assert "place" not in robot.odometry(3.1, 2, 1)
    robot.tf(4, stamped("map", "odom", (1, 0, 0)))
    assert robot.odometry(4.1, 2, 1)["map_x"].value == 3


def test_bad_transforms_are_faults_and_good_ones_count(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    body = {"transforms": [stamped("", "x"), stamped("map", "odom", (1, 0, 0))]}
    assert robot.faults("/tf", body, 1) == ["frames: '' is not the name of a frame"]
    assert robot.odometry(1.1, 0, 0)["map_x"].value == 1
    assert robot.faults("/tf", {"transforms": 5}, 2) == [
        "frames: the message has no list of transforms"
    ]


def test_the_value_can_be_recorded_and_sent_as_json(tmp_path: Path) -> None:
    value = Robot(tmp_path).tf(1, stamped("map", "odom", (1, 2, 0)))["frames"].value
    assert json.loads(json.dumps(value))["frames"][1]["translation"] == [1, 2, 0]


ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS1.register(
    get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
)
"""The types of ROS 1; rosbags knows its TFMessage only under the name tf/tfMessage."""


def ros_message(store: Any, transforms: list[dict[str, Any]], **more: Any) -> Any:
    """Return a TFMessage as an object of rosbags."""
    types = store.types
    made = []
    for one in transforms:
        stamp = types["builtin_interfaces/msg/Time"](one["header"]["stamp"]["sec"], 500_000_000)
        header = types["std_msgs/msg/Header"](
            stamp=stamp, frame_id=one["header"]["frame_id"], **more
        )
        move = types["geometry_msgs/msg/Vector3"](**one["transform"]["translation"])
        turn = types["geometry_msgs/msg/Quaternion"](**one["transform"]["rotation"])
        transform = types["geometry_msgs/msg/Transform"](move, turn)
        stamped_type = types["geometry_msgs/msg/TransformStamped"]
        made.append(stamped_type(header, one["child_frame_id"], transform))
    return types["tf2_msgs/msg/TFMessage"](made)


def announce(robot: Robot, store: Any, encoding: str) -> None:
    """Deliver the definition of the type, as foxglove_bridge announces it."""
    name, is_ros1 = "tf2_msgs/msg/TFMessage", encoding == "ros1"
    text = store.generate_msgdef(name, ros_version=1 if is_ros1 else 2)[0]
    said = {
        "topic": "/tf", "type": name, "encoding": encoding,
        "notation": "ros1msg" if is_ros1 else "ros2msg",
    }  # fmt: skip
    robot.engine.receive("ros", Envelope("definition", said, text), 0.5)


def binary(store: Any, transforms: list[dict[str, Any]], encoding: str) -> bytes:
    name = "tf2_msgs/msg/TFMessage"
    if encoding == "cdr":
        return bytes(store.serialize_cdr(ros_message(store, transforms), name))
    return bytes(store.serialize_ros1(ros_message(store, transforms, seq=7), name))


@pytest.mark.parametrize(("store", "encoding"), [(ROS2, "cdr"), (ROS1, "ros1")])
def test_binary_messages_of_rosbags_place_the_robot(
    tmp_path: Path, store: Any, encoding: str
) -> None:
    robot = Robot(tmp_path)
    announce(robot, store, encoding)
    transforms = [
        stamped("map", "odom", (10.0, 20.0, 0.0), QUARTER, sec=5),
        stamped("odom", "base_link", (2.0, 1.0, 0.5), (0.0, 0.0, 0.0, 1.0), sec=6),
    ]
    said = {"topic": "/tf", "encoding": encoding}
    body = binary(store, transforms, encoding)
    found = samples(robot.engine.receive("ros", Envelope("message", said, body), 1))
    row = found["frames"].value["frames"][1]
    assert (row["name"], row["translation"], row["stamp"]) == ("odom", (10, 20, 0), 5.5)
    assert robot.odometry(1.1, 2, 1)["place"].value == pytest.approx((9, 22, math.pi / 2))


def test_a_binary_flood_of_transforms_is_refused_before_it_is_read(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    announce(robot, ROS2, "cdr")
    turn = (0.0, 0.0, 0.0, 1.0)
    many = [stamped("map", f"f{at}", (0.0, 0.0, 0.0), turn, sec=1) for at in range(5000)]
    envelope = Envelope("message", {"topic": "/tf", "encoding": "cdr"}, binary(ROS2, many, "cdr"))
    events = robot.engine.receive("ros", envelope, 1)
    (fault,) = [one.message for one in events if isinstance(one, Violation)]
    assert "a message with 5000 transforms; the limit is 1000" in fault
    # Reading all of them takes 14 ms on the same computer.
    assert fastest(lambda: robot.engine.receive("ros", envelope, 1)) < 0.005


def fastest(call: Callable[[], object]) -> float:
    """Return the shortest time of several calls in seconds, because the computer may be busy."""
    times = []
    for _ in range(10):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def test_a_flood_of_transforms_costs_little(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    many = [stamped("map", f"f{at}") for at in range(5000)]
    assert robot.faults("/tf", {"transforms": many}, 1) == [
        "frames: a message with 5000 transforms; the limit is 1000"
    ]
    assert fastest(lambda: robot.faults("/tf", {"transforms": many}, 1)) < 0.005


def test_a_flood_of_new_frames_does_not_search_for_old_ones_again_and_again(
    tmp_path: Path,
) -> None:
    """Each of 500 rejected frames would otherwise search 500 frames, which takes 40 ms."""
    robot = Robot(tmp_path)
    many = {"transforms": [stamped("map", f"f{at}") for at in range(1000)]}
    faults = robot.faults("/tf", many, 1)
    assert faults[-1] == "frames: 497 more invalid transforms"
    assert fastest(lambda: robot.faults("/tf", many, 1)) < 0.02
