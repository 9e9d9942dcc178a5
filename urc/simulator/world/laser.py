"""A laser scanner: rays from the centre of the robot, with noise.

Pure. The module imports numpy, so it is loaded only on first use.
"""

import math
from collections.abc import Mapping

import numpy as np

from urc.simulator.world.rays import EdgeArrays, first_hits
from urc.simulator.world.sensors import SensorInput

__all__ = ["sweep"]

_HEIGHT_M = 0.15
"""Height of the scanner above the ground, in metres."""


def sweep(faces: EdgeArrays, moment: SensorInput) -> Mapping[str, object]:
    """Return ``world.laser``. A ray without an echo has the range None."""
    spec, motion = moment.spec.laser, moment.motion
    step = (spec.last - spec.first) / spec.rays
    angles = motion.yaw + spec.first + step * np.arange(spec.rays, dtype=np.float64)
    far = first_hits(faces, motion.x, motion.y, motion.z + _HEIGHT_M, angles)
    noise = np.random.default_rng((moment.spec.seed, moment.tick)).standard_normal(spec.rays)
    told = far + noise * spec.noise * moment.noise
    ranges = tuple(
        round(max(0.0, one), 3) if real <= spec.max and math.isfinite(real) else None
        for one, real in zip(told.tolist(), far.tolist(), strict=True)
    )
    ahead = round(-spec.first / step) % spec.rays if step else 0
    return {
        "ranges": ranges,
        "first": spec.first,
        "step": step,
        "nearest": min((one for one in ranges if one is not None), default=None),
        "ahead": ranges[ahead],
    }
