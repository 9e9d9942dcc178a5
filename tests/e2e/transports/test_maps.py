"""Maps, plans, transforms and points over the server of the Foxglove SDK, made by rosbags."""

import asyncio
import math
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urc
from bench.rig.ros_messages import ROS2
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from urc.client import CommandFailed
from urc.protocol.values.occupancy_grid import read_grid
from urc.protocol.values.point_cloud import read_cloud

pytestmark = pytest.mark.anyio

ROBOT = Path(__file__).resolve().parents[3] / "robots" / "generic-ros2.yaml"
WIDTH, HEIGHT = 2000, 1500
WAIT_S = 30.0
GRID = "nav_msgs/msg/OccupancyGrid"
UPDATE = "\n".join(
    (
        "std_msgs/Header header",
        "int32 x",
        "int32 y",
        "uint32 width",
        "uint32 height",
        "int8[] data",
        "=" * 80,
        "MSG: std_msgs/Header",
        "builtin_interfaces/Time stamp",
        "string frame_id",
        "=" * 80,
        "MSG: builtin_interfaces/Time",
        "int32 sec",
        "uint32 nanosec",
    )
)
"""Definition of map_msgs/OccupancyGridUpdate, which rosbags does not have."""


async def until(is_so: Callable[[], bool], repeat: Callable[[], None] = lambda: None) -> None:
    async with asyncio.timeout(WAIT_S):
        while not is_so():
            repeat()
            await asyncio.sleep(0.1)


def made(name: str, **fields: Any) -> Any:
    return ROS2.types[name](**fields)


def header(frame: str) -> Any:
    stamp = made("builtin_interfaces/msg/Time", sec=1, nanosec=0)
    return made("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def turn(yaw: float) -> Any:
    z, w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w)


def pose(x: float, y: float, yaw: float = 0.0) -> Any:
    point = made("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
    return made("geometry_msgs/msg/Pose", position=point, orientation=turn(yaw))


def occupancy(cells: Any) -> Any:
    load = header("map").stamp
    info = made(
        "nav_msgs/msg/MapMetaData",
        map_load_time=load, resolution=0.05, width=WIDTH, height=HEIGHT, origin=pose(-50, -20, 0.3),
    )  # fmt: skip
    return made(GRID, header=header("map"), info=info, data=cells)


def plan() -> Any:
    ends = [(1.0, 2.0), (1.5, 2.0), (1.5, 3.0)]
    poses = [
        made("geometry_msgs/msg/PoseStamped", header=header("map"), pose=pose(x, y))
        for x, y in ends
    ]
    return made("nav_msgs/msg/Path", header=header("map"), poses=poses)


def transforms() -> Any:
    shift = made("geometry_msgs/msg/Vector3", x=10.0, y=20.0, z=0.0)
    moved = made("geometry_msgs/msg/Transform", translation=shift, rotation=turn(math.pi / 2))
    stamped = made(
        "geometry_msgs/msg/TransformStamped",
        header=header("map"), child_frame_id="odom", transform=moved,
    )  # fmt: skip
    return made("tf2_msgs/msg/TFMessage", transforms=[stamped])


def odometry() -> Any:
    zero = made("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    none = np.zeros(36)
    return made(
        "nav_msgs/msg/Odometry",
        header=header("odom"),
        child_frame_id="base_link",
        pose=made("geometry_msgs/msg/PoseWithCovariance", pose=pose(2.0, 1.0), covariance=none),
        twist=made(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=made("geometry_msgs/msg/Twist", linear=zero, angular=zero),
            covariance=none,
        ),
    )


async def test_a_large_map_a_plan_and_a_pose_arrive_over_the_real_server() -> None:
    """Three million cells, each with its value; the map is sent once, and a goal fails at once."""
    rover = FoxgloveRobot()
    cells = np.random.default_rng(7).integers(-1, 101, WIDTH * HEIGHT, dtype=np.int8)
    try:
        async with urc.connect(
            urc.load(ROBOT), port=rover.port, bridge="foxglove", navigation=True
        ) as robot:

            def publish() -> None:
                rover.publish("/odom", "nav_msgs/msg/Odometry", odometry())
                rover.publish("/plan", "nav_msgs/msg/Path", plan())
                rover.publish("/tf", "tf2_msgs/msg/TFMessage", transforms())
                if robot.latest("floor") is None:
                    rover.publish("/map", GRID, occupancy(cells))

            names = ("floor", "map_plan", "goal_y", "frames", "map_x")
            await until(lambda: all(robot.latest(one) for one in names), publish)

            def near(name: str, expected: float) -> bool:
                found = robot.latest(name)
                return found is not None and found.value == pytest.approx(expected)

            await until(lambda: near("map_x", 9.0) and near("map_y", 22.0), publish)
            assert near("map_yaw", math.pi / 2)
            assert near("goal_y", 3.0)
            found: Any = robot.latest("map_plan")
            assert found.value == (1.0, 2.0, 1.5, 2.0, 1.5, 3.0)
            floor: Any = robot.latest("floor")
            grid = read_grid(floor.value)
            assert (grid.width, grid.height, grid.frame) == (WIDTH, HEIGHT, "map")
            assert (grid.x, grid.y, grid.yaw) == pytest.approx((-50, -20, 0.3))
            assert grid.cells == cells.tobytes()
            with pytest.raises(CommandFailed, match="start it with include_hidden: true"):
                await robot.command("navigate", to_x=1.0, to_y=1.0)
            await robot.command("stop_navigation")
    finally:
        rover.close()


async def test_a_large_point_cloud_arrives_thinned_over_the_real_server(tmp_path: Path) -> None:
    """115,200 points of 64 rings become 5000 points, of all rings."""
    file = tmp_path / "seer.yaml"
    file.write_text(SEER, encoding="utf-8")
    rows, rings = 1800, 64
    points = np.zeros(rows * rings, dtype=[(name, "<f4") for name in "xyzi"] + [("t", "<u4")])
    points["x"] = np.arange(rows * rings) // rings
    points["y"] = np.arange(rows * rings) % rings
    points["z"][::7] = np.nan
    names = ("x", "y", "z", "i")
    fields = [
        ROS2.types["sensor_msgs/msg/PointField"](name, 4 * at, 7, 1)
        for at, name in enumerate(names)
    ]
    cloud = made(
        "sensor_msgs/msg/PointCloud2",
        header=header("lidar"), height=1, width=len(points), fields=fields, is_bigendian=False,
        point_step=20, row_step=20 * len(points), data=points.view(np.uint8), is_dense=False,
    )  # fmt: skip
    rover = FoxgloveRobot()
    try:
        async with urc.connect(urc.load(file), port=rover.port) as robot:

            def publish() -> None:
                rover.publish("/points", "sensor_msgs/msg/PointCloud2", cloud)

            await until(lambda: robot.latest("cloud") is not None, publish)
            latest: Any = robot.latest("cloud")
    finally:
        rover.close()
    found = read_cloud(latest.value)
    values = np.frombuffer(found.points, "<f4").reshape(-1, 4)
    assert (found.frame, found.colour, found.total) == ("lidar", "i", len(points))
    assert 0.8 * 5000 < len(values) <= 5000
    assert np.isfinite(values).all()
    assert set(values[:, 1]) == set(range(rings))


SEER = """
urc: 1
kind: robot
name: seer
settings: { port: { type: port, default: 8765 } }
transports: { ros: { type: ros, via: foxglove, host: 127.0.0.1, port: "{{ settings.port }}" } }
signals: { cloud: { type: point_cloud, size: 5000 } }
messages:
  points:
    subscribe: { topic: /points, type: sensor_msgs/PointCloud2 }
    json: { cloud: "@" }
"""


async def test_a_robot_without_nav2_is_asked_for_none_of_its_topics() -> None:
    rover = FoxgloveRobot()
    try:
        async with urc.connect(urc.load(ROBOT), port=rover.port, bridge="foxglove") as robot:

            def publish() -> None:
                rover.publish("/odom", "nav_msgs/msg/Odometry", odometry())
                rover.publish("/tf", "tf2_msgs/msg/TFMessage", transforms())

            await until(lambda: robot.latest("map_x") is not None, publish)
            assert "/tf" not in rover.subscribed
            with pytest.raises(CommandFailed, match="Map and goals are off in the settings"):
                await robot.command("navigate", to_x=1.0, to_y=1.0)
    finally:
        rover.close()


async def test_changes_of_a_large_map_leave_the_event_loop_free() -> None:
    """The processor time between two turns of the loop counts, so a busy computer is no fault."""
    rover = FoxgloveRobot()
    cells = np.random.default_rng(7).choice([0, 0, 0, -1, 100, 50], WIDTH * HEIGHT).astype(np.int8)
    turns: list[float] = []

    async def watch() -> None:
        last = time.thread_time()
        while True:
            await asyncio.sleep(0)
            now = time.thread_time()
            turns.append(now - last)
            last = now

    try:
        async with urc.connect(
            urc.load(ROBOT), port=rover.port, bridge="foxglove", navigation=True
        ) as robot:

            def publish() -> None:
                if robot.latest("floor") is None:
                    rover.publish("/map", GRID, occupancy(cells))

            await until(lambda: robot.latest("floor") is not None, publish)
            await asyncio.sleep(1.0)
            watching = asyncio.create_task(watch())
            for number in range(1, 6):
                change(rover, number)

                def is_shown(expected: int = number) -> bool:
                    floor: Any = robot.latest("floor")
                    grid = read_grid(floor.value)
                    return grid.cells[0] == expected

                async with asyncio.timeout(WAIT_S):
                    while not await asyncio.to_thread(is_shown):
                        change(rover, number)
                        await asyncio.sleep(0.2)
            watching.cancel()
            assert max(turns) < 0.03, "encoding this map takes more than 0.04 s"
    finally:
        rover.close()


def change(rover: FoxgloveRobot, value: int) -> None:
    """Set one cell, the first one of the map, as map_server and slam_toolbox do."""
    name = "map_msgs/msg/OccupancyGridUpdate"
    where = struct.pack("<iiIII", 0, 0, 1, 1, 1)
    data = b"\0\1\0\0" + struct.pack("<iII4s", 1, 0, 4, b"map\0") + where + bytes([value])
    rover.publish("/map_updates", name, data, UPDATE)
