"""Hashes of ROS 2 types agree with those of ROS 2 and of another implementation."""

import pytest
from rosbags.typesys import Stores, get_typestore

from urc.protocol.ros.definition import BadDefinition
from urc.protocol.ros.known_types import check_known, known_hash, known_types
from urc.protocol.ros.msg_text import parse_msg
from urc.protocol.ros.type_hash import type_hash

PUBLISHED = {
    # From the design document of rmw_zenoh, and the files share/PACKAGE/msg/*.json of Jazzy.
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "std_msgs/msg/Header": "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
    "std_msgs/msg/Int32": "b6578ded3c58c626cfe8d1a6fb6e04f706f97e9f03d2727c9ff4e74b1cef0deb",
    "std_msgs/msg/Float64": "705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
    "std_msgs/msg/Char": "3ad2d04dd29ba19d04b16659afa3ccaedd691914b02a64e82e252f2fa6a586a9",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "sensor_msgs/msg/CompressedImage":
        "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "sensor_msgs/msg/NavSatFix": "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "rosgraph_msgs/msg/Clock": "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
}  # fmt: skip
OTHERWISE = {"std_msgs/msg/Char"}
"""rosbags gives `char` a number of its own; ROS 2 turns it into `uint8`, as published above."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_hash_is_the_published_one(name: str) -> None:
    assert known_hash(name) == f"RIHS01_{PUBLISHED[name]}"


@pytest.mark.parametrize("store", [Stores.ROS2_JAZZY, Stores.ROS2_KILTED], ids=str)
def test_all_known_types_have_the_hashes_of_rosbags(store: Stores) -> None:
    """Equal hashes mean equal definitions: names, types and order of all fields."""
    other = get_typestore(store)
    names = {f"{name.replace('/', '/msg/')}" for name in known_types()}
    both = sorted((names & other.fielddefs.keys()) - OTHERWISE)
    assert len(both) > 110
    assert [name for name in both if known_hash(name) != other.hash_rihs01(name)] == []


def test_arrays_and_bounds_count() -> None:
    """By the definitions of rosbags: fixed, bounded and unbounded, of numbers and of types."""
    text = (
        "uint8[3] a\nuint8[<=5] b\nuint8[] c\nstring d\nstring[] e\nbyte f\nbool g 1\n"
        "int32 SIX=6\nInner[2] h\nInner[<=4] i\nInner[] j\nfloat32 k\n"
        "================================================================================\n"
        "MSG: test_msgs/Inner\nint64 x\n"
    )
    other = get_typestore(Stores.EMPTY)
    from rosbags.typesys import get_types_from_msg

    other.register(get_types_from_msg(text, "test_msgs/msg/Outer"))
    definitions = parse_msg("test_msgs/Outer", text)
    assert type_hash("test_msgs/Outer", definitions) == other.hash_rihs01("test_msgs/msg/Outer")


def test_unknown_and_different_types_are_told() -> None:
    """A type is read by its own definition or not at all."""
    check_known("std_msgs/msg/String", known_hash("std_msgs/String"))
    check_known("std_msgs/msg/String", "TypeHashNotSupported")
    with pytest.raises(BadDefinition, match="does not know the type my_msgs/msg/Own"):
        check_known("my_msgs/msg/Own", "RIHS01_00")
    with pytest.raises(BadDefinition, match="definition of std_msgs/msg/String differs"):
        check_known("std_msgs/msg/String", "RIHS01_00")
    assert known_hash("my_msgs/Own") == ""
