"""The map of the world: obstacle edges and holes.

Pure. Lengths are in metres.
"""

import math
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

from urc.model.world import Box, PlanSpec, Wall

__all__ = ["ROOM", "Edge", "WorldMap", "Contact"]


class Edge(NamedTuple):
    """A vertical face of an obstacle, starting at the ground."""

    x1: float
    y1: float
    x2: float
    y2: float
    height: float
    colour: str


class Contact(NamedTuple):
    """Overlap of a circle, such as a robot's outline, with an edge."""

    x: float
    y: float
    depth: float
    """Depth of the overlap in metres, greater than 0."""


ROOM: Final = PlanSpec(
    walls=(
        Wall(-4.0, -3.5, 6.0, -3.5, 2.4, "#c9c2b4"),
        Wall(6.0, -3.5, 6.0, 3.5, 2.4, "#8fa9bf"),
        Wall(6.0, 3.5, -4.0, 3.5, 2.4, "#cdb894"),
        Wall(-4.0, 3.5, -4.0, -3.5, 2.4, "#a8b89a"),
        Wall(2.6, -3.5, 2.6, -1.2, 2.4, "#b7b2c8"),
        Wall(2.6, 0.6, 2.6, 3.5, 2.4, "#b7b2c8"),
    ),
    boxes=(
        Box(-2.6, 1.8, 0.9, 0.6, 0.75, "#a5794b"),
        Box(0.8, -2.3, 0.6, 0.6, 0.45, "#b08a4a"),
        Box(4.6, -2.4, 1.0, 0.8, 0.9, "#7d8894"),
        Box(1.7, 1.9, 0.3, 0.3, 1.3, "#d03a3a"),
        Box(-3.2, -2.6, 0.3, 0.3, 1.3, "#2f7fd0"),
        Box(5.3, 2.7, 0.3, 0.3, 1.3, "#e0b020"),
        Box(3.9, 0.9, 0.3, 0.3, 1.3, "#39a05a"),
    ),
    holes=(Box(5.2, -0.6, 1.0, 1.0),),
)
"""The default room, 10 by 7 m. The room contains boxes, four coloured posts and descending stairs.
A wall with a door divides the room into two halves."""


class WorldMap:
    """The world map, prepared for collision tests."""

    def __init__(self, spec: PlanSpec) -> None:
        """Convert the walls, boxes and holes of `spec` for collision tests."""
        self.spec = spec
        edges = [Edge(*wall) for wall in spec.walls]
        for box in spec.boxes:
            edges += _faces(box)
        self.edges = tuple(edges)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Minimum x, minimum y, maximum x and maximum y of all obstacles, in metres.

        Without obstacles, the bounds are a square with sides of 10 m.
        """
        if not self.edges:
            return -5.0, -5.0, 5.0, 5.0
        xs = [value for edge in self.edges for value in (edge.x1, edge.x2)]
        ys = [value for edge in self.edges for value in (edge.y1, edge.y2)]
        return min(xs), min(ys), max(xs), max(ys)

    def touch(self, x: float, y: float, z: float, radius: float) -> Contact | None:
        """Return the deepest overlap of an edge with a circle at height `z`, or None."""
        deepest: Contact | None = None
        for edge in self.edges:
            if z >= edge.height:
                continue
            px, py = _nearest(edge, x, y)
            depth = radius - math.hypot(x - px, y - py)
            if depth > 0 and (deepest is None or depth > deepest.depth):
                deepest = Contact(px, py, depth)
        return deepest

    def is_hole(self, x: float, y: float) -> bool:
        """Return whether a point lies over a hole."""
        return any(
            abs(x - hole.x) <= hole.width / 2 and abs(y - hole.y) <= hole.depth / 2
            for hole in self.spec.holes
        )


def _faces(box: Box) -> list[Edge]:
    left, right = box.x - box.width / 2, box.x + box.width / 2
    low, high = box.y - box.depth / 2, box.y + box.depth / 2
    corners = ((left, low), (right, low), (right, high), (left, high), (left, low))
    return [Edge(*start, *end, box.height, box.colour) for start, end in pairwise(corners)]


def _nearest(edge: Edge, x: float, y: float) -> tuple[float, float]:
    """Return the point on an edge that is nearest to a given point."""
    dx, dy = edge.x2 - edge.x1, edge.y2 - edge.y1
    length = dx * dx + dy * dy
    share = ((x - edge.x1) * dx + (y - edge.y1) * dy) / length if length else 0.0
    share = min(1.0, max(0.0, share))
    return edge.x1 + share * dx, edge.y1 + share * dy
