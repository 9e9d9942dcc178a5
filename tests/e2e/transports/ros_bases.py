"""The same mobile base behind each kind of ROS connection: rosbridge, foxglove and Zenoh.

The base publishes odometry, a laser scan, a picture, a battery and a map, and takes `TwistStamped`.
"""

import asyncio
import base64
import io
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from foxglove import Channel, Schema
from foxglove.websocket import ConnectionGraph
from PIL import Image
from rosbags.serde import SerdeError
from websockets.asyncio.client import connect

from bench.rig.ros_messages import ROS2, RandomMessages
from tests.e2e.ports import free_port
from tests.e2e.transports.peers.foxglove import FoxgloveRobot, definition
from tests.e2e.transports.peers.zenoh import other_program
from tests.e2e.transports.ros_zenoh_robot import TREE, transform
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.settings import resolve_settings
from urc.simulator.server import serve

__all__ = ["BASES", "Base", "CLOCK", "STAMPED", "messages", "open_base"]

BASES = ("rosbridge", "foxglove", "zenoh")
STAMPED = "geometry_msgs/msg/TwistStamped"
TOPICS = {
    "/odom": "nav_msgs/msg/Odometry",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/camera/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
    "/battery_state": "sensor_msgs/msg/BatteryState",
    "/map": "nav_msgs/msg/OccupancyGrid",
}
START_S = 30.0
CLOCK = (77, 5)
"""Seconds and nanoseconds of the base's simulated time, which stands still."""
_CLOCK = "rosgraph_msgs/msg/Clock"
EMULATED = """
urc: 1
kind: robot
name: rover
title: Rover
extends: generic-ros2
driver:
  params: { stamped: true, navigation: true, speed: 0.5, back: -0.5, turn: 1.0, right: -1.0, watchdog: none }
  overrides:
    tests: [{ name: a drive is a Twist, remove: true }]
    signals: { picture: { type: image } }
    messages:
      camera: { subscribe: { topic: /camera/image_raw/compressed, type: sensor_msgs/CompressedImage }, json: { picture: data } }
simulator:
  ros:
    - { name: clock, every: 100ms, send: { publish: { topic: /clock, type: rosgraph_msgs/Clock, json: { clock: { sec: 77, nanosec: 5 } } } } }
    - { name: camera, every: 500ms, send: { publish: { topic: /camera/image_raw/compressed, json: { format: jpeg, data: JPEG } } } }
"""  # noqa: E501


def picture() -> bytes:
    """Return a small picture as JPEG."""
    made = io.BytesIO()
    Image.new("RGB", (64, 48), "green").save(made, "JPEG")
    return made.getvalue()


def messages(prefix: str = "") -> dict[str, tuple[str, bytes]]:
    """Return the type and the CDR bytes of one message of each topic.

    With a `prefix` such as ``/robot1``, all topics but the map have it. The transform from map to
    odom is then a message, too, and the simulated time `CLOCK`.
    """
    random = RandomMessages(ROS2, seed=5)
    made: dict[str, Any] = {topic: random.message(kind) for topic, kind in TOPICS.items()}
    pose = made["/odom"].pose.pose
    pose.position.x = 1.5
    turn = pose.orientation
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, 0.0, 1.0
    scan = made["/scan"]
    scan.angle_min, scan.angle_increment = -1.0, 0.1
    scan.ranges = np.full(20, 2.0, np.float32)
    made["/battery_state"].percentage = 0.5
    grid = made["/map"]
    grid.info.width, grid.info.height, grid.info.resolution = 2, 2, 0.5
    grid.data = np.array([0, 0, 100, -1], np.int8)
    grid.info.origin.orientation = turn
    image = made["/camera/image_raw/compressed"]
    image.format, image.data = "jpeg", np.frombuffer(picture(), np.uint8)
    said = {
        topic: (kind, bytes(ROS2.serialize_cdr(made[topic], kind)))
        for topic, kind in TOPICS.items()
    }
    if not prefix:
        return said
    said["/tf"] = (TREE, transform("map", "odom", 10.0))
    time = ROS2.types["builtin_interfaces/msg/Time"](sec=CLOCK[0], nanosec=CLOCK[1])
    clock = ROS2.types[_CLOCK](clock=time)
    said["/clock"] = (_CLOCK, bytes(ROS2.serialize_cdr(clock, _CLOCK)))
    shared = ("/map", "/clock")
    return {topic if topic in shared else prefix + topic: one for topic, one in said.items()}


class Base:
    """A running base, with the forward speeds that it was told, in m/s."""

    def __init__(self, line: str, port: int) -> None:
        self.line, self.port = line, port
        self.speeds: list[float] = []
        self.stamps: list[tuple[int, int]] = []
        """Time in each command, as seconds and nanoseconds."""
        self.unread = 0
        """Number of commands of another type."""

    def hear(self, data: bytes) -> None:
        """Note the speed in a command that arrived as CDR."""
        try:
            message: Any = ROS2.deserialize_cdr(data, STAMPED)
        except SerdeError:
            self.unread += 1
        else:
            self.speeds.append(message.twist.linear.x)
            stamp = message.header.stamp
            self.stamps.append((stamp.sec, stamp.nanosec))


@asynccontextmanager
async def open_base(line: str, folder: Path, prefix: str = "") -> AsyncIterator[Base]:
    """Run a base behind the connection `line`, which is one of `BASES`; see `messages`."""
    opened = {"rosbridge": _emulated, "foxglove": _foxglove, "zenoh": _zenoh}[line]
    async with opened(folder, prefix) as base:
        yield base


@asynccontextmanager
async def _foxglove(folder: Path, prefix: str) -> AsyncIterator[Base]:
    robot = FoxgloveRobot()
    base = Base("foxglove", robot.port)
    schema = Schema(name=STAMPED, encoding="ros2msg", data=definition(STAMPED).encode())
    driven = f"{prefix}/cmd_vel"
    channel = Channel(driven, message_encoding="cdr", schema=schema, context=robot.context)
    graph = ConnectionGraph()
    graph.set_subscribed_topic(driven, ["/base"])
    said = messages(prefix)
    for topic in said:
        graph.set_published_topic(topic, ["/base"])

    async def publish() -> None:
        count = 0
        while True:
            for topic, (kind, data) in said.items():
                if topic.endswith(("/odom", "/scan")) or count % 10 == 0:
                    robot.publish(topic, kind, data)
            if count % 10 == 0:
                robot.server.publish_connection_graph(graph)
            while robot.heard:
                topic, data = robot.heard.pop(0)
                if topic == driven:
                    base.hear(data)
            count += 1
            await asyncio.sleep(0.05)

    task = asyncio.create_task(publish())
    try:
        yield base
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        channel.close()
        robot.close()


@asynccontextmanager
async def _zenoh(folder: Path, prefix: str) -> AsyncIterator[Base]:
    base = Base("zenoh", free_port())
    module = "tests.e2e.transports.ros_zenoh_base"
    async with other_program(module, str(base.port), prefix) as process:
        assert process.stdout is not None
        output = process.stdout
        async with asyncio.timeout(START_S):
            while json.loads(await output.readline())["kind"] != "ready":
                pass

        async def listen() -> None:
            while line := await output.readline():
                said = json.loads(line)
                if said["kind"] == "heard":
                    base.hear(bytes.fromhex(said["cdr"]))

        task = asyncio.create_task(listen())
        try:
            yield base
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task


@asynccontextmanager
async def _emulated(folder: Path, prefix: str) -> AsyncIterator[Base]:
    file = folder / "emulated-rover.yaml"
    file.write_text(EMULATED.replace("JPEG", base64.b64encode(picture()).decode()))
    profile = load_profile(str(file), built_in_catalog())
    base = Base("rosbridge", free_port())
    given = {"port": str(base.port), "navigation": "true"}
    given |= {"namespace": prefix, "map": "/map"} if prefix else {}
    settings, _ = resolve_settings(profile, given)
    async with serve(profile, settings), connect(f"ws://127.0.0.1:{base.port}") as socket:
        driven = f"{prefix}/cmd_vel"
        said = {"op": "subscribe", "topic": driven, "type": STAMPED}
        await socket.send(json.dumps(said))

        async def listen() -> None:
            async for frame in socket:
                told = json.loads(frame)
                if told.get("topic") == driven:
                    base.speeds.append(told["msg"]["twist"]["linear"]["x"])
                    stamp = told["msg"]["header"]["stamp"]
                    if stamp != "now":  # the bridge itself inserts its time
                        base.stamps.append((stamp["sec"], stamp["nanosec"]))

        task = asyncio.create_task(listen())
        try:
            yield base
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
