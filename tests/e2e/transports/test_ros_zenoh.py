"""ROS 2 over Zenoh: a robot in a process of its own, whose messages are written by rosbags."""

import asyncio
import json
import re
import struct
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xxhash

from tests.e2e.ports import free_port
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.peers.zenoh import other_program, warm_up
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.protocol.values.point_cloud import read_cloud
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session
from urc.transports.base import (
    NOTICE,
    ConnectFailed,
    PeerClosed,
    TopicSubscription,
    Transport,
    TransportError,
    TransportSetup,
)
from urc.transports.ros.choice import from_setup

pytestmark = pytest.mark.anyio

WAIT_S = 20.0
DISTROS = pytest.mark.parametrize("distro", ["humble", "jazzy"])
TWIST = "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  port: { type: port, default: 7447 }
  distro: { type: string, default: jazzy }
  bridge: { type: string, default: zenoh }
transports:
  ros:
    type: ros
    via: "{{ settings.bridge }}"
    host: 127.0.0.1
    port: "{{ settings.port }}"
    ros2: { domain: 0, distro: "{{ settings.distro }}" }
    reconnect: { initial: 50ms, max: 100ms }
signals:
  x: { type: number, unit: m }
  word: { type: string }
  map: { type: string }
  odd: { type: integer }
  cloud: { type: point_cloud }
  ahead: { type: number, unit: m, frame: laser }
  frames: { type: transform_tree }
  seen: { type: array, value: "[ahead, 0]", frame: map, transform: points }
messages:
  odom:
    subscribe: { topic: /odom, type: nav_msgs/Odometry }
    json: { x: pose.pose.position.x, ahead: pose.pose.orientation.w }
  moving:
    subscribe: { topic: /tf, type: tf2_msgs/TFMessage, throttle: 500ms }
    json: { frames: "@" }
  fixed: { subscribe: { topic: /tf_static, type: tf2_msgs/TFMessage }, json: { frames: "@" } }
  word: { subscribe: { topic: /robot1/chatter, throttle: 200ms }, json: { word: data } }
  map: { subscribe: { topic: /robot1/map_name, type: std_msgs/String }, json: { map: data } }
  odd: { subscribe: { topic: /odd, type: std_msgs/Int32 }, json: { odd: data } }
  points: { subscribe: { topic: /points, type: sensor_msgs/PointCloud2 }, json: { cloud: "@" } }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1, default: 0 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: { linear: { x: "{{ speed }}" } }
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
  nudge:
    args: { speed: { type: number } }
    send:
      publish:
        topic: /cmd_stamped
        type: geometry_msgs/Twist
        stamped: true
        json: { linear: { x: "{{ speed }}" } }
  into_nothing: { send: { publish: { topic: /nobody, type: std_msgs/Int32, json: { data: 1 } } } }
  reset: { send: { call: { service: /reset, type: std_srvs/Trigger } } }
"""


@pytest.fixture(autouse=True)
def _warm() -> None:
    warm_up()


class Robot:
    """The other program and what it prints."""

    def __init__(self, process: asyncio.subprocess.Process, port: int) -> None:
        self._process = process
        self.port = port
        self.tokens: list[str] = []

    async def next(self, kind: str, **having: object) -> Mapping[str, object]:
        """Return the next line of a kind; keep the tokens of all lines before."""
        assert self._process.stdout is not None
        async with asyncio.timeout(WAIT_S):
            while told := await self._process.stdout.readline():
                found: Mapping[str, object] = json.loads(told)
                if found["kind"] == "token":
                    self.tokens.append(str(found["key"]))
                if found["kind"] == kind and having.items() <= found.items():
                    return found
        raise AssertionError("the robot has ended")


@asynccontextmanager
async def robot(distro: str, port: int = 0) -> AsyncIterator[Robot]:
    port = port or free_port()
    async with other_program("tests.e2e.transports.ros_zenoh_robot", str(port), distro) as process:
        made = Robot(process, port)
        await made.next("ready")
        yield made


@asynccontextmanager
async def driven(folder: Path, port: int, distro: str) -> AsyncIterator[Session]:
    path = folder / "rover.yaml"
    path.write_text(ROVER)
    profile = load_profile(path, built_in_catalog())
    settings = {"port": port, "distro": distro, "bridge": "zenoh"}
    async with Session(profile, settings, built_in_catalog().transports) as session:
        yield session


async def until(fits: Callable[[], bool]) -> None:
    async with asyncio.timeout(WAIT_S):
        while not fits():  # noqa: ASYNC110 - several things are waited for in this way
            await asyncio.sleep(0.02)


def value(session: Session, name: str) -> object:
    found = session.hub.latest(name)
    return None if found is None else found.value


@DISTROS
async def test_topics_are_read_and_published(distro: str, tmp_path: Path) -> None:
    """CDR by rosbags both ways, kept messages, and a type whose definition differs."""
    async with nothing_left(), robot(distro) as other:
        async with driven(tmp_path, other.port, distro) as session:
            await until(lambda: isinstance(value(session, "x"), float))
            before = value(session, "x")
            await until(lambda: value(session, "x") != before)
            await until(lambda: value(session, "map") == "kept")
            await until(lambda: isinstance(value(session, "cloud"), bytes))
            cloud = value(session, "cloud")
            assert isinstance(cloud, bytes)
            points = np.frombuffer(read_cloud(cloud).points, "<f4").reshape(-1, 4)
            assert points[[0, 24, 25, 99]].tolist() == [
                [0, 0, 0, 7],
                [0, 24, 0, 7],
                [1, 0, 0, 7],
                [3, 24, 0, 7],
            ]
            await until(lambda: re.fullmatch(r"hello \d+", str(value(session, "word"))) is not None)
            assert value(session, "odd") is None, "it was read by another definition"
            await session.command("nudge", {"speed": 0.25})
            told = await other.next("heard", topic="cmd_stamped")
            message = told["message"]
            assert isinstance(message, dict)
            assert message["twist"]["linear"] == {"x": 0.25, "y": 0.0, "z": 0.0}
            assert message["header"]["stamp"]["sec"] > 1_600_000_000, "it has no time"
            assert told["number"] == 1
            assert abs(float(str(told["age_s"]))) < 5.0
            with pytest.raises(CommandFailed, match="carries topics, but no call"):
                await session.command("reset", {})
        gone = await other.next("gone")
        assert "/NN/" in str(gone["key"]) or "/M" in str(gone["key"])


@DISTROS
async def test_transforms_of_several_programs_form_one_tree(distro: str, tmp_path: Path) -> None:
    """The static transform was sent before URC connected; the others alternate on one topic."""
    async with robot(distro) as other, driven(tmp_path, other.port, distro) as session:
        await until(lambda: value(session, "seen") is not None)
        await until(lambda: len(rows(session)) == 4)
        assert [(row["name"], row["parent"]) for row in rows(session)] == [
            ("map", ""), ("odom", "map"), ("base_link", "odom"), ("laser", "base_link"),
        ]  # fmt: skip
        await until(lambda: value(session, "seen") == pytest.approx((9.0, 2.5)))
        assert rows(session)[3]["age"] is None
        assert rows(session)[1]["age"] < 1
        assert rows(session)[1]["stamp"] == 12.0


def rows(session: Session) -> list[Mapping[str, Any]]:
    """Return the frames of the transform tree."""
    found = value(session, "frames")
    return list(found["frames"]) if isinstance(found, Mapping) else []


@DISTROS
async def test_robot_sees_a_node_with_its_topics(distro: str, tmp_path: Path) -> None:
    """The tokens are valid, and the identifier of the messages is the hash of one of them."""
    async with robot(distro) as other, driven(tmp_path, other.port, distro) as session:
        await until(lambda: isinstance(value(session, "x"), float))
        await session.command("nudge", {"speed": 0.25})
        told = await other.next("heard", topic="cmd_stamped")
        while not any("/MP/" in key for key in other.tokens):  # printed by another thread
            await other.next("token")
        nodes = [key for key in other.tokens if "/NN/" in key]
        assert len(nodes) == 1
        head = re.fullmatch(r"(@ros2_lv/0/[0-9a-f]{1,32}/0)/0/NN/%/%/(urc_[0-9a-f]{6})", nodes[0])
        assert head is not None
        hashed = r"TypeHashNotSupported" if distro == "humble" else r"RIHS01_[0-9a-f]{64}"
        own = rf"{head[1]}/\d+/M[PS]/%/%/{head[2]}/%[^/]+/[a-z0-9_]+::msg::dds_::\w+_/{hashed}"
        rest = [key for key in other.tokens if "/NN/" not in key]
        assert all(re.fullmatch(own + r"/::,10:,:,:,,", key) for key in rest), rest
        topics = {key.split("/")[9] for key in rest if "/MS/" in key}
        assert topics == {"%odom", "%robot1%map_name", "%odd", "%points", "%tf", "%tf_static"}
        (published,) = [key for key in rest if "/MP/" in key]
        gid = xxhash.xxh3_128_intdigest(published.encode()).to_bytes(16, "little")
        assert told["gid"] == gid.hex()


async def test_graph_is_told_again_after_a_loss() -> None:
    """The new robot sees the same publisher before it is sent a message."""
    port = free_port()
    line = from_setup(TransportSetup("ros", {"via": "zenoh", "host": "127.0.0.1", "port": port}))
    said = {"topic": "/cmd_vel", "type": "geometry_msgs/Twist", "hash": TWIST}
    data = b"\0\1\0\0" + bytes(48)
    async with nothing_left():
        async with robot("jazzy", port) as other:
            await line.open(WAIT_S)
            await line.send(Envelope("publish", {**said, "encoding": "cdr", "data": data}))
            told = await other.next("heard", topic="cmd_vel")
            assert (told["number"], told["cdr"]) == (1, data.hex())
        with pytest.raises(PeerClosed):
            await asyncio.wait_for(receives_on(line), WAIT_S)
        async with robot("jazzy", port) as other:
            await line.open(WAIT_S)
            while not any("/MP/" in key and "%cmd_vel" in key for key in other.tokens):
                await other.next("token")
            await line.close()


async def receives_on(line: Transport) -> None:
    while True:
        await line.receive()


async def test_message_that_the_robot_could_not_read_is_refused() -> None:
    """A different definition, an unknown type, an invalid name, a latched topic."""
    int32 = "RIHS01_b6578ded3c58c626cfe8d1a6fb6e04f706f97e9f03d2727c9ff4e74b1cef0deb"
    known = {"type": "std_msgs/Int32", "hash": int32, "data": b"\0\1\0\0\1\0\0\0"}
    refused = {
        "definition of std_msgs/msg/Int32 differs": {**known, "topic": "/other"},
        "does not know the type my_msgs/Own": {"topic": "/own", "type": "my_msgs/Own"},
        "cannot publish to '/a/../*'": {**known, "topic": "/a/../*"},
        "cannot latch a topic": {**known, "topic": "/light", "retain": True},
    }
    async with nothing_left(), robot("jazzy") as other:
        options = {"via": "zenoh", "host": "127.0.0.1", "port": other.port}
        line = from_setup(TransportSetup("ros", options))
        await line.open(WAIT_S)
        await asyncio.sleep(0.2)  # until it knows the robot's subscriptions
        for why, said in refused.items():
            with pytest.raises(TransportError, match=re.escape(why)):
                await line.send(Envelope("publish", said))
        await line.close()


async def test_stop_does_not_fail_for_a_cancel_and_the_log_says_so_once() -> None:
    """Zenoh carries no actions; a failed stop command would be sent again for ever."""
    async with nothing_left(), robot("jazzy") as other:
        options = {"via": "zenoh", "host": "127.0.0.1", "port": other.port}
        line = from_setup(TransportSetup("ros", options))
        await line.open(WAIT_S)
        for _ in range(2):
            await line.send(Envelope("cancel", {"action": "/dock"}))
        await line.send(Envelope("call", {"service": "/a", "id": 1}))
        told = [await asyncio.wait_for(line.receive(), WAIT_S) for _ in range(2)]
        text = "ros over zenoh carries no actions: no goal is cancelled"
        assert told[0] == Envelope(NOTICE, {}, text)
        assert isinstance(told[1], Envelope)
        assert told[1].verb == "response"
        await line.close()


async def test_mistakes_are_told(tmp_path: Path) -> None:
    """A topic without readers, a topic without publishers, and a wrong type."""
    wrong = (
        TopicSubscription("/gone", {"type": "std_msgs/String"}),
        TopicSubscription("/odom", {"type": "nav_msgs/Path"}),
    )
    async with robot("jazzy") as other:
        options = {"via": "zenoh", "host": "127.0.0.1", "port": other.port}
        line = from_setup(TransportSetup("ros", options, wrong))
        await line.open(WAIT_S)
        said = {(await asyncio.wait_for(line.receive(), WAIT_S)).body for _ in wrong}
        assert said == {
            "nothing publishes /gone",
            "/odom carries nav_msgs/Odometry, not nav_msgs/Path",
        }
        await line.close()
        async with driven(tmp_path, other.port, "jazzy") as session:
            await until(lambda: isinstance(value(session, "x"), float))
            assert await session.settle() == ""
            await session.command("into_nothing", {})
            assert await session.settle() == "nothing subscribes to /nobody"


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"ros2": {"domain": 233}}, "ros needs 0 to 232 as ros2.domain, not 233"),
        ({"ros2": {"domain": True}}, "ros needs 0 to 232 as ros2.domain, not True"),
        ({"ros2": {"distro": "foxy"}}, "as ros2.distro, not 'foxy'"),
        ({"ros2": 7}, "ros needs domain and distro as ros2, not 7"),
        ({"host": ""}, "host must be a host name or address"),
    ],
)
def test_invalid_option_is_told(options: dict[str, object], why: str) -> None:
    setup = TransportSetup("ros", {"via": "zenoh", "host": "127.0.0.1", **options})
    with pytest.raises(TransportError, match=re.escape(why)):
        from_setup(setup)


async def test_nobody_there_is_told_at_once() -> None:
    line = from_setup(
        TransportSetup("ros", {"via": "zenoh", "host": "127.0.0.1", "port": free_port()})
    )
    with pytest.raises(ConnectFailed, match="nothing listens"):
        await line.open(5.0)


def test_odometry_of_the_robot_is_little_endian_cdr() -> None:
    """The test's own robot: what rosbags writes begins like CDR."""
    from tests.e2e.transports.ros_zenoh_robot import odometry

    data = odometry(1.5)
    assert data[:4] == b"\0\1\0\0"
    assert struct.pack("<d", 1.5) in data
