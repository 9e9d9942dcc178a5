"""Values that a robot could have: where its signals may be, moving slowly, the same for all.

Pure: the time is passed in.
"""

import math
from binascii import a2b_base64
from typing import Final
from zlib import crc32

from urc.model.values import ElementType, Limits, Reading, Signal, SignalType, Value

__all__ = ["plausible"]

_PERIOD_S: Final = 60.0
"""Time in which a value goes up and down once."""
_WIDTH: Final = (0.0, 100.0)
"""Where numbers are that have no range."""
_ELEMENTS: Final = 4
_PIXEL: Final = a2b_base64(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNkYAAAAAYAAjCB0C8AAAAASUVORK5CYII="
)
"""A picture of one grey point, as PNG."""


def plausible(signal: Signal, now_s: float) -> Reading:
    """Return a value of `signal` at `now_s` that no limit complains about."""
    if signal.type in ("image", "blob"):
        return _PIXEL if signal.size is None or signal.size >= len(_PIXEL) else b""
    if signal.type == "object":
        return _quaternion(now_s) if signal.axes else {}
    if signal.type != "array":
        return _single(signal, signal.type, 0, now_s)
    if signal.axes and signal.size == 4:
        return tuple(_quaternion(now_s).values())
    size = _ELEMENTS if signal.size is None else signal.size
    return tuple(_single(signal, signal.of, place, now_s) for place in range(size))


def _single(signal: Signal, kind: ElementType | SignalType, place: int, now_s: float) -> Value:
    if signal.states:
        return signal.states[0][1]
    if kind == "boolean":
        return False
    if kind == "string":
        return signal.name
    low, high = _range(signal)
    # Each signal at its own place of the same slow wave.
    phase = crc32(signal.name.encode()) / 2**32 + place / 8
    value = low + (high - low) * (0.5 + 0.4 * math.sin(2 * math.pi * (now_s / _PERIOD_S + phase)))
    if kind == "integer":
        return round(value)
    return round(value, 2 if signal.precision is None else signal.precision)


def _range(signal: Signal) -> tuple[float, float]:
    """Return where the value may be without any alarm."""
    limits: Limits = signal.limits
    lowest, highest = signal.min, signal.max
    floors = [one for one in (signal.min, limits.lolo, limits.low) if one is not None]
    tops = [one for one in (signal.max, limits.high, limits.hihi) if one is not None]
    low = max(floors, default=None)
    high = min(tops, default=None)
    if low is None and high is None:
        return _WIDTH
    if low is None and high is not None:
        low = min(0.0, high - 1) if lowest is None else lowest
    if high is None and low is not None:
        high = max(_WIDTH[1], low + 1) if highest is None else highest
    return low or 0.0, high or 0.0


def _quaternion(now_s: float) -> dict[str, Value]:
    half = math.pi * now_s / _PERIOD_S
    return {"x": 0.0, "y": 0.0, "z": round(math.sin(half), 4), "w": round(math.cos(half), 4)}
