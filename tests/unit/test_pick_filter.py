"""Values by name, from the two lists of a ROS message."""

from typing import Any

import pytest

from bench.rig.ros_messages import ROS2, plain
from urc.expressions import ExpressionError, compile_expression


def pick(text: str, **names: object) -> Any:
    return compile_expression(text).evaluate(names)


def test_joints_are_in_the_wanted_order_whatever_order_the_robot_uses() -> None:
    """A JointState of rosbags, in the alphabetical order of some joint_state_broadcasters."""
    made = ROS2.types
    header = made["std_msgs/msg/Header"](
        stamp=made["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id=""
    )
    names = ["elbow", "lift", "pan"]
    state = plain(
        made["sensor_msgs/msg/JointState"](
            header=header, name=names, position=[1.0, 2.0, 3.0], velocity=[], effort=[]
        )
    )
    wanted = ["pan", "lift", "elbow"]
    given = {"p": state["position"], "v": state["velocity"], "n": state["name"], "w": wanted}
    assert pick("p | pick(n, w)", **given) == [3.0, 2.0, 1.0]
    assert pick("v | pick(n, w)", **given) == [None, None, None]


def test_one_name_gives_one_value() -> None:
    assert pick("[1, 2] | pick(['a', 'b'], 'b')") == 2
    assert pick("[1, 2] | pick(['a', 'b'], 'c')") is None
    assert pick("[1] | pick(['a', 'b'], ['b', 'a'])") == [None, 1]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1 | pick(['a'], 'a')", "expected a list, found 1"),
        ("[1] | pick('a', 'a')", "expected a list, found 'a'"),
        ("[1] | pick([2], 'a')", "'pick' needs a list of names as text"),
        ("[1] | pick(['a'], 7)", "expected a list, found 7"),
        ("[1] | pick(['a'], [7])", "expected text, found 7"),
        ("many | pick(['a'], 'a')", "'pick' takes at most 4096 names"),
    ],
)
def test_other_values_are_refused_with_one_line(text: str, told: str) -> None:
    with pytest.raises(ExpressionError, match=told):
        pick(text, many=[0] * 4097)
