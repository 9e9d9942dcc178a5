"""Reproducible noise: a random number for each seed, time step and name.

Pure. The generator has no state, so the order of sensor readings does not matter.
"""

import math
from typing import Final
from zlib import crc32

__all__ = ["gauss", "uniform", "wander"]

_MASK: Final = 0xFFFFFFFFFFFFFFFF


def _mixed(seed: int, tick: int, name: str) -> int:
    """Return 64 well-mixed bits, using Vigna's splitmix64 (public domain)."""
    bits = (seed * 0x9E3779B97F4A7C15 + tick * 0xD1B54A32D192ED03 + crc32(name.encode())) & _MASK
    bits = ((bits ^ (bits >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    bits = ((bits ^ (bits >> 27)) * 0x94D049BB133111EB) & _MASK
    return bits ^ (bits >> 31)


def uniform(seed: int, tick: int, name: str) -> float:
    """Return a uniform random number in [0, 1)."""
    return (_mixed(seed, tick, name) >> 11) / 9007199254740992.0


def gauss(seed: int, tick: int, name: str) -> float:
    """Return a random number from the standard normal distribution (Box and Muller)."""
    bits = _mixed(seed, tick, name)
    first, second = ((bits >> 32) + 1) / 4294967297.0, (bits & 0xFFFFFFFF) / 4294967296.0
    return math.sqrt(-2 * math.log(first)) * math.cos(2 * math.pi * second)


def wander(seed: int, time_s: float, name: str) -> float:
    """Return a slowly varying number between -1 and 1.

    The number is the sum of four waves with periods of 20 to 190 s.
    """
    total = 0.0
    for place, period_s in enumerate((23.0, 47.0, 91.0, 187.0)):
        total += math.sin(2 * math.pi * (time_s / period_s + uniform(seed, place, name)))
    return total / 4
