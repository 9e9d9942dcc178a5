"""Vectorised intersection of rays with the edges of a world map.

Pure. The module imports numpy, so it is loaded only on first use.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from urc.simulator.world.plan import Edge, WorldMap

__all__ = ["EdgeArrays", "cast", "first_hits"]

Numbers = NDArray[np.floating]
_NEAREST: Final = 1e-6


class EdgeArrays:
    """The edges of a world map as arrays."""

    def __init__(self, plan: WorldMap) -> None:
        """Convert the edges of `plan` to arrays."""
        edges: tuple[Edge, ...] = plan.edges
        self.start: Numbers = np.array([(one.x1, one.y1) for one in edges]).reshape(-1, 2)
        end: Numbers = np.array([(one.x2, one.y2) for one in edges]).reshape(-1, 2)
        self.along: Numbers = end - self.start
        self.length: Numbers = np.hypot(self.along[:, 0], self.along[:, 1])
        self.height: Numbers = np.array([one.height for one in edges])
        self.colour: Numbers = np.array([_rgb(one.colour) for one in edges]).reshape(-1, 3)


def cast(faces: EdgeArrays, x: float, y: float, angles: Numbers) -> tuple[Numbers, Numbers]:
    """Return the distance and the position along the edge for each pair of ray and edge.

    Args:
        faces: the edges.
        x: x coordinate of the rays' origin, in metres.
        y: y coordinate of the rays' origin, in metres.
        angles: directions of the rays in radians, counter-clockwise from the x axis.

    Returns:
        Two arrays of shape (rays, edges): distances in metres (``inf`` without an intersection) and
        positions from 0 to 1.
    """
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    ax, ay = faces.start[:, 0] - x, faces.start[:, 1] - y
    dx, dy = faces.along[:, 0], faces.along[:, 1]
    cross = cosine * dy - sine * dx
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (ax * dy - ay * dx) / cross
        share = (ax * sine - ay * cosine) / cross
    meets = (distance > _NEAREST) & (share >= 0) & (share <= 1) & np.isfinite(distance)
    return np.where(meets, distance, np.inf), share


def first_hits(faces: EdgeArrays, x: float, y: float, z: float, angles: Numbers) -> Numbers:
    """Return the range in metres of each ray at height `z`; ``inf`` without an intersection."""
    if not len(faces.height):
        return np.full(len(angles), np.inf)
    distance, _ = cast(faces, x, y, angles)
    nearest: Numbers = np.where(faces.height > z, distance, np.inf).min(axis=1)
    return nearest


def _rgb(colour: str) -> tuple[int, int, int]:
    number = int(colour.removeprefix("#"), 16)
    return number >> 16, number >> 8 & 255, number & 255
