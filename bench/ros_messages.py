"""Compare URC's reading of ROS messages with the library rosbags, in time and in values.

URC reads five fields of an Odometry message; rosbags always reads the whole message. With
``--full``, URC reads 10 000 random messages of each type in both byte orders. The values must equal
those from rosbags.
"""

import sys
from collections.abc import Sequence
from time import perf_counter

from bench.harness import Goal, Result, compare
from bench.rig.ros_messages import ROS2, TYPES, RandomMessages, plain
from urc.protocol.ros.definition import Record, layout_of
from urc.protocol.ros.msg_text import parse_msg
from urc.protocol.ros.read_source import build_read, read_safely
from urc.protocol.ros.wanted import ALL, wanted_of

__all__ = ["run"]

ODOMETRY = "nav_msgs/msg/Odometry"
FIELDS = (
    "pose.pose.position.x",
    "pose.pose.position.y",
    "pose.pose.orientation.z",
    "pose.pose.orientation.w",
    "twist.twist.linear.x",
)
MESSAGES, MESSAGES_IF_FULL = 100, 10_000
READS = 2000


def run(*, full: bool) -> Sequence[Result]:
    """Compare the times, and the values of random messages."""
    count = MESSAGES_IF_FULL if full else MESSAGES
    wrong = sum(_differences(name, count) for name in TYPES)
    values = Result(
        name=f"ros_messages: {len(TYPES)} types x {count} messages that differ from rosbags",
        ratio=float(wrong),
        goal=0.0,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=1.0,
        rounds=count,
    )
    return [_time(), values]


def _layout(name: str) -> Record:
    return layout_of(name, parse_msg(name, ROS2.generate_msgdef(name, ros_version=2)[0]))


def _differences(name: str, count: int) -> int:
    layout, source, wrong = _layout(name), RandomMessages(ROS2, seed=1), 0
    reads = {order: build_read(layout, ALL, order=order) for order in "<>"}
    for _ in range(count):
        message = source.message(name)
        for order, read in reads.items():
            data = bytes(ROS2.serialize_cdr(message, name, little_endian=order == "<"))
            wrong += read_safely(read, data) != plain(ROS2.deserialize_cdr(data, name))
    print(f"{name}: {count} messages, {wrong} differ", file=sys.stderr)
    return wrong


def _time() -> Result:
    wanted = wanted_of(tuple(field.split(".")) for field in FIELDS)
    read = build_read(_layout(ODOMETRY), wanted)
    data = bytes(ROS2.serialize_cdr(RandomMessages(ROS2, seed=2).message(ODOMETRY), ODOMETRY))

    def theirs() -> float:
        began = perf_counter()
        for _ in range(READS):
            ROS2.deserialize_cdr(data, ODOMETRY)
        return perf_counter() - began

    def ours() -> float:
        began = perf_counter()
        for _ in range(READS):
            read_safely(read, data)
        return perf_counter() - began

    return compare(Goal("ros_messages: five fields of Odometry / rosbags", 0.35), theirs, ours)
