"""Simulated time: stamps follow `/clock`, and stops never do."""

import asyncio
import time
from pathlib import Path
from typing import Any

import pytest

import urc
from bench.rig.ros_messages import ROS2
from tests.e2e.dashboards import until
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from tests.e2e.transports.ros_bases import BASES, CLOCK, open_base
from tests.e2e.transports.ros_zenoh_robot import TREE
from urc.client.local import ConnectedRobot
from urc.client.stick import MotionEnded

pytestmark = pytest.mark.anyio

WAIT_S = 30.0
STOP_S = 1.0
TWIST = "geometry_msgs/msg/TwistStamped"
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  port: { type: port, required: true }
  line: { type: string, required: true }
  simulated: { type: boolean, default: true }
transports:
  ros:
    type: ros
    via: "{{ settings.line }}"
    host: 127.0.0.1
    port: "{{ settings.port }}"
    version: 2
    namespace: sim
    use_sim_time: "{{ settings.simulated }}"
signals:
  x: {}
  frames: { type: transform_tree }
messages:
  odom: { subscribe: { topic: odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
  tf: { subscribe: { topic: /tf, type: tf2_msgs/TFMessage }, json: { frames: "@" } }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1, default: 0 } }
    send: { publish: { topic: cmd_vel, type: geometry_msgs/Twist, stamped: true, json: { linear: { x: "{{ speed }}" } } } }
    hold: { repeat: 100ms, release: { speed: 0 }, watchdog: 500ms }
"""  # noqa: E501


def value(robot: ConnectedRobot, name: str) -> Any:
    found = robot.latest(name)
    return None if found is None else found.value


@pytest.mark.parametrize("line", BASES)
async def test_commands_carry_the_time_of_the_clock(line: str, tmp_path: Path) -> None:
    """The simulation stands still, and all its messages are newer than its clock."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    async with (
        open_base(line, tmp_path, "/sim") as base,
        urc.connect(urc.load(file), port=base.port, line=line) as robot,
        asyncio.timeout(WAIT_S),
    ):
        await until(lambda: value(robot, "x") is not None)
        async with robot.drive("drive") as stick:
            while CLOCK not in base.stamps:  # the clock is zero until its first message
                await stick.hold(0.1, speed=0.5)
        await until(lambda: base.speeds[-1] == 0)
        assert base.stamps[-1] == CLOCK
        assert set(base.stamps) <= {CLOCK, (0, 0)}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "rover.yaml"
    made.write_text(ROVER)
    return made


def _clock(rover: FoxgloveRobot, sec: int, nanosec: int = 0) -> None:
    moment = ROS2.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    clock = ROS2.types["rosgraph_msgs/msg/Clock"](clock=moment)
    rover.publish("/clock", "rosgraph_msgs/msg/Clock", clock)


def _transform(rover: FoxgloveRobot, sec: int, x: float) -> None:
    types = ROS2.types
    moment = types["builtin_interfaces/msg/Time"](sec=sec, nanosec=0)
    turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    move = types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0)
    one = types["geometry_msgs/msg/TransformStamped"](
        header=types["std_msgs/msg/Header"](moment, frame_id="map"),
        child_frame_id="odom",
        transform=types["geometry_msgs/msg/Transform"](translation=move, rotation=turn),
    )
    rover.publish("/tf", TREE, types[TREE](transforms=[one]))


def _heard(rover: FoxgloveRobot) -> list[tuple[float, int]]:
    """Return the speed and the seconds of each command."""
    found: list[Any] = [ROS2.deserialize_cdr(data, TWIST) for _, data in rover.heard]
    return [(one.twist.linear.x, one.header.stamp.sec) for one in found]


@pytest.mark.parametrize("clock", ["paused", "slow", "fast", "back", "none"])
async def test_a_lease_ends_in_real_time_whatever_the_clock_does(file: Path, clock: str) -> None:
    """A silent stick and a release end the motion, while the simulated time does as it likes."""
    rover = FoxgloveRobot()
    moment = {"sec": 1000}

    def tick() -> None:
        step = {"paused": 0, "slow": 0, "fast": 60, "back": -5, "none": 0}[clock]
        moment["sec"] = max(0, moment["sec"] + step)
        if clock != "none":
            _clock(rover, moment["sec"], int(time.monotonic() * 1e6) % 1000 * (clock == "slow"))

    async def run() -> None:
        while True:
            tick()
            await asyncio.sleep(0.02)

    ticking = asyncio.create_task(run())
    try:
        async with (
            urc.connect(urc.load(file), port=rover.port, line="foxglove") as robot,
            asyncio.timeout(WAIT_S),
        ):
            await until(lambda: robot.session.frames.is_ready("drive"))
            async with robot.drive("drive") as stick:
                while not any(speed for speed, _ in _heard(rover)):
                    await stick.hold(0.1, speed=0.5)
            async with asyncio.timeout(STOP_S):
                await until(lambda: _heard(rover)[-1][0] == 0)
            rover.heard.clear()
            try:
                async with robot.drive("drive") as stick:
                    stick(speed=0.25)  # sampled once: the lease is not renewed
                    await until(lambda: any(speed == 0.25 for speed, _ in _heard(rover)))
                    async with asyncio.timeout(STOP_S):
                        await until(lambda: _heard(rover)[-1][0] == 0)
            except MotionEnded:
                pass
            assert _heard(rover)[-1][0] == 0
            if clock == "paused":
                # A connection that a busy machine had to open again begins at zero.
                assert 1000 in (seconds := {sec for _, sec in _heard(rover)})
                assert seconds <= {0, 1000}
            if clock == "none":
                assert {sec for _, sec in _heard(rover)} == {0}
    finally:
        ticking.cancel()
        rover.close()


async def test_a_restarted_simulation_is_followed_at_once(file: Path) -> None:
    """Its transforms are older than the stored ones, by less than the limit for a set clock."""
    rover = FoxgloveRobot()
    try:
        async with (
            urc.connect(urc.load(file), port=rover.port, line="foxglove") as robot,
            asyncio.timeout(WAIT_S),
        ):

            def place() -> float:
                frames = value(robot, "frames")
                return -1.0 if frames is None else frames["frames"][-1]["translation"][0]

            def publish(sec: int, x: float) -> None:
                _clock(rover, sec)
                _transform(rover, sec, x)

            while place() != 1:
                publish(9, 1.0)
                await asyncio.sleep(0.05)
            _transform(rover, 5, 2.0)  # late, not restarted
            await asyncio.sleep(0.5)
            assert place() == 1
            began_s = time.monotonic()
            while place() != 3:
                publish(1, 3.0)
                await asyncio.sleep(0.05)
            assert time.monotonic() - began_s < 5
            notes = [line.text for line in robot.hub.notes]
            assert "the simulated clock went back by 8.000 s" in notes
    finally:
        rover.close()


async def test_two_programs_that_publish_the_clock_do_not_fill_the_log(file: Path) -> None:
    rover = FoxgloveRobot()
    try:
        async with (
            urc.connect(urc.load(file), port=rover.port, line="foxglove") as robot,
            asyncio.timeout(WAIT_S),
        ):

            def notes() -> list[str]:
                return [line.text for line in robot.hub.notes if "clock went back" in line.text]

            while not any("two programs publish /clock" in text for text in notes()):
                for sec in (9, 2):
                    _clock(rover, sec)
                await asyncio.sleep(0.02)
            for _ in range(50):
                for sec in (9, 2):
                    _clock(rover, sec)
                await asyncio.sleep(0.01)
            while value(robot, "frames") is None:  # it arrives after all earlier messages
                _transform(rover, 3, 1.0)
                await asyncio.sleep(0.05)
            assert len(notes()) == 3
    finally:
        rover.close()
