"""The world's map as a ROS message: the occupancy grid that a mapping robot would publish.

Pure. Cells with an edge of an obstacle are occupied. Cells that a robot can reach from its start
are free. All other cells are unknown, such as the insides of obstacles and the surroundings of
the room.
"""

import math
from typing import Any, Final

from urc.simulator.world.plan import WorldMap

__all__ = ["RESOLUTION_M", "costmap", "occupancy_grid"]

RESOLUTION_M: Final = 0.1
"""Side of a cell in metres."""
_MARGIN: Final = 5
"""Unknown cells around the obstacles."""
_MOST_CELLS: Final = 40_000
"""Maximum number of cells; in a larger world, the cells are larger. Computing the map and its costs
takes less than 0.1 s, once; meanwhile, emulated robots do not answer."""
_FREE: Final = 0
_OCCUPIED: Final = 100
_UNKNOWN: Final = -1
_INSCRIBED: Final = 99
"""Cost of a cell in which the robot would touch an obstacle."""
_FALL: Final = 3.0
"""Fall of the cost with the distance from an obstacle, per metre; the default of Nav2."""


def occupancy_grid(plan: WorldMap, start: tuple[float, float]) -> dict[str, Any]:
    """Return the grid as the fields of nav_msgs/OccupancyGrid.

    Args:
        plan: the obstacles.
        start: x and y of the robot at the start, in metres.
    """
    low_x, low_y, high_x, high_y = plan.bounds
    side = max(RESOLUTION_M, math.sqrt(max(0.0, (high_x - low_x) * (high_y - low_y)) / _MOST_CELLS))
    x, y = low_x - _MARGIN * side, low_y - _MARGIN * side
    width = math.ceil((high_x - low_x) / side) + 2 * _MARGIN
    height = math.ceil((high_y - low_y) / side) + 2 * _MARGIN
    cells = [_UNKNOWN] * (width * height)
    for edge in plan.edges:
        steps = max(1, math.ceil(2 * math.hypot(edge.x2 - edge.x1, edge.y2 - edge.y1) / side))
        for step in range(steps + 1):
            column = math.floor((edge.x1 + (edge.x2 - edge.x1) * step / steps - x) / side)
            row = math.floor((edge.y1 + (edge.y2 - edge.y1) * step / steps - y) / side)
            cells[row * width + column] = _OCCUPIED
    _fill(cells, width, math.floor((start[0] - x) / side), math.floor((start[1] - y) / side))
    return {
        "header": {"frame_id": "map"},
        "info": {
            "resolution": side,
            "width": width,
            "height": height,
            "origin": {
                "position": {"x": x, "y": y, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
        },
        "data": cells,
    }


def costmap(grid: dict[str, Any], radius: float) -> dict[str, Any]:
    """Return the costs of a grid for a robot with `radius` in metres, as Nav2's inflation layer."""
    width, side = grid["info"]["width"], grid["info"]["resolution"]
    costs = [0] * len(grid["data"])
    ring = [at for at, cell in enumerate(grid["data"]) if cell == _OCCUPIED]
    for at in ring:
        costs[at] = _OCCUPIED
    distance = 0.0
    while ring:
        distance += side
        far = max(0.0, distance - radius)
        cost = round((_INSCRIBED - 1) * math.exp(-_FALL * far)) if far else _INSCRIBED
        if cost <= 1:
            break
        beside = {at + step for at in ring for step in (1, -1, width, -width)}
        ring = [at for at in beside if 0 <= at < len(costs) and not costs[at]]
        for at in ring:
            costs[at] = cost
    return {**grid, "data": costs}


def _fill(cells: list[int], width: int, column: int, row: int) -> None:
    """Mark the cells as free that are connected with the start, up to obstacles and the border."""
    height = len(cells) // width
    waiting = [(column, row)]
    while waiting:
        column, row = waiting.pop()
        is_inside = 0 < column < width - 1 and 0 < row < height - 1
        if is_inside and cells[row * width + column] == _UNKNOWN:
            cells[row * width + column] = _FREE
            waiting += [(column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)]
