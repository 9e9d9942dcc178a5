"""A robot in a namespace, behind each kind of ROS connection."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

import urc
from tests.e2e.dashboards import until
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from tests.e2e.transports.ros_bases import BASES, open_base
from urc.client.local import ConnectedRobot
from urc.problems import UrcError

pytestmark = pytest.mark.anyio

WAIT_S = 30.0
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  port: { type: port, required: true }
  line: { type: string, required: true }
  namespace: { type: string, default: "" }
transports:
  ros:
    type: ros
    via: "{{ settings.line }}"
    host: 127.0.0.1
    port: "{{ settings.port }}"
    version: 2
    namespace: "{{ settings.namespace }}"
signals:
  x: {}
  floor: { type: occupancy_grid }
  frames: { type: transform_tree }
messages:
  odom: { subscribe: { topic: odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
  map: { subscribe: { topic: /map, type: nav_msgs/OccupancyGrid }, json: { floor: "@" } }
  tf: { subscribe: { topic: tf, type: tf2_msgs/TFMessage }, json: { frames: "@" } }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1, default: 0 } }
    send: { publish: { topic: cmd_vel, type: geometry_msgs/Twist, stamped: true, json: { linear: { x: "{{ speed }}" } } } }
    hold: { repeat: 100ms, release: { speed: 0 }, watchdog: 500ms }
  lamp:
    send: { call: { service: lamp, type: std_srvs/Trigger } }
    reply: { json: { _text: message }, timeout: 5s }
"""  # noqa: E501


def value(robot: ConnectedRobot, name: str) -> Any:
    found = robot.latest(name)
    return None if found is None else found.value


@pytest.mark.parametrize("line", BASES)
async def test_relative_names_are_in_the_namespace_and_absolute_names_are_not(
    line: str, tmp_path: Path
) -> None:
    """Odometry, transforms and commands of the robot, and the map that all robots share."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    async with (
        open_base(line, tmp_path, "/fleet/robot1") as base,
        urc.connect(urc.load(file), port=base.port, line=line, namespace="fleet/robot1") as robot,
    ):
        async with asyncio.timeout(WAIT_S):
            await until(lambda: all(value(robot, name) for name in ("floor", "frames")))
            await until(lambda: value(robot, "x") is not None)
            names = {one["name"] for one in value(robot, "frames")["frames"]}
            assert {"map", "odom"} <= names
            async with robot.drive("drive") as stick:
                while not any(base.speeds):
                    await stick.hold(0.1, speed=0.5)
            await until(lambda: base.speeds[-1] == 0)


async def test_services_are_in_the_namespace_and_mistakes_name_the_whole_topic(
    tmp_path: Path,
) -> None:
    rover = FoxgloveRobot(encodings=("cdr",))
    asked: list[bytes] = []

    def lamp(data: bytes) -> bytes:
        asked.append(data)
        return b"\0\1\0\0\1\0\0\0\3\0\0\0on\0"

    rover.offer("/robot1/lamp", "std_srvs/srv/Trigger", lamp)
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    try:
        async with urc.connect(
            urc.load(file), port=rover.port, line="foxglove", namespace="robot1"
        ) as robot:
            await asyncio.sleep(0.5)
            await robot.command("lamp")
            assert len(asked) == 1
            async with asyncio.timeout(WAIT_S):
                await until(lambda: "nothing publishes /robot1/odom" in _notes(robot))
                await until(lambda: "nothing publishes /map" in _notes(robot))
    finally:
        rover.close()


def _notes(robot: ConnectedRobot) -> str:
    return "\n".join(line.text for line in robot.hub.notes)


async def test_an_invalid_namespace_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    with pytest.raises(UrcError, match="namespace: 'robot 1' is invalid: it must consist of"):
        async with urc.connect(urc.load(file), port=1, line="auto", namespace="robot 1"):
            pass


async def test_one_shipped_profile_serves_several_robots(tmp_path: Path) -> None:
    """Two robots behind one bridge differ by a setting."""
    robots = Path(__file__).resolve().parents[3] / "robots"
    for line in ("foxglove", "rosbridge"):
        async with (
            open_base(line, tmp_path, "/robot2") as base,
            urc.connect(
                urc.load(robots / "generic-ros2.yaml"),
                port=base.port,
                namespace="robot2",
                navigation=True,
                map="/map",
            ) as robot,
        ):
            async with asyncio.timeout(WAIT_S):
                await until(lambda robot=robot: value(robot, "x") is not None)
                await until(lambda robot=robot: value(robot, "floor") is not None)
