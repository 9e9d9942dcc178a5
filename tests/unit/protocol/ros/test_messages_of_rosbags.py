"""Messages in CDR and in the format of ROS 1, against the library rosbags.

rosbags makes random messages, and serializes and reads them. `./dev bench ros_messages --full`
repeats the comparison with 10 000 messages of each type.
"""

import random
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bench.rig.ros_messages import ROS1, ROS2, TYPES, RandomMessages, plain
from urc.protocol.ros.common_types import common_types
from urc.protocol.ros.definition import layout_of, plain_name
from urc.protocol.ros.msg_text import parse_msg
from urc.protocol.ros.read_source import build_read, read_safely
from urc.protocol.ros.wanted import ALL, Wanted, wanted_of
from urc.protocol.ros.write_source import Writer

EACH_TYPE = 5


@pytest.mark.parametrize("name", TYPES)
def test_messages_are_read_and_written_as_rosbags_does(name: str) -> None:
    layout = layout_of(name, parse_msg(name, ROS2.generate_msgdef(name, ros_version=2)[0]))
    reads = {order: build_read(layout, ALL, order=order) for order in "<>"}
    writer, source = Writer(layout), RandomMessages(ROS2, seed=7)
    for _ in range(EACH_TYPE):
        message = source.message(name)
        for order, read in reads.items():
            data = bytes(ROS2.serialize_cdr(message, name, little_endian=order == "<"))
            expected = plain(ROS2.deserialize_cdr(data, name))
            assert read_safely(read, data) == expected
        written = writer.write(expected).data
        assert plain(ROS2.deserialize_cdr(written, name)) == expected
        if "None" not in repr(expected):  # another number that is not finite becomes NaN
            assert written == bytes(ROS2.serialize_cdr(message, name))


@pytest.mark.parametrize("name", TYPES)
def test_a_reader_of_some_fields_finds_the_same_values(name: str) -> None:
    """The skipped parts change neither the values nor their places."""
    layout = layout_of(name, parse_msg(name, ROS2.generate_msgdef(name, ros_version=2)[0]))
    source, dice = RandomMessages(ROS2, seed=3), random.Random(3)  # noqa: S311
    whole = build_read(layout, ALL)
    for _ in range(EACH_TYPE):
        data = bytes(ROS2.serialize_cdr(source.message(name), name))
        expected = read_safely(whole, data)
        paths = dice.sample(sorted(_paths(expected)), k=min(3, len(_paths(expected))))
        wanted = wanted_of(tuple(path.split("/")) for path in paths)
        assert read_safely(build_read(layout, wanted), data) == _part(expected, wanted)


def _paths(value: Any, before: str = "") -> set[str]:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return _paths(value[0], f"{before}/*" if before else "*")
    if not isinstance(value, dict):
        return {before}
    found = {before} - {""}
    for name, inner in value.items():
        found |= _paths(inner, f"{before}/{name}" if before else name)
    return found


def _part(value: Any, wanted: Wanted) -> Any:
    if wanted is True or not isinstance(value, dict | list):
        return value
    assert isinstance(wanted, dict)
    if isinstance(value, list):
        return [_part(one, wanted["*"]) for one in value]
    return {name: _part(inner, wanted[name]) for name, inner in value.items() if name in wanted}


@pytest.mark.parametrize("name", [*TYPES[:4], "std_msgs/msg/Empty", "diagnostic_msgs/msg/KeyValue"])
def test_messages_of_ros_1(name: str) -> None:
    """The format has neither alignment nor a header, and a time has other names."""
    layout = layout_of(
        name, parse_msg(name, ROS1.generate_msgdef(name, ros_version=1)[0]), is_ros1=True
    )
    read, writer = build_read(layout, ALL, is_ros1=True), Writer(layout, is_ros1=True)
    source = RandomMessages(ROS1, seed=5)
    for _ in range(EACH_TYPE):
        message = source.message(name)
        data = bytes(ROS1.serialize_ros1(message, name))
        found = read_safely(read, data)
        if name != "std_msgs/msg/Empty":  # rosbags invents a field
            assert _as_ros2(found) == plain(ROS1.deserialize_ros1(data, name))
        if "None" not in repr(found):
            assert writer.write(found).data == data


def _as_ros2(value: Any) -> Any:
    if isinstance(value, dict):
        names = {"secs": "sec", "nsecs": "nanosec"} if value.keys() == {"secs", "nsecs"} else {}
        return {names.get(name, name): _as_ros2(inner) for name, inner in value.items()}
    return [_as_ros2(one) for one in value] if isinstance(value, list) else value


@pytest.mark.parametrize(("store", "is_ros1"), [(ROS2, False), (ROS1, True)])
def test_the_known_types_have_the_fields_of_rosbags(store: Any, is_ros1: bool) -> None:
    for name in common_types(is_ros1=is_ros1):
        full = name.replace("/", "/msg/")
        if full not in store.types:
            continue  # actionlib is ROS 1 alone, and actions are ROS 2 alone
        text = store.generate_msgdef(full, ros_version=1 if is_ros1 else 2)[0]
        expected = layout_of(full, parse_msg(full, text), is_ros1=is_ros1)
        found = layout_of(full, common_types(is_ros1=is_ros1), is_ros1=is_ros1)
        assert _shape(found) == _shape(expected), plain_name(name)


def test_a_joint_jog_is_written_as_rosbags_writes_it() -> None:
    """The fields are those of control_msgs/msg/JointJog.msg; rosbags knows no control_msgs."""
    name = "control_msgs/msg/JointJog"
    fields = "std_msgs/Header header\nstring[] joint_names\nfloat64[] displacements\n"
    fields += "float64[] velocities\nfloat64 duration\n"
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(fields, name))
    header = store.types["std_msgs/msg/Header"](
        stamp=store.types["builtin_interfaces/msg/Time"](sec=12, nanosec=34), frame_id="base_link"
    )
    message = store.types[name](
        header=header,
        joint_names=["elbow_joint", "wrist_1_joint"],
        displacements=np.array([]),
        velocities=np.array([0.1, -0.2]),
        duration=0.0,
    )
    given = {
        "header": {"stamp": {"sec": 12, "nanosec": 34}, "frame_id": "base_link"},
        "joint_names": ["elbow_joint", "wrist_1_joint"],
        "displacements": [],
        "velocities": [0.1, -0.2],
        "duration": 0,
    }
    writer = Writer(layout_of(name, common_types()))
    assert writer.write(given).data == bytes(store.serialize_cdr(message, name))


def _shape(layout: Any) -> Any:
    """Return a layout without default values, which rosbags does not keep."""
    return repr(layout).replace("default=1.0", "default=None")
