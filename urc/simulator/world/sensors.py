"""The sensors of an emulated robot in its world.

Pure. Readings are in metres, radians, seconds and volts, but bearings, latitudes and longitudes are
in degrees.
"""

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final, NamedTuple

from urc.model.world import BodySpec, WorldSpec
from urc.simulator.world.bodies import GRAVITY, Motion
from urc.simulator.world.chance import gauss, uniform, wander
from urc.simulator.world.plan import Contact, WorldMap

__all__ = ["Battery", "SensorInput", "Odometry", "contact", "gps", "imu", "odometry", "quaternion"]

_EQUATOR_M: Final = 6378137.0
_SQUARE_OF_ECCENTRICITY: Final = 0.00669437999014
"""Squared eccentricity of the WGS 84 ellipsoid."""
_EMPTY: Final = 5.0
"""Battery level at which the simulation replaces the battery, in per cent."""
_CHANGED_AFTER_S: Final = 30.0
"""Time for which the robot must stand still before the battery is replaced, in seconds. The battery
is replaced so that a demo does not end with an empty battery."""
_REACH_M: Final = 0.06
"""Distance from the robot's edge to the cliff sensors, in metres."""


class SensorInput(NamedTuple):
    """The inputs from which all sensors compute their readings."""

    spec: WorldSpec
    plan: WorldMap
    motion: Motion
    touch: Contact | None
    tick: int
    time_s: float
    """Time, in seconds since the epoch."""
    noise: float = 1.0
    """Factor by which the declared noise is multiplied."""

    def gauss(self, name: str) -> float:
        """Return a random error with a standard deviation of 1 for the current time step."""
        return self.noise * gauss(self.spec.seed, self.tick, name)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Return the quaternion x, y, z, w of rotations about z, then y, then x."""
    sr, cr = math.sin(roll / 2), math.cos(roll / 2)
    sp, cp = math.sin(pitch / 2), math.cos(pitch / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


class Odometry:
    """Wheel odometry: a pose with a constant systematic error."""

    def __init__(self, spec: WorldSpec) -> None:
        """Initialise the odometry with the start pose of the world."""
        self.x, self.y, self.yaw = spec.start
        scale = spec.odometry.scale
        self._stride = 1 + scale * (2 * uniform(spec.seed, 0, "stride") - 1)
        self._turn = 1 + scale * (2 * uniform(spec.seed, 0, "turn") - 1)
        track = spec.body.track
        self._half_track = spec.body.radius * 0.8 if track is None else track / 2
        self.left = 0.0
        """Distance travelled by the left wheel, in metres; backward motion reduces the distance."""
        self.right = 0.0

    def advance(self, motion: Motion, dt_s: float, noise: float) -> None:
        """Integrate one step."""
        stride, turn = 1 + noise * (self._stride - 1), 1 + noise * (self._turn - 1)
        ahead, angle = motion.told_forward * stride * dt_s, motion.told_turn * turn * dt_s
        aside = motion.sideways * stride * dt_s
        middle = self.yaw + angle / 2
        self.x += ahead * math.cos(middle) - aside * math.sin(middle)
        self.y += ahead * math.sin(middle) + aside * math.cos(middle)
        self.yaw = math.remainder(self.yaw + angle, 2 * math.pi)
        self.left += (motion.told_forward - motion.told_turn * self._half_track) * dt_s
        self.right += (motion.told_forward + motion.told_turn * self._half_track) * dt_s


def odometry(moment: SensorInput, reckoned: Odometry) -> Mapping[str, object]:
    """Return ``world.odometry``."""
    motion = moment.motion
    x, y, z, w = quaternion(0.0, 0.0, reckoned.yaw)
    moves = abs(motion.told_forward) + abs(motion.told_turn) > 1e-6
    error = 0.002 * moment.gauss("speed") if moves else 0.0
    return {
        "x": reckoned.x,
        "y": reckoned.y,
        "z": motion.z,
        "yaw": reckoned.yaw,
        "qx": x,
        "qy": y,
        "qz": z,
        "qw": w,
        "speed": motion.told_forward + error,
        "sideways": motion.sideways,
        "turn": motion.told_turn + error,
        "left": reckoned.left,
        "right": reckoned.right,
    }


def imu(moment: SensorInput) -> Mapping[str, object]:
    """Return ``world.imu``: acceleration including gravity, and attitude."""
    motion = moment.motion
    roll = motion.roll + 0.001 * moment.gauss("roll")
    pitch = motion.pitch + 0.001 * moment.gauss("pitch")
    drift = 0.01 * moment.noise * wander(moment.spec.seed, moment.time_s, "yaw")
    yaw = math.remainder(motion.yaw + drift, 2 * math.pi)
    x, y, z, w = quaternion(roll, pitch, yaw)
    ax, ay, az = motion.accelerations
    sp, cp, sr, cr = math.sin(pitch), math.cos(pitch), math.sin(roll), math.cos(roll)
    return {
        "roll": roll,
        "pitch": pitch,
        "yaw": yaw,
        "heading": math.degrees(math.pi / 2 - yaw) % 360,
        "qx": x,
        "qy": y,
        "qz": z,
        "qw": w,
        "roll_rate": motion.rates[0] + 0.002 * moment.gauss("p"),
        "pitch_rate": motion.rates[1] + 0.002 * moment.gauss("q"),
        "yaw_rate": motion.turn + 0.002 * moment.gauss("r"),
        "ax": ax - GRAVITY * sp + 0.02 * moment.gauss("ax"),
        "ay": ay + GRAVITY * sr * cp + 0.02 * moment.gauss("ay"),
        "az": az + GRAVITY * cr * cp + 0.02 * moment.gauss("az"),
    }


def place_on_earth(spec: WorldSpec, x: float, y: float) -> tuple[float, float]:
    """Return the latitude and longitude of a point.

    The point is `x` metres east and `y` metres north of the datum.
    """
    latitude, longitude, _ = spec.datum
    sine = math.sin(math.radians(latitude))
    root = 1 - _SQUARE_OF_ECCENTRICITY * sine * sine
    north_m = _EQUATOR_M * (1 - _SQUARE_OF_ECCENTRICITY) / root**1.5
    east_m = _EQUATOR_M / math.sqrt(root) * math.cos(math.radians(latitude))
    return latitude + math.degrees(y / north_m), longitude + math.degrees(x / east_m)


def gps(moment: SensorInput) -> Mapping[str, object]:
    """Return ``world.gps``. The x axis points east, and the y axis points north."""
    spec, motion, noise = moment.spec, moment.motion, moment.noise
    wide = 1.2 * noise
    x = motion.x + wide * wander(spec.seed, moment.time_s, "east") + 0.05 * moment.gauss("east")
    y = motion.y + wide * wander(spec.seed, moment.time_s, "north") + 0.05 * moment.gauss("north")
    latitude, longitude = place_on_earth(spec, x, y)
    up = 2 * wide * wander(spec.seed, moment.time_s, "up")
    speed = math.hypot(motion.forward, motion.sideways)
    running_rule = motion.yaw + math.atan2(motion.sideways, motion.forward)
    time = datetime.fromtimestamp(moment.time_s, UTC)
    return {
        "latitude": latitude,
        "longitude": longitude,
        "altitude": spec.datum[2] + motion.z + up,
        "speed": max(0.0, speed + 0.02 * moment.gauss("ground")),
        "climb": motion.climb + 0.02 * moment.gauss("climb"),
        "course": math.degrees(math.pi / 2 - running_rule) % 360,
        "fix": 3,
        "satellites": 9 + round(2 * wander(spec.seed, moment.time_s, "satellites")),
        "hdop": round(0.9 + 0.2 * wander(spec.seed, moment.time_s, "hdop"), 1),
        "time": time.strftime("%H%M%S"),
        "date": time.strftime("%d%m%y"),
        "clock": time.strftime("%Y-%m-%dT%H:%M:%S.") + f"{time.microsecond // 1000:03}Z",
        "ddmm_latitude": _ddmm(latitude, 2),
        "north": "N" if latitude >= 0 else "S",
        "ddmm_longitude": _ddmm(longitude, 3),
        "east": "E" if longitude >= 0 else "W",
    }


def _ddmm(degrees: float, width: int) -> str:
    """Return an angle as degrees and minutes in NMEA 0183 format, without the hemisphere."""
    minutes = round(abs(degrees) * 60, 4)
    whole, rest = divmod(minutes, 60)
    return f"{int(whole):0{width}}{rest:07.4f}"


def contact(moment: SensorInput) -> Mapping[str, object]:
    """Return ``world.contact``: the states of bumpers and cliff sensors."""
    motion, body = moment.motion, moment.spec.body
    left = right = False
    if moment.touch is not None:
        bearing = math.atan2(moment.touch.y - motion.y, moment.touch.x - motion.x)
        side = math.remainder(bearing - motion.yaw, 2 * math.pi)
        left, right = -0.15 < side < 1.6, -1.6 < side < 0.15
    cliffs = {
        "cliff_left": _is_cliff(moment, body, 1.1),
        "cliff_front_left": _is_cliff(moment, body, 0.3),
        "cliff_front_right": _is_cliff(moment, body, -0.3),
        "cliff_right": _is_cliff(moment, body, -1.1),
    }
    return {
        "bump": moment.touch is not None,
        "bump_left": left,
        "bump_right": right,
        "cliff": any(cliffs.values()),
        "drop": moment.plan.is_hole(motion.x, motion.y) and motion.z < 0.01,
        **cliffs,
    }


def _is_cliff(moment: SensorInput, body: BodySpec, angle: float) -> bool:
    motion, reach = moment.motion, body.radius + _REACH_M
    direction = motion.yaw + angle
    x, y = motion.x + reach * math.cos(direction), motion.y + reach * math.sin(direction)
    return motion.z < 0.05 and moment.plan.is_hole(x, y)


class Battery:
    """The battery; its charge never falls below 0 %.

    An empty battery is replaced after a standstill.
    """

    def __init__(self, spec: WorldSpec) -> None:
        """Initialise the battery with the declared level."""
        self._spec = spec.battery
        self.charge = spec.battery.capacity * spec.battery.level / 100
        """Charge, in A·h."""
        self.current = spec.battery.idle
        """Current drawn from the battery, in A."""
        self._stands_s = 0.0
        """Time for which the robot has stood still with an empty battery, in seconds."""

    @property
    def level(self) -> float:
        """State of charge, 0 to 100 %."""
        return 100 * self.charge / self._spec.capacity

    def advance(self, effort: float, dt_s: float) -> None:
        """Discharge the battery for `dt_s` seconds at an effort of 0 to 1."""
        self.current = self._spec.idle + self._spec.drive * effort
        self.charge = max(0.0, self.charge - self.current * dt_s / 3600)
        is_waiting = effort == 0 and self.level <= _EMPTY
        self._stands_s = self._stands_s + dt_s if is_waiting else 0.0
        if self._stands_s > _CHANGED_AFTER_S:
            self.charge = self._spec.capacity * max(self._spec.level, 2 * _EMPTY) / 100

    def drain(self, level: float) -> None:
        """Reduce the charge to at most `level` per cent."""
        self.charge = min(self.charge, self._spec.capacity * level / 100)

    def readings(self) -> Mapping[str, object]:
        """Return ``world.battery``; the current is positive while the battery discharges."""
        spec, share = self._spec, self.level / 100
        sag = 0.02 * (spec.full - spec.empty) * self.current / max(spec.idle + spec.drive, 1e-6)
        voltage = spec.empty + (spec.full - spec.empty) * share - sag
        return {
            "level": self.level,
            "voltage": voltage,
            "current": self.current,
            "charge": self.charge,
        }
