"""A ROS 2 robot on Zenoh, as a separate program: ``python -m … PORT DISTRO``.

The wheel provides the router, the publishers and the subscribers; rosbags encodes the messages. The
program publishes odometry, a map for late joiners and an unknown type, and prints all it receives.
"""

import json
import math
import sys
import threading
import time
from typing import Any

import numpy as np
import zenoh
from rosbags.typesys import Stores, get_typestore
from zenoh.ext import (
    CacheConfig,
    Int64,
    declare_advanced_publisher,
    z_deserialize,
    z_serialize,
)

STORE = get_typestore(Stores.ROS2_JAZZY)
GID = bytes(range(16))
TREE = "tf2_msgs/msg/TFMessage"


def hashed(name: str, distro: str) -> str:
    return "TypeHashNotSupported" if distro == "humble" else STORE.hash_rihs01(name)


def dds(name: str) -> str:
    package, _, base = name.split("/")
    return f"{package}::msg::dds_::{base}_"


def say(**told: object) -> None:
    sys.stdout.write(json.dumps(told) + "\n")
    sys.stdout.flush()


def header() -> Any:
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](sec=12, nanosec=34)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id="odom")


def odometry(x: float) -> bytes:
    types = STORE.types
    zero = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=x, y=0.0, z=0.0),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    message = types["nav_msgs/msg/Odometry"](
        header=header(),
        child_frame_id="base_link",
        pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
        twist=types["geometry_msgs/msg/TwistWithCovariance"](
            twist=types["geometry_msgs/msg/Twist"](linear=zero, angular=zero),
            covariance=np.zeros(36),
        ),
    )
    return bytes(STORE.serialize_cdr(message, "nav_msgs/msg/Odometry"))


def points() -> bytes:
    """Return 100 points in big-endian order, with padding after each row of 25."""
    types = STORE.types
    places = np.zeros(
        (4, 26), dtype=[("x", ">f4"), ("y", ">f4"), ("z", ">f4"), ("intensity", ">u2")]
    )
    places["x"] = np.arange(4)[:, None]
    places["y"] = np.arange(26)
    places["intensity"] = 7
    codes = {"x": 7, "y": 7, "z": 7, "intensity": 4}
    fields = [
        types["sensor_msgs/msg/PointField"](name, 4 * at, code, 1)
        for at, (name, code) in enumerate(codes.items())
    ]
    message = types["sensor_msgs/msg/PointCloud2"](
        header(), 4, 25, fields, True, 14, 26 * 14, places.view(np.uint8).reshape(-1), True
    )
    return bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/PointCloud2"))


def transform(parent: str, child: str, x: float, yaw: float = 0.0) -> bytes:
    types = STORE.types
    z, w = math.sin(yaw / 2), math.cos(yaw / 2)
    stamped = types["geometry_msgs/msg/TransformStamped"](
        header=types["std_msgs/msg/Header"](header().stamp, frame_id=parent),
        child_frame_id=child,
        transform=types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0),
            rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=z, w=w),
        ),
    )
    return bytes(STORE.serialize_cdr(types[TREE](transforms=[stamped]), TREE))


class Robot:
    """Publishers, subscriptions and tokens, named as rmw_zenoh names them."""

    def __init__(self, session: Any, distro: str) -> None:
        self.session, self.distro = session, distro
        self._zid = str(session.zid())
        self._count = 0
        self._kept: list[Any] = []

    def token(self, kind: str, topic: str, name: str, qos: str, own: str = "") -> str:
        """Declare a token; return the topic's key."""
        self._count += 1
        found = own or hashed(name, self.distro)
        mangled = f"/{topic}".replace("/", "%")
        self._kept.append(self.session.liveliness().declare_token(
            f"@ros2_lv/0/{self._zid}/0/{self._count}/{kind}/%/%/robot/{mangled}/{dds(name)}/"
            f"{found}/{qos}"
        ))  # fmt: skip
        return f"0/{topic}/{dds(name)}/{found}"

    def told(self, topic: str, name: str, own: str = "") -> None:
        """Print each message on a topic."""
        key = self.token("MS", topic, name, "::,10:,:,:,,", own)

        def heard(sample: Any) -> None:
            number, time_ns, gid = z_deserialize(tuple[Int64, Int64, bytes], sample.attachment)
            data = sample.payload.to_bytes()
            message = STORE.deserialize_cdr(data, name)
            said = {"kind": "heard", "topic": topic, "number": int(number), "gid": gid.hex()}
            say(**said, age_s=time.time() - time_ns / 1e9, message=shown(message), cdr=data.hex())

        self._kept.append(self.session.declare_subscriber(key, zenoh.handlers.Callback(heard)))

    def graph(self) -> None:
        """Print each token in the domain, except the robot's own."""

        def seen(sample: Any) -> None:
            key = str(sample.key_expr)
            if self._zid not in key:
                say(kind="token" if sample.kind == zenoh.SampleKind.PUT else "gone", key=key)

        self._kept.append(self.session.liveliness().declare_subscriber(
            "@ros2_lv/0/**", zenoh.handlers.Callback(seen), history=True
        ))  # fmt: skip


def shown(message: Any) -> Any:
    if hasattr(message, "__dataclass_fields__"):
        names = [name for name in message.__dataclass_fields__ if name[0] != "_"]
        return {name: shown(getattr(message, name)) for name in names}
    return message if isinstance(message, str | int | float | bool) else str(message)


def main() -> None:
    port, distro = sys.argv[1:]
    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "timestamping": {"enabled": True},
    }
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
    robot = Robot(session, distro)
    odom = robot.token("MP", "odom", "nav_msgs/msg/Odometry", "2::,5:,:,:,,")
    chatter = robot.token("MP", "robot1/chatter", "std_msgs/msg/String", "::,7:,:,:,,")
    odd = robot.token("MP", "odd", "std_msgs/msg/Int32", "::,7:,:,:,,", "RIHS01_" + "0" * 64)
    cloud = robot.token("MP", "points", "sensor_msgs/msg/PointCloud2", "2::,5:,:,:,,")
    robot.told("cmd_vel", "geometry_msgs/msg/Twist")
    robot.told("cmd_stamped", "geometry_msgs/msg/TwistStamped")
    robot.told("other", "std_msgs/msg/Int32", "RIHS01_" + "0" * 64)
    kept = declare_advanced_publisher(
        session,
        robot.token("MP", "robot1/map_name", "std_msgs/msg/String", ":1:,1:,:,:,,"),
        cache=CacheConfig(1),
        publisher_detection=True,
    )
    text = STORE.types["std_msgs/msg/String"]
    told = z_serialize((Int64(1), Int64(time.time_ns()), GID))
    kept.put(bytes(STORE.serialize_cdr(text(data="kept"), "std_msgs/msg/String")), attachment=told)
    fixed = declare_advanced_publisher(
        session,
        robot.token("MP", "tf_static", TREE, ":1:,1:,:,:,,"),
        cache=CacheConfig(1),
        publisher_detection=True,
    )
    fixed.put(transform("base_link", "laser", 0.5, math.pi / 2), attachment=told)
    moving = robot.token("MP", "tf", TREE, "::,100:,:,:,,")
    robot.graph()
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    say(kind="ready")
    count = 0
    while not ended.wait(0.02):
        count += 1
        told = z_serialize((Int64(count), Int64(time.time_ns()), GID))
        session.put(odom, odometry(count / 100), attachment=told)
        word = bytes(STORE.serialize_cdr(text(data=f"hello {count}"), "std_msgs/msg/String"))
        session.put(chatter, word, attachment=told)
        session.put(cloud, points(), attachment=told)
        # Two programs, whose messages alternate: localisation and the base.
        session.put(moving, transform("map", "odom", 10.0, math.pi / 2), attachment=told)
        session.put(moving, transform("odom", "base_link", 2.0), attachment=told)
        session.put(odd, b"\0\1\0\0\1\0\0\0", attachment=told)


if __name__ == "__main__":
    main()
