"""Poses from lists of positions and angles, against the constructors of rosbags."""

import math
from typing import Any

import pytest

from bench.rig.ros_messages import ROS2, plain
from urc.expressions import ExpressionError, compile_expression


def poses(text: str, **names: object) -> Any:
    return compile_expression(text).evaluate(names)


def test_each_position_has_its_angle() -> None:
    found = poses("xs | poses(ys, yaws)", xs=[1, 2.5], ys=[3, -4], yaws=[math.pi, -math.pi / 2])
    assert [(one["position"]["x"], one["position"]["y"]) for one in found] == [(1, 3), (2.5, -4)]
    angles = [compile_expression("q | yaw").evaluate({"q": one["orientation"]}) for one in found]
    assert angles == pytest.approx([math.pi, -math.pi / 2])


@pytest.mark.parametrize("yaws", ["", ", []", ", none"])
def test_without_angles_nothing_is_rotated(yaws: str) -> None:
    (found,) = poses(f"[1] | poses([2]{yaws})")
    assert found["orientation"] == {"x": 0, "y": 0, "z": 0, "w": 1}


def test_stamped_poses_have_all_fields_of_the_type_but_the_time() -> None:
    (found,) = poses("[1.0] | poses([2.0], [0.0], 'map')")
    made = ROS2.types
    zero = made["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    point = made["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=0.0)
    turn = made["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    header = made["std_msgs/msg/Header"](stamp=zero, frame_id="map")
    pose = made["geometry_msgs/msg/Pose"](position=point, orientation=turn)
    expected = plain(made["geometry_msgs/msg/PoseStamped"](header=header, pose=pose))
    del expected["header"]["stamp"]
    assert found == expected


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[1, 2] | poses([3])", "'poses' needs as many y and angles as x, found 2, 1, 2"),
        ("[1] | poses([3], [1, 2])", "found 1, 1, 2"),
        ("1 | poses([3])", "'poses' needs lists of numbers"),
        ("[1] | poses(['a'])", "'poses' needs lists of numbers"),
        ("[true] | poses([1])", "'poses' needs lists of numbers"),
        ("[1] | poses([1], [0], 7)", "'poses' needs the name of a frame as text"),
        ("many | poses(many)", "'poses' takes at most 4096 positions"),
        ("[wide] | poses([1])", "'poses' needs lists of numbers"),
    ],
)
def test_other_values_are_refused_with_one_line(text: str, told: str) -> None:
    with pytest.raises(ExpressionError, match=told):
        poses(text, many=[0] * 4097, wide=math.inf)
