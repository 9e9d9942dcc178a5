"""The Foxglove protocol against the server of its SDK, with messages that rosbags writes."""

import asyncio
import json
import struct
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.server import ServerConnection, serve

import urc
from bench.rig.ros_messages import ROS1, ROS2, RandomMessages
from tests.e2e.transports.authority import Authority
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from urc.client.local import ConnectedRobot
from urc.problems import UrcError

pytestmark = pytest.mark.anyio

WAIT_S = 30.0
ROBOTS = Path(__file__).resolve().parents[3] / "robots"
ODOMETRY = "nav_msgs/msg/Odometry"
IMAGE = "sensor_msgs/msg/CompressedImage"
STATUS = "nifti_robot_driver_msgs/msg/RobotStatusStamped"
STATUS_TEXT = """\
float64 battery_level
int32 battery_status
bool brake_on
bool emergency_stop_on
float64 scanning_speed"""
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  port: { type: port, required: true }
  bridge: { type: choice, choices: [auto, rosbridge, foxglove], default: auto }
transports:
  ros:
    type: ros
    via: "{{ settings.bridge }}"
    host: 127.0.0.1
    port: "{{ settings.port }}"
    version: auto
signals:
  x: { unit: m }
  beams: { type: array }
  slow: { type: integer }
  picture: { type: image, size: 2000000 }
  rate: { type: integer }
  said: { type: string }
  done: { type: boolean }
messages:
  odom: { subscribe: { topic: /odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
  scan: { subscribe: { topic: /scan, type: sensor_msgs/LaserScan }, json: { beams: ranges } }
  slow: { subscribe: { topic: /slow, type: std_msgs/Int64, throttle: 500ms }, json: { slow: data } }
  camera:
    subscribe: { topic: /camera, type: sensor_msgs/CompressedImage }
    json: { picture: data }
  rate: { subscribe: { topic: "parameter:/driver.rate" }, json: { rate: value } }
commands:
  say:
    args: { text: { type: string } }
    send: { publish: { topic: /say, type: std_msgs/String, json: { data: "{{ text }}" } } }
  drive:
    args: { speed: { min: -1, max: 1, default: 0 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        stamped: true
        json: { linear: { x: "{{ speed }}" } }
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
  lamp:
    args: { lit: { type: boolean } }
    send: { call: { service: /lamp, type: std_srvs/SetBool, json: { data: "{{ lit }}" } } }
    reply: { json: { said: message }, timeout: 20s }
  missing:
    send: { call: { service: /missing, type: std_srvs/Trigger } }
    reply: { json: { said: message }, timeout: 20s }
  get_rate:
    send: { call: { service: /rosapi/get_param, json: { name: "/driver:rate" } } }
    reply: { json: { said: value }, timeout: 20s }
  set_rate:
    args: { rate: { type: integer } }
    send:
      call:
        service: /rosapi/set_param
        json: { name: "/driver:rate", value: "{{ rate | string }}" }
    reply: { json: { done: successful }, timeout: 20s }
  strange:
    send: { publish: { topic: /strange, type: my_msgs/Strange, json: { any: 5 } } }
"""


@pytest.fixture
def rover() -> Iterator[FoxgloveRobot]:
    robot = FoxgloveRobot()
    yield robot
    robot.close()


@asynccontextmanager
async def connected(
    folder: Path, port: int, bridge: str = "auto", tls: str = ""
) -> AsyncIterator[ConnectedRobot]:
    file = folder / "rover.yaml"
    line = "    version: auto\n"
    file.write_text(ROVER.replace(line, f"{line}    tls: {tls}\n" if tls else line), "utf-8")
    async with urc.connect(urc.load(file), port=port, bridge=bridge) as robot:
        await until(lambda: robot.session.frames.is_ready("drive"))
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


@pytest.mark.parametrize("bridge", ["auto", "foxglove"])
async def test_real_server_is_read_and_commanded_over_tls(tmp_path: Path, bridge: str) -> None:
    authority = Authority(tmp_path)
    pair = authority.sign("127.0.0.1")
    certificate, key = Path(pair.cert).read_bytes(), Path(pair.key).read_bytes()
    rover = FoxgloveRobot(tls_cert=certificate, tls_key=key)
    odometry = RandomMessages(ROS2, seed=13).message(ODOMETRY)
    odometry.pose.pose.position.x = 4.5
    try:
        trusted = f"{{ ca: '{authority.file}' }}"
        async with connected(tmp_path, rover.port, bridge, trusted) as robot:
            await until(
                lambda: value(robot, "x") == 4.5,
                lambda: rover.publish("/odom", ODOMETRY, odometry),
            )
            await robot.command("say", text="over TLS")
            await until(lambda: any(topic == "/say" for topic, _ in rover.heard))
    finally:
        rover.close()


async def test_real_server_of_an_unknown_authority_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    authority, other = Authority(tmp_path), Authority(tmp_path / "other")
    pair = other.sign("127.0.0.1")
    certificate, key = Path(pair.cert).read_bytes(), Path(pair.key).read_bytes()
    rover = FoxgloveRobot(tls_cert=certificate, tls_key=key)
    file = tmp_path / "rover.yaml"
    line = "    version: auto\n"
    file.write_text(ROVER.replace(line, f"{line}    tls: {{ ca: '{authority.file}' }}\n"), "utf-8")
    try:
        async with urc.connect(urc.load(file), port=rover.port, bridge="foxglove") as robot:
            links = robot.session.hub.links
            await until(lambda: "unknown authority" in links["ros"].detail)
            assert rover.advertised == [], "no message leaves before the certificate is checked"
    finally:
        rover.close()


@pytest.mark.parametrize("bridge", ["auto", "foxglove"])
async def test_messages_arrive_over_the_real_server(
    rover: FoxgloveRobot, tmp_path: Path, bridge: str
) -> None:
    source = RandomMessages(ROS2, seed=11)
    odometry, scan = source.message(ODOMETRY), source.message("sensor_msgs/msg/LaserScan")
    odometry.pose.pose.position.x = 12.5
    scan.ranges = scan.ranges[:0].__class__((3,), dtype="float32")
    scan.ranges[:] = [1.5, float("inf"), 2.0]
    picture = source.message(IMAGE)
    picture.data = picture.data[:0].__class__((5,), dtype="uint8")
    picture.data[:] = list(b"\xff\xd8\xff\xe0\x21")

    def publish() -> None:
        rover.publish("/odom", ODOMETRY, odometry)
        rover.publish("/scan", "sensor_msgs/msg/LaserScan", scan)
        rover.publish("/camera", IMAGE, picture)

    async with connected(tmp_path, rover.port, bridge) as robot:
        await until(
            lambda: all(robot.latest(one) for one in ("x", "beams", "picture")), repeat=publish
        )
        assert value(robot, "x") == 12.5
        assert list(value(robot, "beams")) == [1.5, None, 2.0]
        assert sorted(rover.subscribed) == ["/camera", "/odom", "/scan"]


async def test_messages_that_come_too_soon_are_dropped_and_the_last_one_arrives_late(
    rover: FoxgloveRobot, tmp_path: Path
) -> None:
    """The bridge has no throttle; a topic that falls silent must not keep an older value."""
    async with connected(tmp_path, rover.port) as robot:
        await until(
            lambda: robot.latest("slow"),
            repeat=lambda: rover.publish("/slow", "std_msgs/msg/Int64", _int64(0)),
        )
        seen: list[object] = []

        async def watch() -> None:
            async for sample in robot.watch("slow"):
                seen.append(sample.value)

        watching = asyncio.create_task(watch())
        await asyncio.sleep(0.6)
        for number in range(1, 41):
            rover.publish("/slow", "std_msgs/msg/Int64", _int64(number))
        await until(lambda: seen and seen[-1] == 40)
        watching.cancel()
        assert len(seen) < 10


def _int64(number: int) -> bytes:
    return b"\0\1\0\0" + struct.pack("<q", number)


async def test_a_type_that_changes_is_compiled_again(rover: FoxgloveRobot, tmp_path: Path) -> None:
    async with connected(tmp_path, rover.port) as robot:
        await until(
            lambda: robot.latest("slow"),
            repeat=lambda: rover.publish("/slow", "std_msgs/msg/Int64", _int64(7)),
        )
        rover.withdraw("/slow")
        changed = b"\0\1\0\0" + struct.pack("<I4sq", 4, b"new\0", 8)
        text = "string before\nint64 data"
        await until(
            lambda: value(robot, "slow") == 8,
            repeat=lambda: rover.publish("/slow", "pkg/msg/Other", changed, text),
        )


async def test_published_messages_arrive_in_cdr_with_the_time_of_sending(
    rover: FoxgloveRobot, tmp_path: Path
) -> None:
    async with connected(tmp_path, rover.port) as robot:
        await robot.command("say", text="hällo")
        async with asyncio.timeout(WAIT_S), robot.drive("drive") as stick:
            for _ in range(3):
                stick(speed=0.5)
                await asyncio.sleep(0.06)
        await until(lambda: len(rover.heard) > 4 and _speeds(rover)[-1:] == [0])
        await until(lambda: any(topic == "/say" for topic, _ in rover.heard))
        # The guard drives over a connection of its own, so the order of the topics is open.
        said = next(data for topic, data in rover.heard if topic == "/say")
        assert ROS2.deserialize_cdr(said, "std_msgs/msg/String").data == "hällo"
        assert 0.5 in _speeds(rover)
        assert ("/cmd_vel", "cdr", "geometry_msgs/msg/TwistStamped") in rover.advertised
        stamp = _twists(rover)[0].header.stamp
        assert stamp.sec > 1_600_000_000


def _twists(rover: FoxgloveRobot) -> list[Any]:
    kind = "geometry_msgs/msg/TwistStamped"
    return [ROS2.deserialize_cdr(data, kind) for topic, data in rover.heard if topic == "/cmd_vel"]


def _speeds(rover: FoxgloveRobot) -> list[float]:
    return [one.twist.linear.x for one in _twists(rover)]


async def test_a_type_without_a_definition_is_sent_as_json(
    rover: FoxgloveRobot, tmp_path: Path
) -> None:
    async with connected(tmp_path, rover.port) as robot:
        await robot.command("strange")
        await until(lambda: rover.heard)
        assert rover.heard == [("/strange", b'{"any":5}')]
        assert rover.advertised == [("/strange", "json", "my_msgs/msg/Strange")]


HALT = """
urc: 1
kind: robot
name: halter
title: Halter
settings: { port: { type: port, required: true } }
transports:
  ros: { type: ros, via: foxglove, host: 127.0.0.1, port: "{{ settings.port }}" }
signals: { is_halted: { type: boolean } }
messages:
  halted: { subscribe: { topic: /halted, type: my_msgs/Halt }, json: { is_halted: halt } }
commands:
  stay:
    stop: true
    send: { publish: { topic: /halt, type: my_msgs/Halt, json: { halt: true } } }
"""


async def test_the_first_stop_of_a_connection_uses_the_definition_of_an_earlier_one(
    tmp_path: Path,
) -> None:
    """Only the robot defines the type, and after its restart it has not announced it yet."""
    (tmp_path / "halter.yaml").write_text(HALT)
    rover = FoxgloveRobot(encodings=("cdr",))
    port, kind = rover.port, "my_msgs/msg/Halt"
    try:
        async with (
            urc.connect(urc.load(tmp_path / "halter.yaml"), port=port) as robot,
            asyncio.timeout(WAIT_S),
        ):

            async def halted(text: str, data: bytes) -> None:
                before = robot.latest("is_halted")
                while robot.latest("is_halted") == before:
                    rover.publish("/halted", kind, data, text)
                    await asyncio.sleep(0.05)

            async def restarted() -> None:
                nonlocal rover
                rover.close()
                await until(lambda: robot.hub.links["ros"].state == "lost")
                rover = FoxgloveRobot(port, encodings=("cdr",))
                await until(lambda: robot.hub.links["ros"].is_ready)

            await halted("bool halt", b"\0\1\0\0\0")
            await restarted()
            await robot.command("stay")
            await until(lambda: rover.heard)
            assert rover.heard == [("/halt", b"\0\1\0\0\1")]
            await restarted()
            await halted("uint8 why\nbool halt", b"\0\1\0\0\0\0")
            await robot.command("stay")
            await until(lambda: rover.heard)
            assert rover.heard == [("/halt", b"\0\1\0\0\0\1")]
    finally:
        rover.close()


async def test_services_answer_and_refuse(rover: FoxgloveRobot, tmp_path: Path) -> None:
    asked: list[bytes] = []

    def lamp(data: bytes) -> bytes:
        asked.append(data)
        text = b"lamp is lit" if data[4] else b"lamp is dark"
        return b"\0\1\0\0" + struct.pack("<?3xI", True, len(text) + 1) + text + b"\0"

    rover.offer("/lamp", "std_srvs/srv/SetBool", lamp)
    async with connected(tmp_path, rover.port) as robot:
        await asyncio.sleep(0.3)
        assert (await robot.command("lamp", lit=True))["said"] == "lamp is lit"
        assert (await robot.command("lamp", lit=False))["said"] == "lamp is dark"
        assert [data[4] for data in asked] == [1, 0]
        with pytest.raises(UrcError, match="there is no service /missing"):
            await robot.command("missing")


async def test_parameters_are_read_written_and_followed(
    rover: FoxgloveRobot, tmp_path: Path
) -> None:
    """The services of rosapi are answered by the protocol, so one document fits both bridges."""
    async with connected(tmp_path, rover.port) as robot:
        await until(lambda: robot.latest("rate"))
        assert value(robot, "rate") == 10
        assert (await robot.command("get_rate"))["said"] == "10"
        assert (await robot.command("set_rate", rate=25))["done"] is True
        assert rover.parameters["/driver.rate"] == 25
        await until(lambda: value(robot, "rate") == 25)


async def test_a_server_without_a_subprotocol_is_a_rosbridge(tmp_path: Path) -> None:
    heard: list[dict[str, Any]] = []

    async def bridge(client: ServerConnection) -> None:
        async for frame in client:
            heard.append(json.loads(frame))

    async with (
        serve(bridge, "127.0.0.1", 0) as server,
        connected(tmp_path, server.sockets[0].getsockname()[1]) as robot,
    ):
        await until(lambda: any(one["op"] == "subscribe" for one in heard))
        await robot.command("say", text="hi")
        await until(lambda: any(one["op"] == "publish" for one in heard))
        said = next(one for one in heard if one["op"] == "publish")
        assert said["msg"] == {"data": "hi"}


async def test_a_hostile_server_costs_counted_faults(tmp_path: Path) -> None:
    """Lengths that lie, types without end, wrong encodings: the next good message still arrives."""
    info = {"op": "serverInfo", "name": "x", "capabilities": [], "supportedEncodings": ["cdr"]}

    def channel(number: int, topic: str, schema: str, encoding: str = "cdr") -> dict[str, Any]:
        return {
            "id": number, "topic": topic, "encoding": encoding, "schemaName": "pkg/msg/T",
            "schema": schema, "schemaEncoding": "ros2msg",
        }  # fmt: skip

    async def hostile(client: ServerConnection) -> None:
        async def send(**fields: Any) -> None:
            await client.send(json.dumps(fields))

        await client.send(json.dumps(info))
        await send(op="advertise", channels=[channel(1, "/scan", "x" * 1_000_000)])
        await send(op="advertise", channels=[channel(2, "/camera", "int8 data", "protobuf")])
        await send(op="advertise", channels=[{"id": -1}, 5, {"id": 3, "topic": 7}])
        await send(op="advertise", channels=[channel(n, f"/t{n}", "") for n in range(10, 5000)])
        for number in range(300):
            await send(op="advertise", channels=[channel(6000, "/odom", f"int8 f{number}")])
            await send(op="unadvertise", channelIds=[6000])
        await client.send(b"\x01\xff")
        await client.send(b"\x03" + b"\xff" * 12)
        await client.send("{" * 1000)
        await send(op="advertise", channels=[channel(7000, "/slow", "string a\nint64 data")])
        subscription = None
        async for frame in client:
            said = json.loads(frame)
            for one in said.get("subscriptions", ()) if said["op"] == "subscribe" else ():
                subscription = one["id"] if one["channelId"] == 7000 else subscription
            if subscription is not None:
                break
        head = b"\x01" + struct.pack("<IQ", subscription or 0, 5)
        await client.send(head + b"\0\1\0\0" + struct.pack("<I", 0xFFFFFFF0))
        await client.send(head + b"\0\1\0\0" + struct.pack("<I4sq", 2, b"a\0", 42))
        await asyncio.sleep(0.7)  # longer than the throttle of the topic
        await client.send(head + b"\0\1\0\0" + struct.pack("<I4sq", 2, b"a\0", 43))
        await client.wait_closed()

    async with (
        serve(hostile, "127.0.0.1", 0, subprotocols=["foxglove.websocket.v1"]) as server,  # type: ignore[list-item]
        connected(tmp_path, server.sockets[0].getsockname()[1]) as robot,
    ):
        await until(lambda: value(robot, "slow") == 43)
        text = "\n".join(str(line) for line in robot.hub.notes)
        assert "the definition of a channel is too long (1000000 characters)" in text


@pytest.mark.parametrize(
    ("name", "bridge"),
    [
        ("generic-ros2", "foxglove"),
        ("turtlebot4", "auto"),
        ("turtlebot3", "foxglove"),
        ("absolem", "auto"),
    ],
)
async def test_shipped_robots_are_driven(name: str, bridge: str) -> None:
    """The same profiles as over rosbridge; a bridge of ROS 1 has another format."""
    is_ros1 = name == "absolem"
    rover = FoxgloveRobot(encodings=("ros1",) if is_ros1 else ("cdr",))
    store = ROS1 if is_ros1 else ROS2
    odometry = RandomMessages(store, seed=2).message(ODOMETRY)
    odometry.pose.pose.position.x = 2.5

    def publish() -> None:
        if is_ros1:
            rover.publish_ros1("/odom", ODOMETRY, odometry)
            rover.publish_ros1("/robot_status", STATUS, bytes(22), STATUS_TEXT)
        else:
            rover.publish("/odom", ODOMETRY, odometry)

    def speeds() -> list[float]:
        kind = "geometry_msgs/msg/Twist"
        read = store.deserialize_ros1 if is_ros1 else store.deserialize_cdr
        return [read(data, kind).linear.x for topic, data in rover.heard if topic == "/cmd_vel"]

    try:
        async with urc.connect(
            urc.load(ROBOTS / f"{name}.yaml"), port=rover.port, bridge=bridge
        ) as robot:
            await until(lambda: value(robot, "x") == 2.5, repeat=publish)
            if is_ros1:
                await until(lambda: value(robot, "emergency") is False, repeat=publish)
            async with asyncio.timeout(WAIT_S), robot.drive("drive") as stick:
                for _ in range(3):
                    stick(speed=0.1)
                    await asyncio.sleep(0.11)
            await until(lambda: 0.1 in speeds() and speeds()[-1] == 0)
    finally:
        rover.close()
