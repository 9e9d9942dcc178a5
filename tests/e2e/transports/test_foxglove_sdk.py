"""Messages in Protocol Buffers and FlatBuffers, from the server of the Foxglove SDK."""

import asyncio
import io
import math
import struct
import time
from base64 import b64decode
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from foxglove import Channel, MessageSchema, Schema, Service, ServiceRequest, ServiceSchema
from foxglove.channels import (
    CompressedImageChannel,
    CompressedVideoChannel,
    FrameTransformChannel,
    LaserScanChannel,
    LogChannel,
    PointCloudChannel,
    PoseInFrameChannel,
    Vector3Channel,
)
from foxglove.messages import (
    CompressedImage,
    CompressedVideo,
    FrameTransform,
    LaserScan,
    Log,
    LogLevel,
    PackedElementField,
    PackedElementFieldNumericType,
    PointCloud,
    Pose,
    PoseInFrame,
    Quaternion,
    Timestamp,
    Vector3,
)
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame as GooglePose
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3 as GoogleVector
from rosbags.typesys import get_types_from_msg

import urc
from bench.rig.ros_messages import ROS2
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from tests.e2e.transports.ros_bases import picture
from tests.unit.protocol.flatbuffer import messages as flat
from tests.unit.protocol.protobuf.messages import schema_of
from urc.client.local import ConnectedRobot
from urc.client.stick import MotionEnded
from urc.model.values import Sample
from urc.problems import UrcError
from urc.protocol.values.point_cloud import read_cloud
from urc.video import VideoUnit, read_unit

pytestmark = pytest.mark.anyio

WAIT_S = 30.0
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings: { port: { type: port, required: true } }
transports:
  ros: { type: ros, via: auto, host: 127.0.0.1, port: "{{ settings.port }}" }
signals:
  picture: { type: image }
  cloud: { type: point_cloud }
  tree: { type: transform_tree }
  x: { unit: m }
  "q{k}": { each: { k: [x, y, z, w] } }
  yaw: { unit: rad, value: "[qx, qy, qz, qw] | yaw" }
  seconds: { type: integer }
  ranges: { type: array }
  first: { unit: rad }
  last: { unit: rad }
  step: { unit: rad, value: "(last - first) / ([ranges | length - 1, 1] | max)" }
  length: {}
  speed: {}
messages:
  speed: { subscribe: { topic: /speed, type: foxglove.Vector3 }, json: { speed: x } }
  pose:
    subscribe: { topic: /pose, type: foxglove.PoseInFrame }
    json:
      x: pose.position.x
      qx: pose.orientation.x
      qy: pose.orientation.y
      qz: pose.orientation.z
      qw: pose.orientation.w
      seconds: timestamp.sec
  scan:
    subscribe: { topic: /scan, type: foxglove.LaserScan }
    json: { ranges: ranges, first: start_angle, last: end_angle }
  camera: { subscribe: { topic: /camera, type: foxglove.CompressedImage }, json: { picture: "@" } }
  cloud: { subscribe: { topic: /cloud, type: foxglove.PointCloud }, json: { cloud: "@" } }
  frames: { subscribe: { topic: /frames, type: foxglove.FrameTransform }, json: { tree: "@" } }
  log:
    subscribe: { topic: /log, type: foxglove.Log }
    json: { _level: level, _name: name, _text: message }
    log: { text: "{{ _name }}: {{ _text }}", level: "'error' if _level >= 4 else 'warning' if _level == 3 else 'info'" }
commands:
  goal:
    args: { x: {}, y: {} }
    send:
      publish:
        topic: /goal
        type: foxglove.PoseInFrame
        json: { timestamp: now, frame_id: map, pose: { position: { x: "{{ x }}", y: "{{ y }}" } } }
  drive:
    args: { speed: { min: -1, max: 1, default: 0 } }
    send: { publish: { topic: /cmd, type: foxglove.Vector3, json: { x: "{{ speed }}" } } }
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
  wrong:
    send: { publish: { topic: /goal, type: foxglove.PoseInFrame, json: { place: 4 } } }
  measure:
    args: { x: {} }
    send: { call: { service: /measure, type: foxglove.Vector3, json: { x: "{{ x }}", y: 4 } } }
    reply: { json: { length: x }, timeout: 20s }
"""  # noqa: E501


@pytest.fixture
def rover() -> Iterator[FoxgloveRobot]:
    robot = FoxgloveRobot(encodings=("protobuf",))
    yield robot
    robot.close()


@asynccontextmanager
async def connected(folder: Path, port: int) -> AsyncIterator[ConnectedRobot]:
    file = folder / "rover.yaml"
    file.write_text(ROVER, "utf-8")
    async with urc.connect(urc.load(file), port=port) as robot:
        yield robot


def value(robot: ConnectedRobot, name: str) -> Any:
    found = robot.latest(name)
    return None if found is None else found.value


async def until(is_met: Callable[[], object], repeat: Callable[[], object] | None = None) -> None:
    async with asyncio.timeout(WAIT_S):
        while not is_met():
            if repeat is not None:
                repeat()
            await asyncio.sleep(0.05)


def notes(robot: ConnectedRobot) -> str:
    return "\n".join(str(line) for line in robot.hub.notes)


async def test_the_schemas_of_the_sdk_become_signals(tmp_path: Path, rover: FoxgloveRobot) -> None:
    at = rover.context
    half = math.sqrt(0.5)
    turned = Quaternion(x=0, y=0, z=half, w=half)
    now = Timestamp(sec=1_700_000_000, nsec=5)
    number = PackedElementFieldNumericType
    fields = [
        PackedElementField(name=name, offset=4 * place, type=number.Float32)
        for place, name in enumerate("xyz")
    ]
    fields.append(PackedElementField(name="intensity", offset=12, type=number.Uint8))
    points = b"".join(struct.pack("<fffB", x, 0, 1, 7) for x in (1, 2))
    cloud = PointCloud(
        frame_id="lidar",
        pose=Pose(position=Vector3(x=0, y=0, z=2), orientation=turned),
        point_stride=13,
        fields=fields,
        data=points,
    )
    jpeg = picture()
    said = [
        (PoseInFrameChannel("/pose", context=at), PoseInFrame(
            timestamp=now, frame_id="map", pose=Pose(position=Vector3(x=1.5), orientation=turned)
        )),
        (LaserScanChannel("/scan", context=at), LaserScan(
            start_angle=-1, end_angle=1, ranges=[1, math.inf, 3]
        )),
        (CompressedImageChannel("/camera", context=at), CompressedImage(data=jpeg, format="jpeg")),
        (PointCloudChannel("/cloud", context=at), cloud),
        (FrameTransformChannel("/frames", context=at), FrameTransform(
            timestamp=now, parent_frame_id="map", child_frame_id="base",
            translation=Vector3(x=1, y=2, z=3), rotation=turned,
        )),
        (LogChannel("/log", context=at), Log(level=LogLevel.Error, name="arm", message="hot")),
    ]  # fmt: skip

    def publish() -> None:
        for channel, message in said:
            channel.log(message)

    async with connected(tmp_path, rover.port) as robot:
        names = ("x", "yaw", "step", "picture", "cloud", "tree")
        await until(lambda: all(value(robot, name) is not None for name in names), publish)
        assert value(robot, "x") == 1.5
        assert value(robot, "yaw") == pytest.approx(math.pi / 2)
        assert value(robot, "seconds") == 1_700_000_000
        assert value(robot, "ranges") == (1, None, 3)
        assert value(robot, "step") == 1
        assert bytes(value(robot, "picture")) == jpeg
        found = read_cloud(value(robot, "cloud"))
        assert (found.frame, found.colour, found.total) == ("lidar", "intensity", 2)
        assert struct.unpack("<8f", found.points) == pytest.approx(
            (0, 1, 3, 7, 0, 2, 3, 7), abs=1e-6
        )
        assert value(robot, "tree")["frames"][-1]["parent"] == "map"
        await until(lambda: "arm: hot" in notes(robot))


async def test_an_image_that_waited_in_the_robot_is_older_than_its_arrival(
    tmp_path: Path, rover: FoxgloveRobot
) -> None:
    """The clock of the robot is wrong by an hour, and is then set back by this hour."""
    channel = CompressedImageChannel("/camera", context=rover.context)
    jpeg, clock_s = picture(), 3600.0

    def send(captured_s: float | None = None) -> None:
        at_s = clock_s + (time.time() if captured_s is None else captured_s)
        stamp = Timestamp(sec=int(at_s), nsec=int(at_s % 1 * 1e9))
        channel.log(CompressedImage(timestamp=stamp, data=jpeg, format="jpeg"))

    async with connected(tmp_path, rover.port) as robot:
        loop = asyncio.get_running_loop()

        def last_s() -> float:
            found = robot.latest("picture")
            return -math.inf if found is None else found.time_s

        async def age_s(captured_s: float | None = None) -> float:
            before_s = last_s()
            send(captured_s)
            await until(lambda: last_s() != before_s)
            return loop.time() - last_s()

        await until(lambda: value(robot, "picture") is not None, send)
        assert await age_s() < 1.0, "a wrong clock makes nothing old"
        captured_s = time.time()
        await asyncio.sleep(2.0)
        assert await age_s(captured_s) > 1.9, "it was captured before the pause"
        assert await age_s() < 1.0
        clock_s = 0.0
        assert await age_s() < 1.0, "nor does a clock that is set"
        assert notes(robot).count("compares the clocks again") == 1
        captured_s = time.time()
        await asyncio.sleep(2.0)
        assert await age_s(captured_s) > 1.9


FILM = """
urc: 1
kind: robot
name: filmer
title: Filmer
settings: { port: { type: port, required: true } }
transports:
  ros: { type: ros, via: auto, host: 127.0.0.1, port: "{{ settings.port }}" }
signals:
  film: { type: video }
  raw: { type: video }
messages:
  film: { subscribe: { topic: /film, type: foxglove.CompressedVideo }, json: { film: "@" } }
  raw:
    subscribe: { topic: /raw, type: ffmpeg_image_transport_msgs/FFMPEGPacket }
    json: { raw: "@" }
commands:
  drive:
    args: { speed: { min: -1, max: 1, default: 0 } }
    send: { publish: { topic: /cmd, type: foxglove.Vector3, json: { x: "{{ speed }}" } } }
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
"""
"""The robot moves, so its guard passes the messages on."""
PACKET = "ffmpeg_image_transport_msgs/msg/FFMPEGPacket"
PACKET_TEXT = """\
std_msgs/Header header
int32 width
int32 height
string encoding
uint64 pts
uint8 flags
bool is_bigendian
uint8[] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
"""As ffmpeg_image_transport_msgs 1.1 defines it."""


def packet_of(data: bytes, number: int) -> bytes:
    """Return an FFMPEGPacket in CDR, written by rosbags."""
    if PACKET not in ROS2.types:
        ROS2.register(get_types_from_msg(PACKET_TEXT.partition("=====")[0], PACKET))
    types = ROS2.types
    at_s = time.time()
    stamp = types["builtin_interfaces/msg/Time"](sec=int(at_s), nanosec=int(at_s % 1 * 1e9))
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="eye")
    packet = types[PACKET](
        header, 320, 240, "h264", number, int(number % 10 == 0), False,
        np.frombuffer(data, np.uint8),
    )  # fmt: skip
    return bytes(ROS2.serialize_cdr(packet, PACKET))


def film() -> list[bytes]:
    """Return the access units of a film, with a keyframe in each group of ten."""
    target = io.BytesIO()
    with av.open(target, "w", format="h264") as container:
        options = {"preset": "ultrafast", "tune": "zerolatency"}
        stream = container.add_stream("libx264", rate=30, options=options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt, stream.gop_size = 320, 240, "yuv420p", 10
        packets = []
        for number in range(60):
            grey = np.full((240, 320, 3), 4 * number, np.uint8)
            packets += stream.encode(av.VideoFrame.from_ndarray(grey, "rgb24"))
        packets += stream.encode(None)
        return [bytes(packet) for packet in packets]


@pytest.mark.parametrize("name", ["film", "raw"])
async def test_a_video_in_messages_arrives_in_whole_groups(
    tmp_path: Path, rover: FoxgloveRobot, name: str
) -> None:
    """From a keyframe on, unchanged, and in an order that a decoder can follow."""
    file = tmp_path / "filmer.yaml"
    file.write_text(FILM, "utf-8")
    units, found = film(), list[VideoUnit]()
    channel = CompressedVideoChannel("/film", context=rover.context) if name == "film" else None

    def send(number: int) -> None:
        data = units[number % len(units)]
        if channel is None:
            rover.publish("/raw", PACKET, packet_of(data, number), PACKET_TEXT)
            return
        at_s = time.time()
        stamp = Timestamp(sec=int(at_s), nsec=int(at_s % 1 * 1e9))
        channel.log(CompressedVideo(timestamp=stamp, frame_id="eye", data=data, format="h264"))

    def hear(samples: Sequence[Sample]) -> None:
        for one in samples:
            unit = read_unit(one.value) if isinstance(one.value, bytes) else None
            if one.signal == name and unit is not None:
                found.append(unit)

    send(3)  # the topic begins in the middle of a group
    async with urc.connect(urc.load(file), port=rover.port) as robot:
        with robot.hub.passed_to(hear), robot.hub.viewers.viewing():
            await until(lambda: f"/{name}" in rover.subscribed)
            for number in range(4, 34):
                send(number)
                await asyncio.sleep(0.02)
            await until(lambda: found and found[-1].data == units[33])
        begin = units.index(found[0].data)
        assert begin % 10 == 0
        assert found[0].is_key
        assert [one.data for one in found] == units[begin:34]
        decoder = av.CodecContext.create("h264", "r")
        images = [image for one in found for image in decoder.decode(av.Packet(one.data))]
        images += decoder.decode(None)
        assert len(images) == len(found)
        assert {(image.width, image.height) for image in images} == {(320, 240)}
        now_s = asyncio.get_running_loop().time()
        assert all(0 <= now_s - one.time_s < 10 for one in found)


async def test_messages_are_published_by_the_schema_of_the_server(
    tmp_path: Path, rover: FoxgloveRobot
) -> None:
    async with connected(tmp_path, rover.port) as robot:
        await robot.command("goal", x=1, y=2)
        unknown = "the type foxglove.PoseInFrame of /goal is unknown; the bridge accepts protobuf"
        await until(lambda: unknown in notes(robot))
        channel = PoseInFrameChannel("/pose", context=rover.context)
        pose = PoseInFrame(pose=Pose(position=Vector3(x=3)))
        await until(lambda: value(robot, "x") == 3, lambda: channel.log(pose, log_time=5 * 10**9))
        await robot.command("goal", x=1, y=-2)
        await until(lambda: rover.heard)
        topic, data = rover.heard[0]
        found = GooglePose.FromString(data)
        assert (topic, found.pose.position.x, found.pose.position.y) == ("/goal", 1, -2)
        assert found.frame_id == "map"
        # The robot's clock is the time of its messages.
        assert 5 * 10**9 <= found.timestamp.ToNanoseconds() < 60 * 10**9
        assert ("/goal", "protobuf", "foxglove.PoseInFrame") in rover.advertised
        with pytest.raises(UrcError, match="the message has no 'place'; it has: timestamp"):
            await robot.command("wrong")


def _speeds(rover: FoxgloveRobot) -> list[float]:
    return [GoogleVector.FromString(data).x for topic, data in rover.heard if topic == "/cmd"]


async def test_release_a_lost_link_and_stop_end_a_motion_in_protobuf(tmp_path: Path) -> None:
    """The stop is in bytes as the motion is, and a new server is told its definition first."""
    rover = FoxgloveRobot(encodings=("protobuf",))
    port = rover.port
    try:
        async with connected(tmp_path, port) as robot:
            channel = Vector3Channel("/speed", context=rover.context)
            await until(lambda: value(robot, "speed") == 2, lambda: channel.log(Vector3(x=2)))
            async with robot.drive("drive") as stick:
                await until(lambda: 0.5 in _speeds(rover), lambda: stick(speed=0.5))
            await until(lambda: _speeds(rover)[-1] == 0)
            first = rover
            while rover is first:  # the client may also end a motion before the link is lost
                await asyncio.sleep(0.05)  # a refusal comes without a wait, so the link needs one
                with suppress(MotionEnded):
                    async with robot.drive("drive") as stick:
                        await until(
                            lambda now=rover: 0.25 in _speeds(now), lambda: stick(speed=0.25)
                        )
                        rover.close()
                        rover = FoxgloveRobot(port=port, encodings=("protobuf",))
                        await until(lambda now=rover: _speeds(now))
            await until(lambda: _speeds(rover))
            assert set(_speeds(rover)) == {0}
            assert ("/cmd", "protobuf", "foxglove.Vector3") in rover.advertised
            channel = Vector3Channel("/speed", context=rover.context)
            await until(lambda: value(robot, "speed") == 3, lambda: channel.log(Vector3(x=3)))
            with suppress(MotionEnded):
                async with robot.drive("drive") as stick:
                    await until(lambda: 0.5 in _speeds(rover), lambda: stick(speed=0.5))
                    await robot.stop()
                    await until(lambda: _speeds(rover)[-1] == 0)
                    last = len(_speeds(rover))
                    await asyncio.sleep(0.5)
            assert set(_speeds(rover)[last:]) <= {0}
    finally:
        rover.close()


async def test_services_are_called(tmp_path: Path, rover: FoxgloveRobot) -> None:
    text = schema_of(GoogleVector.DESCRIPTOR)
    schema = Schema(name="foxglove.Vector3", encoding="protobuf", data=b64decode(text))
    part = MessageSchema(encoding="protobuf", schema=schema)

    def answer(request: ServiceRequest) -> bytes:
        found = GoogleVector.FromString(request.payload)
        return GoogleVector(x=math.hypot(found.x, found.y)).SerializeToString()

    described = ServiceSchema(name="foxglove.Vector3", request=part, response=part)
    rover.server.add_services([Service(name="/measure", schema=described, handler=answer)])
    async with connected(tmp_path, rover.port) as robot:
        await asyncio.sleep(0.5)  # the services are announced after the server information
        await robot.command("measure", x=3)
        assert value(robot, "length") == 5


async def test_a_hostile_schema_costs_one_line(tmp_path: Path, rover: FoxgloveRobot) -> None:
    schemas = {"/pose": b"\xff" * 900, "/scan": b"", "/cloud": b"\0" * 10_000_000}
    channels = [
        Channel(
            topic,
            message_encoding="protobuf",
            schema=Schema(name="foxglove.Any", encoding="protobuf", data=data),
            context=rover.context,
        )
        for topic, data in schemas.items()
    ]
    channel = LogChannel("/log", context=rover.context)

    def publish() -> None:
        for one in channels:
            one.log(b"\x0a\x7f")
        channel.log(Log(name="arm", message="still read"))

    async with connected(tmp_path, rover.port) as robot:
        await until(lambda: "arm: still read" in notes(robot), publish)
        await until(lambda: "the definition of a channel is too long" in notes(robot), publish)
        said = [line.text for line in robot.hub.notes if line.text.startswith("bad-value")]
        assert set(said) == {
            "bad-value: /pose: the definition is not a FileDescriptorSet"
            " (a number has more than ten bytes)",
            "bad-value: /scan: the definition does not contain the type 'foxglove.Any'",
        }


async def test_flatbuffers_are_read_by_their_binary_schemas(
    tmp_path: Path, rover: FoxgloveRobot
) -> None:
    """The same signals, with messages that Foxglove's own classes for FlatBuffers have built."""
    half, jpeg = math.sqrt(0.5), picture()
    points = b"".join(struct.pack("<fff", x, 0, 1) for x in (1, 2))
    fields = [(name, 4 * place, 7) for place, name in enumerate("xyz")]
    pose = flat.pose_in_frame((2.5, 0, 0), (0, 0, half, half), "map", 1_700_000_000, 5)
    said = {
        "/pose": ("PoseInFrame", pose),
        "/scan": ("LaserScan", flat.scan(-1, 1, [1, math.inf, 3])),
        "/camera": ("CompressedImage", flat.image(jpeg, "jpeg")),
        "/cloud": ("PointCloud", flat.point_cloud(12, fields, points, "lidar")),
        "/log": ("Log", flat.log(4, "arm", "hot")),
    }
    channels = []
    for topic, (name, data) in said.items():
        schema = Schema(
            name=f"foxglove.{name}", encoding="flatbuffer", data=flat.binary_schema(name)
        )
        channel = Channel(
            topic, message_encoding="flatbuffer", schema=schema, context=rover.context
        )
        channels.append((channel, data))

    def publish() -> None:
        for channel, data in channels:
            channel.log(data)

    async with connected(tmp_path, rover.port) as robot:
        names = ("x", "yaw", "step", "picture", "cloud")
        await until(lambda: all(value(robot, name) is not None for name in names), publish)
        assert value(robot, "x") == 2.5
        assert value(robot, "yaw") == pytest.approx(math.pi / 2)
        assert value(robot, "seconds") == 1_700_000_000
        assert value(robot, "ranges") == (1, None, 3)
        assert bytes(value(robot, "picture")) == jpeg
        found = read_cloud(value(robot, "cloud"))
        assert (found.frame, struct.unpack("<6f", found.points)) == ("lidar", (1, 0, 1, 2, 0, 1))
        await until(lambda: "arm: hot" in notes(robot))
