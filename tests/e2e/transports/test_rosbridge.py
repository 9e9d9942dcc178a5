"""rosbridge beyond the contract: independent clients, a real ROS 1 master, what the line keeps."""

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve

from scripts.node import node_executable
from tests.e2e.ports import free_port
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.programs import listens, program
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.model.profile import Profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.server import serve as serve_robot
from urc.transports.base import (
    NOTICE,
    PeerClosed,
    TopicSubscription,
    Transport,
    TransportError,
    TransportSetup,
)
from urc.transports.ros.choice import from_setup

pytestmark = pytest.mark.anyio

WAIT_S = 20.0
CLIENTS = Path(__file__).parent / "clients"
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: 9090 }
transports:
  ros: { type: ros, host: "{{ settings.host }}", port: "{{ settings.port }}" }
signals:
  x: { unit: m }
messages:
  odom:
    subscribe: { topic: /odom, type: nav_msgs/Odometry }
    json: { x: pose.pose.position.x }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: { linear: { x: "{{ speed }}" } }
  reset: { send: { call: { service: /reset, type: std_srvs/Trigger } } }
  dock: { send: { goal: { action: /dock, type: irobot_create_msgs/action/Dock } } }
"""


def line(port: int, *topics: TopicSubscription, **options: object) -> Transport:
    return from_setup(TransportSetup("ros", {"host": "127.0.0.1", "port": port, **options}, topics))


async def heard(transport: Transport) -> Envelope:
    said = await asyncio.wait_for(transport.receive(), WAIT_S)
    assert isinstance(said, Envelope)
    return said


@pytest.fixture
def rover(tmp_path: Path) -> Profile:
    path = tmp_path / "rover.yaml"
    path.write_text(ROVER)
    return load_profile(path, built_in_catalog())


@asynccontextmanager
async def emulated(profile: Profile) -> AsyncIterator[int]:
    settings = {"host": "127.0.0.1", "port": 0}
    async with serve_robot(profile, settings) as listening:
        yield listening["ros"].port


class Bridge:
    """A bridge that the test plays: what the client said, and what it is to hear."""

    def __init__(self) -> None:
        self.said: list[dict[str, Any]] = []
        self.clients: list[ServerConnection] = []
        self.port = 0
        self._changed = asyncio.Event()

    async def meet(self, client: ServerConnection) -> None:
        self.clients.append(client)
        async for frame in client:
            assert isinstance(frame, str), "a client speaks text"
            self.said.append(json.loads(frame))
            self._changed.set()

    async def say(self, operation: dict[str, Any]) -> None:
        await self.clients[-1].send(json.dumps(operation))

    async def answer(self, asked: dict[str, Any], values: dict[str, Any]) -> None:
        await self.say({"op": "service_response", "id": asked["id"], "values": values})

    async def hears(self, count: int) -> list[dict[str, Any]]:
        async with asyncio.timeout(WAIT_S):
            while len(self.said) < count:
                self._changed.clear()
                await self._changed.wait()
        return self.said


@asynccontextmanager
async def bridge() -> AsyncIterator[Bridge]:
    played = Bridge()
    async with serve(played.meet, "127.0.0.1", 0, ping_interval=None) as server:
        played.port = server.sockets[0].getsockname()[1]
        yield played
        for client in played.clients:
            client.transport.abort()


async def test_line_subscribes_each_topic_once_and_asks_which_there_are() -> None:
    """A second subscription would cancel the first one's throttle: the lowest of both is sent."""
    topics = (
        TopicSubscription("/imu", {"type": "sensor_msgs/Imu", "throttle": 0.2, "queue_length": 1}),
        TopicSubscription("/imu", {"throttle": 0.1}),
        TopicSubscription("/camera", {"compression": "cbor"}),
    )
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port, *topics, version=2)
        await transport.open(20.0)
        asked, imu, camera = await robot.hears(3)
        assert asked["service"] == "/rosapi/topics"
        assert imu["type"] == "sensor_msgs/msg/Imu"
        assert (imu["throttle_rate"], imu["queue_length"]) == (100, 1)
        assert camera["compression"] == "cbor"
        await transport.close()


async def test_topic_is_advertised_once_a_connection_and_nothing_is_said_late() -> None:
    """What was published while there was no line is gone; the new one begins anew."""
    twist = Envelope("publish", {"topic": "/cmd_vel", "type": "geometry_msgs/Twist"}, {"x": 1})
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port)
        await transport.open(20.0)
        for _ in range(2):
            await transport.send(twist)
        said = (await robot.hears(4))[1:]  # after the question which topics there are
        assert [one["op"] for one in said] == ["advertise", "publish", "publish"]
        robot.clients[-1].transport.abort()
        with pytest.raises(PeerClosed):
            await heard(transport)
        for _ in range(100):  # a client that queued them would send them all at once
            with pytest.raises(TransportError):
                await transport.send(twist)
        robot.said.clear()
        await transport.open(20.0)
        await transport.send(Envelope("call", {"service": "/last", "id": 1}))
        assert (await robot.hears(2))[1]["service"] == "/last"
        await transport.close()


async def test_answers_find_their_questions(caplog: pytest.LogCaptureFixture) -> None:
    """Calls by their id, with why not; goals with feedback; nonsense is counted and survived."""
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port)
        await transport.open(20.0)
        await transport.send(Envelope("call", {"service": "/a", "id": 5}, {"x": float("nan")}))
        await transport.send(Envelope("call", {"service": "/b", "id": 6}, {}))
        first, second = (await robot.hears(3))[1:]
        assert first["args"] == {"x": None}
        await robot.say(
            {"op": "service_response", "id": second["id"], "values": "no", "result": False}
        )
        await robot.say({"op": "service_response", "id": "unknown", "values": {}, "result": True})
        await robot.say({"op": "dance"})
        await robot.say({"op": "service_response", "id": first["id"], "values": {"y": 1}})
        refused = await heard(transport)
        notices = [await heard(transport), await heard(transport)]
        answered = await heard(transport)
        assert [one.verb for one in notices] == ["notice", "notice"]
        assert "a frame of the bridge was dropped" in str(notices[1].body)
        assert "'dance' (2 such frames)" in str(notices[1].body)
        assert refused.attributes == {"id": 6, "ok": False, "reason": "no"}
        assert answered == Envelope("response", {"id": 5, "ok": True}, {"y": 1})
        goal = {"action": "/dock", "type": "a/action/Dock", "id": 7, "feedback": True}
        await transport.send(Envelope("goal", goal, {}))
        await transport.send(Envelope("cancel", {"action": "/dock"}))
        started, cancelled = (await robot.hears(5))[3:]
        assert cancelled == {"op": "cancel_action_goal", "id": started["id"], "action": "/dock"}
        about = {"id": started["id"], "action": "/dock"}
        await robot.say({"op": "action_feedback", **about, "values": {"left": 1}})
        await robot.say(
            {"op": "action_result", **about, "values": {}, "status": 5, "result": False}
        )
        assert await heard(transport) == Envelope(
            "feedback", {"action": "/dock", "id": 7}, {"left": 1}
        )
        ended = await heard(transport)
        assert (ended.attributes["ok"], ended.attributes["reason"]) == (
            False,
            "the action was cancelled",
        )
        await transport.close()
    assert "2 such frames" in caplog.text


async def test_stop_after_a_reconnection_cancels_the_goal() -> None:
    """The bridge does not cancel the goals of a lost client, and takes ids from any client."""
    goal = {"action": "/dock", "type": "a/action/Dock", "id": 7}
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port)
        await transport.open(20.0)
        await transport.send(Envelope("goal", goal, {}))
        started = (await robot.hears(2))[1]
        robot.clients[-1].transport.abort()
        with pytest.raises(PeerClosed):
            await heard(transport)
        robot.said.clear()
        await transport.open(20.0)
        await transport.send(Envelope("cancel", {"action": "/dock"}))
        assert (await robot.hears(2))[1] == {
            "op": "cancel_action_goal",
            "id": started["id"],
            "action": "/dock",
        }
        robot.clients[-1].transport.abort()  # perhaps before the bridge has read the frame
        robot.said.clear()
        await transport.open(20.0)
        again, asked = await robot.hears(2)
        assert (again["op"], again["id"]) == ("cancel_action_goal", started["id"])
        assert asked["op"] == "call_service"
        await transport.close()


async def test_topics_that_nobody_publishes_are_told_once() -> None:
    """The bridge itself says nothing about them, and would not for ever."""
    told = []
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port, TopicSubscription("/odom"), TopicSubscription("/lidar"))
        for count in (3, 6):
            await transport.open(20.0)
            asked = (await robot.hears(count))[-3]
            await robot.answer(asked, {"topics": ["/odom"], "types": ["nav_msgs/Odometry"]})
            await robot.say({"op": "publish", "topic": "/odom", "msg": {}})
            told += await notices(transport)
            await transport.close()
    assert told == ["nothing publishes /lidar"]


async def notices(transport: Transport) -> list[str]:
    """Return the notices before the next message."""
    told = []
    while (said := await heard(transport)).verb == NOTICE:
        told.append(str(said.body))
    return told


async def test_driving_where_nothing_listens_is_told() -> None:
    """The bridge takes every message; only rosapi knows that it moves nothing."""
    twist = Envelope("publish", {"topic": "/cmd_vel", "type": "geometry_msgs/Twist"}, {})
    stray = Envelope("publish", {"topic": "/nobody", "type": "geometry_msgs/Twist"}, {})
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port, TopicSubscription("/odom"), version=2)
        await transport.open(20.0)
        asked, _ = await robot.hears(2)
        types = {"/cmd_vel": "geometry_msgs/msg/TwistStamped", "/odom": "nav_msgs/msg/Odometry"}
        await robot.answer(asked, {"topics": list(types), "types": list(types.values())})
        await robot.say({"op": "publish", "topic": "/odom", "msg": {}})
        assert await notices(transport) == []
        for message in (twist, stray, twist, stray):
            await transport.send(message)
        operations = (await robot.hears(10))[2:]
        questions = [one for one in operations if one["op"] == "call_service"]
        assert [one["args"]["topic"] for one in questions] == ["/cmd_vel", "/nobody"]
        for question, nodes in zip(questions, (["/base"], []), strict=True):
            await robot.answer(question, {"subscribers": nodes})
        await robot.say({"op": "publish", "topic": "/odom", "msg": {}})
        assert await notices(transport) == [
            "/cmd_vel takes geometry_msgs/TwistStamped, not geometry_msgs/Twist",
            "nothing subscribes to /nobody: its messages have no effect",
        ]
        await transport.close()


@pytest.mark.parametrize(
    ("types", "spelled"),
    [(["nav_msgs/Odometry"], "nav_msgs/Odometry"), (["x/msg/Y"], "nav_msgs/msg/Odometry")],
)
async def test_a_line_spells_types_as_the_bridge_does(types: list[str], spelled: str) -> None:
    """``version: auto`` serves both versions: the answer comes before the subscriptions."""
    async with nothing_left(), bridge() as robot:
        odometry = TopicSubscription("/odom", {"type": "nav_msgs/Odometry"})
        transport = line(robot.port, odometry, version="auto")
        opening = asyncio.create_task(transport.open(20.0))
        (asked,) = await robot.hears(1)
        await robot.answer(asked, {"topics": ["/odom"], "types": types})
        await opening
        assert (await robot.hears(2))[1]["type"] == spelled
        await transport.close()


async def test_slow_taker_gets_the_newest() -> None:
    """The bridge is never held up; of one topic the oldest go, of the other none."""
    async with nothing_left(), bridge() as robot:
        transport = line(robot.port, TopicSubscription("/fast"), TopicSubscription("/rare"))
        await transport.open(20.0)
        await robot.hears(3)
        await robot.say({"op": "publish", "topic": "/rare", "msg": {"n": -1}})
        for number in range(2000):
            await robot.say({"op": "publish", "topic": "/fast", "msg": {"n": number}})
        got: list[int] = []
        while not got or got[-1] != 1999:
            message = await heard(transport)
            assert isinstance(message.body, dict)
            got.append(message.body["n"])
            await asyncio.sleep(0.001)
        assert got[0] == -1
        assert got[1:] == sorted(got[1:])
        await transport.close()


async def test_profile_drives_the_emulated_robot(rover: Profile) -> None:
    """The driver as it is, over a real socket: telemetry, a topic, a service, an action."""
    async with nothing_left(), emulated(rover) as port:
        settings = {"host": "127.0.0.1", "port": port}
        async with Session(rover, settings, built_in_catalog().transports) as session:
            with session.hub.subscribe() as news:
                async with asyncio.timeout(WAIT_S):
                    while session.hub.latest("x") is None:
                        await news.changed()
                        news.changes()
            for name, values in (("drive", {"speed": 0.5}), ("reset", {}), ("dock", {})):
                async with asyncio.timeout(WAIT_S):
                    await session.command(name, values)


async def test_a_fault_of_a_topic_is_in_the_robots_log(rover: Profile) -> None:
    """Who drives reads it on the page; the server's own log is elsewhere."""
    async with nothing_left(), bridge() as robot:
        settings = {"host": "127.0.0.1", "port": robot.port}
        async with Session(rover, settings, built_in_catalog().transports) as session:
            (asked, *_) = await robot.hears(2)
            await robot.answer(asked, {"topics": [], "types": []})
            with session.hub.subscribe() as news:
                async with asyncio.timeout(WAIT_S):
                    while "nothing publishes /odom" not in [
                        note.text for note in session.hub.notes
                    ]:
                        await news.changed()
                        news.changes()
            assert session.hub.links["ros"].state != "live", "it is no sign of life"


async def test_roslibpy_takes_the_emulated_robot_for_a_bridge(rover: Profile) -> None:
    """Topics, types, services of the robot and of other clients, and what they say of failures."""
    async with nothing_left(), emulated(rover) as port:
        said = await run(sys.executable, str(CLIENTS / "roslibpy_client.py"), str(port))
    assert said["topics"] == ["/cmd_vel", "/odom"]
    assert said["type"] == "nav_msgs/Odometry"
    assert said["heard"]["/echo"] == {"data": "grüezi / hello"}
    assert "position" in said["heard"]["/odom"]["pose"]["pose"]
    assert "does not exist" in said["unknown"]
    assert said["sum"] == 42


@pytest.mark.needs("node")
@pytest.mark.needs("roslib")
async def test_roslib_takes_the_emulated_robot_for_a_bridge(rover: Profile) -> None:
    """In JavaScript, with its own decoders of CBOR and PNG, and an action of ROS 2."""
    async with nothing_left(), emulated(rover) as port:
        said = await run(node_executable() or "node", str(CLIENTS / "roslib_client.mjs"), str(port))
    assert said["topics"]["topics"] == ["/cmd_vel", "/odom"]
    for compression in ("none", "cbor", "png"):
        assert said[compression] == {"data": f"grüezi by {compression}", "values": [1.5, None]}
    assert "does not exist" in said["nobody"]["why"]


@pytest.mark.needs("roscore")
async def test_twist_reaches_a_real_ros_master_and_odometry_comes_back(
    rover: Profile, tmp_path: Path
) -> None:
    """roscore and rospy behind the emulated bridge: ROS's own types and tools say what arrived."""
    port = free_port()
    environment = {
        "PATH": "/usr/local/sbin:/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": str(tmp_path),
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "LANG": "C.UTF-8",
    }
    env = ["env", "-i", *(f"{name}={value}" for name, value in environment.items())]
    glue_command = [
        *env, "/usr/bin/python3", str(CLIENTS / "rospy_glue.py"),
        "/cmd_vel", "geometry_msgs/Twist", "--", "/odom", "nav_msgs/Odometry",
    ]  # fmt: skip
    async with program(*env, "/usr/bin/rosmaster", "--core", "-p", str(port)):
        await listens(port)
        async with emulated(rover) as bridge_port, talking(*glue_command) as glue:
            assert json.loads(await answer(glue)) == {"ready": True}
            async with connect(f"ws://127.0.0.1:{bridge_port}", compression=None) as expectations:
                await expectations.send(json.dumps({"op": "subscribe", "topic": "/cmd_vel"}))
                await expectations.send(
                    json.dumps({"op": "advertise", "topic": "/odom", "type": "nav_msgs/Odometry"})
                )
                topics = (TopicSubscription("/odom", {"type": "nav_msgs/Odometry"}),)
                transport = line(bridge_port, *topics)
                await transport.open(20.0)
                twist = {"linear": {"x": 0.25}, "angular": {"z": -0.5}}
                kind = "geometry_msgs/Twist"
                await transport.send(
                    Envelope("publish", {"topic": "/cmd_vel", "type": kind}, twist)
                )

                said = json.loads(await asyncio.wait_for(expectations.recv(), WAIT_S))
                while said.get("topic") != "/cmd_vel":
                    said = json.loads(await asyncio.wait_for(expectations.recv(), WAIT_S))
                assert glue.stdin is not None
                glue.stdin.write(json.dumps(said).encode() + b"\n")
                seen = await output(*env, "rostopic", "echo", "-p", "-n", "1", "/cmd_vel")
                header, values = seen.split()[-2:]
                row = dict(zip(header.split(","), values.split(","), strict=True))
                assert (row["field.linear.x"], row["field.angular.z"]) == ("0.25", "-0.5")

                odometry = "{pose: {pose: {position: {x: 1.5}}}}"
                say = ["rostopic", "pub", "-r", "20", "/odom", "nav_msgs/Odometry", odometry]
                async with program(*env, *say):
                    told = json.loads(await answer(glue))
                await expectations.send(json.dumps({"op": "publish", **told}))
                while True:  # the emulated robot has an odometry of its own
                    message = await heard(transport)
                    assert isinstance(message.body, dict)
                    pose = message.body["pose"]["pose"]
                    if pose["position"]["x"] == 1.5:
                        break
                assert pose["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
                await transport.close()


@asynccontextmanager
async def talking(*command: str) -> AsyncIterator[asyncio.subprocess.Process]:
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe)
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):  # it has ended by itself
            process.kill()
        await process.wait()


async def answer(process: asyncio.subprocess.Process) -> bytes:
    assert process.stdout is not None
    return await asyncio.wait_for(process.stdout.readline(), WAIT_S)


async def output(*command: str) -> str:
    """Run a program to its end and return what it printed."""
    async with talking(*command) as process, asyncio.timeout(3 * WAIT_S):
        assert process.stdout is not None
        return (await process.stdout.read()).decode()


async def run(*command: str) -> Any:
    said = await output(*command)
    assert said, f"{os.path.basename(command[1])} said nothing"
    return json.loads(said.splitlines()[-1])
