"""Transforms over foxglove_bridge's server and over rosbridge's protocol, to places on the map."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import urc
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from tests.e2e.transports.test_maps import ROBOT, header, made, odometry, turn, until
from urc.config.load import load_profile
from urc.protocol.values.occupancy_grid import Grid, read_grid
from urc.runtime.registries import built_in_catalog
from urc.simulator.server import serve as serve_robot

pytestmark = pytest.mark.anyio

TURTLEBOT = ROBOT.with_name("turtlebot4.yaml")
TREE = "tf2_msgs/msg/TFMessage"


def transform(parent: str, child: str, x: float, y: float, yaw: float) -> Any:
    """Return a message with one transform, as each program on a robot publishes its own."""
    shift = made("geometry_msgs/msg/Vector3", x=x, y=y, z=0.0)
    moved = made("geometry_msgs/msg/Transform", translation=shift, rotation=turn(yaw))
    stamped = made(
        "geometry_msgs/msg/TransformStamped",
        header=header(parent), child_frame_id=child, transform=moved,
    )  # fmt: skip
    return made(TREE, transforms=[stamped])


def scan(frame: str, ranges: list[float]) -> Any:
    return made(
        "sensor_msgs/msg/LaserScan",
        header=header(frame), angle_min=0.0, angle_max=math.pi, angle_increment=math.pi / 2,
        time_increment=0.0, scan_time=0.1, range_min=0.1, range_max=12.0,
        ranges=np.array(ranges, dtype=np.float32), intensities=np.array([], dtype=np.float32),
    )  # fmt: skip


def frames(robot: Any) -> list[Mapping[str, Any]]:
    found = robot.latest("frames")
    return [] if found is None else list(found.value["frames"])


async def test_two_programs_place_the_robot_and_its_scan_over_the_real_server() -> None:
    rover = FoxgloveRobot()
    try:
        async with urc.connect(
            urc.load(ROBOT), port=rover.port, bridge="foxglove", navigation=True
        ) as robot:

            def publish() -> None:
                quarter = math.pi / 2
                rover.publish("/tf", TREE, transform("map", "odom", 10.0, 20.0, quarter))
                rover.publish("/tf", TREE, transform("odom", "base_link", 2.0, 1.0, 0.0))
                fixed = transform("base_link", "laser", 0.5, 0.0, math.pi)
                rover.publish("/tf_static", TREE, fixed)
                rover.publish("/odom", "nav_msgs/msg/Odometry", odometry())
                seen = scan("laser", [1.0, math.inf, 2.0])
                rover.publish("/scan", "sensor_msgs/msg/LaserScan", seen)

            def near(name: str, *expected: float) -> bool:
                found = robot.latest(name)
                if found is None or found.value is None:
                    return False
                value = found.value if isinstance(found.value, tuple) else (found.value,)
                return value == pytest.approx(expected, abs=1e-5)

            # The robot stands at 9, 22 and looks along y; the laser looks backwards.
            await until(lambda: near("map_pose", 9.0, 22.0, math.pi / 2), publish)
            await until(lambda: near("map_laser", 9.0, 21.5, 9.0, 24.5), publish)
            await until(lambda: abs(robot.latest("scan_angle").value) > 3.14, publish)
            await until(lambda: len(frames(robot)) == 4, publish)
            assert [row["name"] for row in frames(robot)] == ["map", "odom", "base_link", "laser"]
            assert frames(robot)[3]["age"] is None
    finally:
        rover.close()


async def test_the_scan_of_an_emulated_turtlebot_lies_on_the_walls_of_its_map() -> None:
    """The map is drawn from the plan of the world; the points come through three transforms."""
    profile = load_profile(TURTLEBOT, built_in_catalog())
    settings = {name: one.default for name, one in profile.settings.items()} | {"port": 0}
    async with serve_robot(profile, settings) as listening:
        port = listening["ros"].port
        async with urc.connect(urc.load(TURTLEBOT), port=port, bridge="rosbridge") as robot:
            await until(lambda: all(robot.latest(one) for one in ("floor", "map_laser")))
            grid = read_grid(robot.latest("floor").value)
            points = robot.latest("map_laser").value
            assert len(points) > 60
            pairs = zip(points[::2], points[1::2], strict=True)
            share = sum(is_at_wall(grid, x, y) for x, y in pairs)
            assert share > 0.9 * len(points) / 2
            turned = robot.latest("scan_angle").value - robot.latest("first_angle").value
            assert math.remainder(turned - math.pi / 2, math.tau) == pytest.approx(0, abs=1e-6)
            await until(lambda: len(frames(robot)) == 4)  # the tree is sampled more rarely
            names = [row["name"] for row in frames(robot)]
            assert names == ["map", "odom", "base_link", "rplidar_link"]


def is_at_wall(grid: Grid, x: float, y: float) -> bool:
    """Return whether there is an occupied cell within 15 cm: noise, and cells of 5 cm."""
    column, row = ((x - grid.x) / grid.resolution, (y - grid.y) / grid.resolution)
    reach = math.ceil(0.15 / grid.resolution)
    cells = np.frombuffer(grid.cells, dtype=np.int8).reshape(grid.height, grid.width)
    near = cells[
        max(0, int(row) - reach) : int(row) + reach + 1,
        max(0, int(column) - reach) : int(column) + reach + 1,
    ]
    return bool((near == 100).any())
