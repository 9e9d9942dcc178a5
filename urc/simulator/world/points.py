"""A laser scanner with several rings: the points on walls, boxes and the ground around the robot.

Pure. The module imports numpy, so it is loaded only on first use. The scanner is modelled after the
Velodyne VLP-16: 16 rings from 15 degrees below to 15 degrees above the horizon.
"""

import math
from typing import Final

import numpy as np

from urc.protocol.values.point_cloud import encode_cloud, packed_cloud
from urc.simulator.world.rays import EdgeArrays, cast
from urc.simulator.world.sensors import SensorInput

__all__ = ["scanned_points"]

_RINGS: Final = np.radians(np.arange(-15.0, 16.0, 2.0))
_DIRECTIONS: Final = 450
"""Number of directions in which each ring measures."""
_HEIGHT_M: Final = 0.4
"""Height of the scanner above the ground, in metres."""
_FARTHEST_M: Final = 30.0
_WALL, _GROUND = 90.0, 25.0
"""Intensity of a close wall and of the close ground, from 0 to 255."""


def scanned_points(faces: EdgeArrays, moment: SensorInput) -> bytes:
    """Return the points as a PCD file, in metres from the robot: x forward, y left, z up."""
    motion, count = moment.motion, len(_RINGS)
    around = np.linspace(-math.pi, math.pi, _DIRECTIONS, endpoint=False)
    sensor = motion.z + _HEIGHT_M
    flat = np.full((_DIRECTIONS, count), _FARTHEST_M)
    is_wall = np.zeros((_DIRECTIONS, count), dtype=bool)
    slope = np.tan(_RINGS)
    if len(faces.height):
        distance, _ = cast(faces, motion.x, motion.y, motion.yaw + around)
        for ring in range(count):
            # A ray passes over an edge that is lower than the ray at the edge's distance.
            with np.errstate(invalid="ignore"):
                meets = sensor + distance * slope[ring] < faces.height
            flat[:, ring] = np.where(meets, distance, np.inf).min(axis=1)
        is_wall = flat < _FARTHEST_M
    with np.errstate(divide="ignore"):
        ground = np.where(slope < 0, sensor / -slope, np.inf)
    is_wall &= flat < ground
    flat = np.minimum(flat, ground)
    noise = np.random.default_rng((moment.spec.seed, moment.tick)).standard_normal(flat.shape)
    flat = flat + noise * moment.spec.laser.noise * moment.noise
    hit = (flat > 0) & (flat / np.cos(_RINGS) < _FARTHEST_M)
    intensity = np.where(is_wall, _WALL, _GROUND) * np.exp(-flat / 10)
    directions = np.broadcast_to(around[:, None], flat.shape)
    columns = {
        "x": (flat * np.cos(directions))[hit].tolist(),
        "y": (flat * np.sin(directions))[hit].tolist(),
        "z": (_HEIGHT_M + flat * slope)[hit].tolist(),
        "intensity": intensity[hit].tolist(),
    }
    return encode_cloud(packed_cloud("base_link", "intensity", flat.size, columns))
