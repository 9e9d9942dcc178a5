"""A ROS 2 robot on one line: ``python -m bench.peers.ros_streams LINE`` prints ``ready PORT``.

LINE is ``rosbridge``, ``foxglove`` or ``zenoh``. On each line, the robot publishes the same
messages, made with rosbags. All bytes pass through a forwarder, which counts the bytes to the
client. The program answers each line on standard input with ``bytes COUNT``, and ends with its
standard input. It imports nothing from URC.
"""

import asyncio
import base64
import io
import json
import math
import socket
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

import cbor2
import foxglove
import numpy
import zenoh
from PIL import Image, ImageDraw
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from zenoh.ext import Int64, z_serialize

from bench.rig.ros_messages import ROS2, plain

RATES = {"odom": 50, "imu": 100, "scan": 10, "front": 15, "rear": 15}
"""Messages per second of each topic."""
KINDS = {
    "odom": "nav_msgs/msg/Odometry",
    "imu": "sensor_msgs/msg/Imu",
    "scan": "sensor_msgs/msg/LaserScan",
    "front": "sensor_msgs/msg/CompressedImage",
    "rear": "sensor_msgs/msg/CompressedImage",
}
PICTURE = (640, 480)
GRAIN, QUALITY = 11, 75
"""Noise amplitude and JPEG quality, chosen so that each image has about 47 kB."""
RAYS = 720
GID = bytes(range(16))
TYPES = ROS2.types
Send = Callable[[str, int], Awaitable[None]]
"""Sends a topic's message with the given number."""


def header(sec: int = 1_700_000_000) -> Any:
    """Return a header with a constant time."""
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=sec, nanosec=123_456_789)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id="odom")


def vector(x: float, y: float, z: float) -> Any:
    """Return a three-dimensional vector."""
    return TYPES["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)


def quaternion(yaw: float) -> Any:
    """Return the quaternion of a rotation about the z axis, in radians."""
    w, z = math.cos(yaw / 2), math.sin(yaw / 2)
    return TYPES["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=z, w=w)


def odometry(turn: float) -> Any:
    """Return the odometry at an angle on a circle with a radius of three metres."""
    point = TYPES["geometry_msgs/msg/Point"](x=3 * math.cos(turn), y=3 * math.sin(turn), z=0.0)
    pose = TYPES["geometry_msgs/msg/Pose"](position=point, orientation=quaternion(turn))
    twist = TYPES["geometry_msgs/msg/Twist"](linear=vector(0.5, 0, 0), angular=vector(0, 0, 0.17))
    some = numpy.full(36, 0.0123)
    return TYPES["nav_msgs/msg/Odometry"](
        header=header(),
        child_frame_id="base_link",
        pose=TYPES["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=some),
        twist=TYPES["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=some),
    )


def imu(turn: float) -> Any:
    """Return an IMU message with the given yaw in radians."""
    some = numpy.full(9, 0.0123)
    return TYPES["sensor_msgs/msg/Imu"](
        header=header(),
        orientation=quaternion(turn),
        orientation_covariance=some,
        angular_velocity=vector(0.1, math.sin(turn), 0.3),
        angular_velocity_covariance=some,
        linear_acceleration=vector(math.cos(turn), 0.2, 9.81),
        linear_acceleration_covariance=some,
    )


def scan(turn: float) -> Any:
    """Return a laser scan of a round room, not from its centre."""
    angles = numpy.linspace(-math.pi, math.pi, RAYS, endpoint=False)
    ranges = (4 + numpy.sin(angles + turn)).astype(numpy.float32)
    return TYPES["sensor_msgs/msg/LaserScan"](
        header=header(),
        angle_min=-math.pi,
        angle_max=math.pi,
        angle_increment=2 * math.pi / RAYS,
        time_increment=0.0,
        scan_time=0.1,
        range_min=0.1,
        range_max=12.0,
        ranges=ranges,
        intensities=numpy.zeros(0, numpy.float32),
    )


def picture(turn: float) -> Any:
    """Return a JPEG with noise, and a disc in a place that depends on `turn`."""
    chance = numpy.random.default_rng(int(turn * 1000))  # noise, the same in each run
    noise = chance.integers(128 - GRAIN, 128 + GRAIN, PICTURE[0] * PICTURE[1], numpy.uint8)
    image = Image.frombytes("L", PICTURE, noise.tobytes()).convert("RGB")
    left = 260 + 200 * math.cos(turn)
    ImageDraw.Draw(image).ellipse((left, 180, left + 120, 300), fill="orange")
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    data = numpy.frombuffer(file.getvalue(), numpy.uint8)
    # With a constant time of this century, the images would count as repetitions of an old one.
    return TYPES["sensor_msgs/msg/CompressedImage"](header=header(sec=1), format="jpeg", data=data)


MAKES = {"odom": odometry, "imu": imu, "scan": scan, "front": picture, "rear": picture}
MESSAGES = {
    topic: [make(2 * math.pi * number / 15) for number in range(15)]
    for topic, make in MAKES.items()
}
CDR = {
    topic: [bytes(ROS2.serialize_cdr(one, KINDS[topic])) for one in made]
    for topic, made in MESSAGES.items()
}


def as_json(topic: str, message: Any) -> str:
    """Return an operation of rosbridge with a message as JSON."""

    def text(value: bytes) -> str:
        return base64.b64encode(value).decode()

    told = {"op": "publish", "topic": f"/{topic}", "msg": plain(message)}
    return json.dumps(told, default=text)


def as_cbor(topic: str, message: Any) -> bytes:
    """Return an operation of rosbridge as CBOR; arrays have the tags of RFC 8746."""

    def tagged(value: Any, field: Any = None) -> Any:
        if isinstance(value, dict):
            return {name: tagged(one, getattr(field, name)) for name, one in value.items()}
        if isinstance(field, numpy.ndarray) and field.dtype.kind == "f":
            return cbor2.CBORTag(85 if field.itemsize == 4 else 86, field.tobytes())
        return value

    told = {"op": "publish", "topic": f"/{topic}", "msg": tagged(plain(message), message)}
    return cbor2.dumps(told)


class Forwarder:
    """Forwards connections to the robot's own port, and counts the bytes to the clients."""

    def __init__(self, port: int) -> None:
        self.count = 0
        self._port = port
        self._tasks: set[asyncio.Task[None]] = set()

    async def meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Forward one connection in both directions."""
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self._port)
        inward = asyncio.create_task(self._pump(reader, inner_writer, counted=False))
        self._tasks.add(inward)
        await self._pump(inner_reader, writer, counted=True)

    async def _pump(
        self, source: asyncio.StreamReader, target: asyncio.StreamWriter, *, counted: bool
    ) -> None:
        with suppress(ConnectionError):
            while data := await source.read(1 << 18):
                self.count += len(data) * counted
                target.write(data)
                await target.drain()
        target.close()


@asynccontextmanager
async def on_rosbridge(port: int) -> AsyncIterator[Send]:
    """Serve the protocol of rosbridge; each subscription chooses JSON or CBOR."""
    frames: dict[str, dict[str, list[Any]]] = {
        "none": {topic: [as_json(topic, one) for one in made] for topic, made in MESSAGES.items()},
        "cbor": {topic: [as_cbor(topic, one) for one in made] for topic, made in MESSAGES.items()},
    }
    listening: dict[str, dict[ServerConnection, str]] = {topic: {} for topic in RATES}

    async def meet(line: ServerConnection) -> None:
        async for text in line:
            asked = json.loads(text)
            topic = asked.get("topic", "").strip("/")
            if asked["op"] == "subscribe" and topic in listening:
                listening[topic][line] = asked.get("compression", "none")
            elif asked["op"] == "unsubscribe" and topic in listening:
                listening[topic].pop(line, None)
            elif asked["op"] == "call_service":
                told = {"op": "service_response", "service": asked["service"], "values": "none"}
                await line.send(json.dumps(told | {"id": asked.get("id"), "result": False}))
        for lines in listening.values():
            lines.pop(line, None)

    async def send(topic: str, number: int) -> None:
        for line, compression in list(listening[topic].items()):
            made = frames[compression][topic]
            with suppress(ConnectionClosed):
                await line.send(made[number % len(made)])

    async with serve(meet, "127.0.0.1", port, compression=None, max_size=None):
        yield send


@asynccontextmanager
async def on_foxglove(port: int) -> AsyncIterator[Send]:
    """Serve the topics with the server of the Foxglove SDK."""
    context = foxglove.Context()
    server = foxglove.start_server(
        name="robot", host="127.0.0.1", port=port, context=context, supported_encodings=["cdr"]
    )
    channels = {}
    for topic, name in KINDS.items():
        text = ROS2.generate_msgdef(name, ros_version=2)[0].encode()
        schema = foxglove.Schema(name=name, encoding="ros2msg", data=text)
        channels[topic] = foxglove.Channel(
            f"/{topic}", message_encoding="cdr", schema=schema, context=context
        )

    async def send(topic: str, number: int) -> None:
        made = CDR[topic]
        channels[topic].log(made[number % len(made)], log_time=time.time_ns())

    yield send
    server.stop()


@asynccontextmanager
async def on_zenoh(port: int) -> AsyncIterator[Send]:
    """Publish the topics with the keys of rmw_zenoh, in the process of the router."""
    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "timestamping": {"enabled": True},
    }
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
    kept, publishers = [], {}
    for count, (topic, name) in enumerate(KINDS.items()):
        package, _, base = name.split("/")
        kind = f"{package}::msg::dds_::{base}_/{ROS2.hash_rihs01(name)}"
        token = f"@ros2_lv/0/{session.zid()}/0/{count}/MP/%/%/robot/%{topic}/{kind}/::,10:,:,:,,"
        kept.append(session.liveliness().declare_token(token))
        publishers[topic] = session.declare_publisher(f"0/{topic}/{kind}")

    async def send(topic: str, number: int) -> None:
        made = CDR[topic]
        told = z_serialize((Int64(number + 1), Int64(time.time_ns()), GID))
        publishers[topic].put(made[number % len(made)], attachment=told)

    yield send
    session.close()  # type: ignore[no-untyped-call]


LINES = {"rosbridge": on_rosbridge, "foxglove": on_foxglove, "zenoh": on_zenoh}


async def publish(send: Send, topic: str) -> None:
    """Send a topic's messages at its rate."""
    began_s = time.monotonic()
    number = 0
    while True:
        await send(topic, number)
        number += 1
        await asyncio.sleep(max(0.0, began_s + number / RATES[topic] - time.monotonic()))


def free_port() -> int:
    """Return a free port of the loopback address."""
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


async def main(line: str) -> None:
    """Serve one line until the standard input ends."""
    hidden = free_port()
    forwarder = Forwarder(hidden)
    async with LINES[line](hidden) as send:
        tasks = [asyncio.create_task(publish(send, topic)) for topic in RATES]
        server = await asyncio.start_server(forwarder.meet, "127.0.0.1", 0)
        print("ready", server.sockets[0].getsockname()[1], flush=True)
        while await asyncio.to_thread(sys.stdin.readline):
            print("bytes", forwarder.count, flush=True)
        for task in tasks:
            task.cancel()
        server.close()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
