"""The world's map as an occupancy grid, against the laser scanner of the same world."""

import math
from typing import Any

from urc.model.world import Box, PlanSpec, Wall
from urc.simulator.world.occupancy import RESOLUTION_M, occupancy_grid
from urc.simulator.world.plan import ROOM, WorldMap

ROBOT = (0.0, 0.0)


def cell(grid: dict[str, Any], x: float, y: float) -> int:
    info = grid["info"]
    origin, side = info["origin"]["position"], info["resolution"]
    column = math.floor((x - origin["x"]) / side)
    row = math.floor((y - origin["y"]) / side)
    value: int = grid["data"][row * info["width"] + column]
    return value


def test_the_room_is_free_its_walls_are_occupied_and_the_rest_is_unknown() -> None:
    grid = occupancy_grid(WorldMap(ROOM), ROBOT)
    assert len(grid["data"]) == grid["info"]["width"] * grid["info"]["height"]
    assert set(grid["data"]) == {-1, 0, 100}
    assert cell(grid, 0.0, 0.0) == 0
    assert cell(grid, 5.0, 3.0) == 0, "the other half, through the door"
    assert cell(grid, 2.6, 2.0) == 100, "the wall between the halves"
    assert cell(grid, 6.0, 0.0) == 100
    assert cell(grid, -2.6, 1.8) == -1, "the inside of a box, which no laser sees"
    assert cell(grid, 6.3, 0.0) == -1, "behind the wall"


def test_no_wall_has_a_gap() -> None:
    """A robot's planner would go through it."""
    plan = WorldMap(ROOM)
    grid = occupancy_grid(plan, ROBOT)
    for edge in plan.edges:
        for step in range(101):
            x = edge.x1 + (edge.x2 - edge.x1) * step / 100
            y = edge.y1 + (edge.y2 - edge.y1) * step / 100
            near = (-0.06, 0.0, 0.06)
            around = [cell(grid, x + dx, y + dy) for dx in near for dy in near]
            assert 100 in around, (x, y)


def test_a_wide_world_has_larger_cells_and_an_open_one_is_free() -> None:
    wide = PlanSpec(
        walls=(Wall(0, 0, 1000, 0, 1, "#000000"), Wall(0, 800, 1000, 800, 1, "#000000"))
    )
    grid = occupancy_grid(WorldMap(wide), (500.0, 400.0))
    assert len(grid["data"]) < 300_000
    assert grid["info"]["resolution"] > RESOLUTION_M
    empty = occupancy_grid(WorldMap(PlanSpec()), ROBOT)
    assert set(empty["data"]) == {-1, 0}


def test_a_robot_that_starts_in_a_box_sees_only_its_box() -> None:
    inside = PlanSpec(boxes=(Box(0, 0, 2, 2, 1, "#000000"), Box(8, 8, 1, 1, 1, "#000000")))
    grid = occupancy_grid(WorldMap(inside), ROBOT)
    assert cell(grid, 0.0, 0.0) == 0
    assert cell(grid, 5.0, 5.0) == -1
