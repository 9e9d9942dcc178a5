"""Cameras that nobody looks at cost no bandwidth, over each line to a real bridge or router."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.transports.peers.zenoh import other_program, warm_up
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

pytestmark = pytest.mark.anyio

WAIT_S = 30.0
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  via: { type: string, required: true }
  port: { type: port, required: true }
transports:
  ros:
    type: ros
    via: "{{ settings.via }}"
    host: 127.0.0.1
    port: "{{ settings.port }}"
    version: 2
    stale_after: 3s
signals:
  x: { unit: m }
  front: { type: image }
  rear: { type: image }
messages:
  odometry: { subscribe: { topic: /odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
  front: { subscribe: { topic: /front, type: sensor_msgs/CompressedImage MORE }, json: { front: data } }
  rear: { subscribe: { topic: /rear, type: sensor_msgs/CompressedImage MORE }, json: { rear: data } }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1, default: 0 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: { linear: { x: "{{ speed }}" } }
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
"""  # noqa: E501


async def until(is_met: Callable[[], object]) -> None:
    async with asyncio.timeout(WAIT_S):
        while not is_met():  # noqa: ASYNC110 - the robot is another program
            await asyncio.sleep(0.05)


class Robot:
    """A robot of the benchmark, which counts its bytes, and a session like the server's."""

    def __init__(self, process: asyncio.subprocess.Process, session: Session) -> None:
        self._process = process
        self.hub = session.hub

    async def bytes_per_s(self) -> float:
        """Return the robot's rate over one second."""
        before = await self._count()
        await asyncio.sleep(1)
        return await self._count() - before

    async def _count(self) -> int:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(b"\n")
        return int((await self._process.stdout.readline()).split()[1])

    def at(self, name: str) -> float:
        """Return the time of a signal's newest reading."""
        sample = self.hub.latest(name)
        return -1.0 if sample is None else sample.time_s


@asynccontextmanager
async def opened(folder: Path, line: str) -> AsyncIterator[Robot]:
    via, _, compression = line.partition(" ")
    file = folder / "rover.yaml"
    file.write_text(ROVER.replace(" MORE", ", compression: cbor" if compression else ""), "utf-8")
    profile = load_profile(file, built_in_catalog())
    async with other_program("bench.peers.ros_streams", via) as process:
        assert process.stdout is not None
        port = int((await process.stdout.readline()).split()[1])
        settings, table = {"via": via, "port": port}, built_in_catalog().transports
        async with Session(
            profile, settings, table, motion="guarded", pauses_images=True
        ) as session:
            yield Robot(process, session)


@pytest.mark.parametrize("line", ["rosbridge", "rosbridge cbor", "foxglove", "zenoh"])
async def test_a_camera_is_sent_only_while_somebody_looks(tmp_path: Path, line: str) -> None:
    """The values go on, the connection stays live, and the camera comes back when it is shown."""
    warm_up()
    async with opened(tmp_path, line) as robot:
        with robot.hub.viewers.viewing(["front", "rear"]):
            await until(lambda: robot.at("rear") > 0)
            both = await robot.bytes_per_s()
        with robot.hub.viewers.viewing(["front"]):
            await asyncio.sleep(6)
            rear, x, front = robot.at("rear"), robot.at("x"), robot.at("front")
            one = await robot.bytes_per_s()
            assert robot.at("rear") == rear
            assert robot.at("front") > front
            assert robot.at("x") > x
        assert one < 0.75 * both
        await asyncio.sleep(6)
        assert await robot.bytes_per_s() < 0.25 * both
        assert robot.hub.links["ros"].state == "live"
        with robot.hub.viewers.viewing(["rear"]):
            await until(lambda: robot.at("rear") > rear)
