"""Motion models: one simulation step for each kind of body.

Pure. Units are metres, seconds and radians. The axes are x forward, y left and z up (REP 103).
Wheeled bodies follow exact arcs, so constant inputs produce the same path for any step length.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from urc.model.world import BodySpec

__all__ = ["GRAVITY", "Motion", "joints_of", "legs_of", "move"]

GRAVITY: Final = 9.80665
_LANDS_AT: Final = 0.4
"""Descent speed of a landing quadrotor, in m/s."""
_LEAN: Final = 0.02
"""Lean angle of a sprung body per unit of acceleration, in radians per m/s²."""

Inputs = Mapping[str, float]


@dataclass(slots=True)
class Motion:
    """Pose and velocity of a body."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0
    """Roll in radians, positive with the right side down."""
    pitch: float = 0.0
    """Pitch in radians, positive with the nose down."""
    forward: float = 0.0
    """Speed along the body's x axis, in m/s. `sideways` and `climb` are the speeds along the y
    and z axes, respectively."""
    sideways: float = 0.0
    climb: float = 0.0
    turn: float = 0.0
    """Turn rate to the left, in rad/s."""
    steer: float = 0.0
    """Steering angle of the front wheels, in radians."""
    phase: float = 0.0
    """Phase of the wave that travels along a jointed body, in cycles."""
    drive: float = 0.0
    """Amplitude of the wave that travels along a jointed body, 0 to 1."""
    bend: float = 0.0
    """Bend of the body to the left, -1 to 1."""
    is_up: bool = False
    """Whether a flying body has reached its hover height."""
    accelerations: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Accelerations along the body's axes without gravity, in m/s²."""
    rates: list[float] = field(default_factory=lambda: [0.0, 0.0])
    """Roll rate and pitch rate, in rad/s."""
    told_forward: float = 0.0
    """Speed of the wheels or tracks, in m/s; the wheels turn even if an obstacle stops the body.
    `told_turn` is the turn rate of the wheels or tracks, in rad/s."""
    told_turn: float = 0.0
    effort: float = 0.0
    """Power in use, as a fraction of the maximum power, 0 to 1."""


def move(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    """Advance the motion by `dt_s` seconds with `inputs`, without collisions."""
    before = motion.forward, motion.sideways, motion.climb, motion.roll, motion.pitch
    _MOVES[body.type](body, motion, inputs, dt_s)
    turn = motion.turn
    motion.accelerations[0] = (motion.forward - before[0]) / dt_s - turn * motion.sideways
    motion.accelerations[1] = (motion.sideways - before[1]) / dt_s + turn * motion.forward
    motion.accelerations[2] = (motion.climb - before[2]) / dt_s
    if body.type != "quadrotor":
        _lean(body, motion)
    motion.rates[0] = (motion.roll - before[3]) / dt_s
    motion.rates[1] = (motion.pitch - before[4]) / dt_s


def joints_of(body: BodySpec, motion: Motion) -> tuple[float, ...]:
    """Return the joint angles from head to tail: the sum of a travelling wave and a bend."""
    return tuple(
        motion.drive * body.amplitude * math.sin(2 * math.pi * (motion.phase - place / body.joints))
        + motion.bend * body.amplitude / 3
        for place in range(body.joints)
    )


def legs_of(body: BodySpec, motion: Motion) -> tuple[float, ...]:
    """Return the leg angles, from -pi to pi radians.

    Adjacent legs move in opposite phase, as in a trot.
    """
    turns = (motion.phase + (place % 3 != 0) / 2 for place in range(body.legs))
    return tuple(2 * math.pi * ((one + 0.5) % 1.0 - 0.5) for one in turns)


def _lean(body: BodySpec, motion: Motion) -> None:
    """Set roll and pitch: the body leans as it accelerates and rocks on rough ground."""
    along, across, _ = motion.accelerations
    motion.pitch += (-_LEAN * along - motion.pitch) * 0.2
    motion.roll += (_LEAN * across - motion.roll) * 0.2
    if body.type in ("tracks", "ackermann"):
        motion.pitch += 0.2 * body.roughness * math.sin(9 * motion.x + 5 * motion.y)
        motion.roll += 0.2 * body.roughness * math.sin(7 * motion.y - 4 * motion.x)
    if body.type == "swimmer":
        motion.roll = 0.08 * motion.drive * math.sin(2 * math.pi * motion.phase)


def _toward(value: float, target: float, most: float) -> float:
    return min(target, value + most) if target > value else max(target, value - most)


def _within(value: float, most: float) -> float:
    return min(most, max(-most, value))


def _arc(motion: Motion, dt_s: float) -> None:
    """Move along an arc at the current speeds."""
    angle = motion.turn * dt_s
    if abs(angle) < 1e-9:
        sine, cosine = dt_s, angle * dt_s / 2
    else:
        sine, cosine = math.sin(angle) / motion.turn, (1 - math.cos(angle)) / motion.turn
    ahead = motion.forward * sine - motion.sideways * cosine
    left = motion.forward * cosine + motion.sideways * sine
    east, north = math.cos(motion.yaw), math.sin(motion.yaw)
    motion.x += ahead * east - left * north
    motion.y += ahead * north + left * east
    motion.yaw = math.remainder(motion.yaw + angle, 2 * math.pi)


def _ramped(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> tuple[float, float]:
    """Return the new speed and turn rate of the wheels."""
    forward = _within(inputs.get("forward", 0.0), body.speed)
    turn = _within(inputs.get("turn", 0.0), body.turn)
    motion.told_forward = _toward(motion.told_forward, forward, body.acceleration * dt_s)
    motion.told_turn = _toward(motion.told_turn, turn, body.turn_acceleration * dt_s)
    share = abs(motion.told_forward) / body.speed + 0.5 * abs(motion.told_turn) / body.turn
    motion.effort = min(1.0, share)
    return motion.told_forward, motion.told_turn


def _wheels(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    motion.forward, motion.turn = _ramped(body, motion, inputs, dt_s)
    motion.sideways = 0.0
    _arc(motion, dt_s)


def _tracks(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    forward, turn = _ramped(body, motion, inputs, dt_s)
    motion.turn = turn * (1 - body.slip)
    motion.forward = forward * (1 - body.slip * abs(turn) / body.turn / 2)
    motion.sideways = 0.0
    _arc(motion, dt_s)


def _holonomic(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    motion.forward, motion.turn = _ramped(body, motion, inputs, dt_s)
    sideways = _within(inputs.get("sideways", 0.0), body.speed)
    motion.sideways = _toward(motion.sideways, sideways, body.acceleration * dt_s)
    motion.effort = min(1.0, motion.effort + abs(motion.sideways) / body.speed)
    _arc(motion, dt_s)


def _ackermann(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    forward = _within(inputs.get("forward", 0.0), body.speed)
    steer = _within(inputs.get("steer", 0.0), body.steer)
    motion.steer = _toward(motion.steer, steer, body.turn_acceleration * dt_s)
    motion.forward = _toward(motion.told_forward, forward, body.acceleration * dt_s)
    motion.turn = motion.forward * math.tan(motion.steer) / body.wheelbase
    motion.told_forward, motion.told_turn = motion.forward, motion.turn
    motion.effort = abs(motion.forward) / body.speed
    _arc(motion, dt_s)


def _swimmer(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    motion.drive = _toward(motion.drive, min(1.0, max(0.0, inputs.get("forward", 0.0))), dt_s)
    motion.bend = _toward(motion.bend, _within(inputs.get("turn", 0.0), 1.0), 2 * dt_s)
    motion.phase = (motion.phase + body.frequency * motion.drive * dt_s) % 1.0
    target = body.speed * motion.drive * (1 - 0.4 * abs(motion.bend))
    motion.forward = _toward(motion.forward, target, body.acceleration * dt_s)
    # A bent body turns only while the wave runs.
    motion.turn = body.turn * motion.bend * motion.drive
    motion.told_forward, motion.told_turn = motion.forward, motion.turn
    motion.effort = motion.drive
    _arc(motion, dt_s)


def _quadrotor(body: BodySpec, motion: Motion, inputs: Inputs, dt_s: float) -> None:
    flies, cut = inputs.get("flies", 0.0) > 0, inputs.get("cut", 0.0) > 0
    forward = sideways = turn = 0.0
    if flies and motion.is_up and not cut:
        forward = _within(inputs.get("forward", 0.0), body.speed)
        sideways = _within(inputs.get("sideways", 0.0), body.speed)
        turn = _within(inputs.get("turn", 0.0), body.turn)
    most = body.acceleration * dt_s
    before = motion.forward, motion.sideways
    motion.forward = _toward(motion.forward, forward, most)
    motion.sideways = _toward(motion.sideways, sideways, most)
    motion.turn = _toward(motion.turn, turn, body.turn_acceleration * dt_s)
    motion.climb = _climb(body, motion, inputs, flies, cut, dt_s)
    motion.z = max(0.0, motion.z + motion.climb * dt_s)
    if motion.z == 0.0 and motion.climb <= 0:
        motion.climb, motion.forward, motion.sideways, motion.turn = 0.0, 0.0, 0.0, 0.0
        motion.is_up = False
    # The body leans into its acceleration, and a little against the drag.
    along = (motion.forward - before[0]) / dt_s + 0.4 * motion.forward
    across = (motion.sideways - before[1]) / dt_s + 0.4 * motion.sideways
    motion.pitch += (math.atan(along / GRAVITY) - motion.pitch) * 0.2
    motion.roll += (math.atan(-across / GRAVITY) - motion.roll) * 0.2
    motion.told_forward, motion.told_turn = motion.forward, motion.turn
    motion.effort = 0.6 + 0.4 * abs(motion.forward) / body.speed if motion.z > 0 else 0.0
    _arc(motion, dt_s)


def _climb(
    body: BodySpec, motion: Motion, inputs: Inputs, flies: bool, cut: bool, dt_s: float
) -> float:
    """Return the new vertical speed for climbing to hover height, landing or falling."""
    if cut:
        return motion.climb - GRAVITY * dt_s
    if not flies:
        target = -_LANDS_AT
    elif not motion.is_up:
        left = body.hover - motion.z
        motion.is_up = left <= 0.02
        target = min(body.climb, 2 * left)
    else:
        target = _within(inputs.get("climb", 0.0), body.climb)
    return _toward(motion.climb, target, 4 * dt_s)


_MOVES: Final[Mapping[str, Callable[[BodySpec, Motion, Inputs, float], None]]] = {
    "differential": _wheels,
    "tracks": _tracks,
    "holonomic": _holonomic,
    "ackermann": _ackermann,
    "swimmer": _swimmer,
    "quadrotor": _quadrotor,
}
