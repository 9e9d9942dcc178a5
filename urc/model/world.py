"""The world of an emulated robot, as declared in a document.

Lengths are in metres, angles in radians, and times in seconds. Directions follow REP-103: x
forward, y left, z up, angles counter-clockwise. `READINGS` lists the names of all sensor values.
"""

from collections.abc import Mapping
from math import pi
from typing import Final, Literal, NamedTuple

from urc.expressions import Template
from urc.model.values import NOTHING, Reading

__all__ = [
    "BODY_KEYS",
    "INPUTS",
    "READINGS",
    "BatterySpec",
    "BodySpec",
    "BodyType",
    "Box",
    "CameraSpec",
    "Failsafe",
    "LaserSpec",
    "OdometrySpec",
    "PlanSpec",
    "Wall",
    "WorldSpec",
]

BodyType = Literal["differential", "tracks", "holonomic", "ackermann", "swimmer", "quadrotor"]

INPUTS: Final[Mapping[str, tuple[str, ...]]] = {
    "differential": ("forward", "turn"),
    "tracks": ("forward", "turn"),
    "holonomic": ("forward", "sideways", "turn"),
    "ackermann": ("forward", "steer"),
    "swimmer": ("forward", "turn"),
    "quadrotor": ("flies", "forward", "sideways", "climb", "turn", "cut"),
}
"""Names of the inputs under `drive`, by body type."""

BODY_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "track": ("differential", "tracks"),
    "slip": ("tracks",),
    "roughness": ("tracks", "ackermann"),
    "wheelbase": ("ackermann",),
    "steer": ("ackermann",),
    "joints": ("swimmer",),
    "legs": ("swimmer",),
    "amplitude": ("swimmer",),
    "frequency": ("swimmer",),
    "climb": ("quadrotor",),
    "hover": ("quadrotor",),
}
"""Body types that support each key; an unlisted key applies to all body types."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


READINGS: Final[Mapping[str, frozenset[str]]] = {
    **dict.fromkeys(
        _words("x y z roll pitch yaw heading speed sideways climb turn"), frozenset[str]()
    ),
    **dict.fromkeys(
        _words("joints legs occupancy_grid costmap point_cloud picture panorama top"),
        frozenset[str](),
    ),
    "odometry": _words("x y z yaw qx qy qz qw speed sideways turn left right"),
    "imu": _words("roll pitch yaw heading qx qy qz qw roll_rate pitch_rate yaw_rate ax ay az"),
    "gps": _words(
        "latitude longitude altitude speed climb course fix satellites hdop time date clock"
        " ddmm_latitude north ddmm_longitude east"
    ),
    "battery": _words("level voltage current charge"),
    "laser": _words("ranges first step nearest ahead"),
    "contact": _words(
        "bump bump_left bump_right cliff cliff_left cliff_right cliff_front_left"
        " cliff_front_right drop"
    ),
}
"""Names of sensor values (``world.NAME``), each with the names of its parts
(``world.NAME.PART``)."""


class Wall(NamedTuple):
    """A wall between two points."""

    x1: float
    y1: float
    x2: float
    y2: float
    height: float = 2.2
    colour: str = "#c8c4ba"


class Box(NamedTuple):
    """An axis-aligned box; x and y are the coordinates of its centre."""

    x: float
    y: float
    width: float
    """Size of the box along the x axis, in metres."""
    depth: float
    """Size of the box along the y axis, in metres."""
    height: float = 0.8
    colour: str = "#a5794b"


class PlanSpec(NamedTuple):
    """Obstacles and ground of the world."""

    walls: tuple[Wall, ...] = ()
    boxes: tuple[Box, ...] = ()
    holes: tuple[Box, ...] = ()
    """Areas without ground; the height and the colour of each box are unused."""
    ground: Literal["floor", "grass", "water"] = "floor"


class BodySpec(NamedTuple):
    """The type, size and motion limits of the emulated robot's body."""

    type: BodyType = "differential"
    radius: float = 0.18
    """Radius of the collision circle of the body, in metres."""
    speed: float = 1.0
    """Maximum speed, in m/s."""
    turn: float = 2.0
    """Maximum turn rate, in rad/s."""
    acceleration: float = 1.5
    """Maximum acceleration, in m/s²."""
    turn_acceleration: float = 6.0
    """Maximum angular acceleration, in rad/s²; for `ackermann`, the steering rate in rad/s."""
    track: float | None = None
    """Distance between the left and right wheels, in metres; None means 1.6 times the radius."""
    slip: float = 0.15
    """Fraction of a turn that the robot loses because its tracks slip."""
    roughness: float = 0.01
    """Amplitude of the tilt on rough ground, in rad."""
    wheelbase: float = 0.4
    steer: float = 0.52
    """Maximum steering angle of the front wheels, in rad."""
    joints: int = 8
    legs: int = 0
    amplitude: float = 0.7
    """Amplitude of each joint's swing at full drive, in rad."""
    frequency: float = 1.0
    """Frequency of each joint's swing at full drive, in Hz."""
    climb: float = 0.8
    """Maximum climb rate, in m/s."""
    hover: float = 0.8
    """Hover height after take-off, in metres."""


class OdometrySpec(NamedTuple):
    """Error of the robot's odometry."""

    scale: float = 0.01
    """Maximum relative error of distances and turns, constant during a run."""


class LaserSpec(NamedTuple):
    """A rotating laser scanner at the centre of the robot."""

    rays: int = 36
    first: float = -pi
    """Direction of the first ray, in radians."""
    last: float = pi
    """End of the field of view, in radians: one step after the last of the evenly spaced rays."""
    max: float = 8.0
    """Maximum range of the laser scanner, in metres."""
    noise: float = 0.01
    """Standard deviation of the range noise, in metres."""


class CameraSpec(NamedTuple):
    """A forward-facing camera."""

    width: int = 320
    height: int = 240
    fov: float = 1.2
    """Horizontal field of view of the camera, in radians."""
    mount_height: float = 0.25
    """Height of the camera above the ground, in metres."""
    tilt: float = 0.0
    """Upward tilt angle of the camera, in radians."""
    flip: Template | bool = False
    """Whether the picture is upside down."""
    mirror: Template | bool = False


class BatterySpec(NamedTuple):
    """The battery of the robot."""

    capacity: float = 2.6
    """Capacity of the battery, in A·h."""
    level: float = 90.0
    """Initial charge level of the battery, in %."""
    full: float = 12.6
    """Voltage of the full battery, in V."""
    empty: float = 10.2
    """Voltage of the empty battery, in V."""
    idle: float = 0.3
    """Current at standstill, in A."""
    drive: float = 2.0
    """Current at full drive, in addition to `idle`, in A."""


class Failsafe(NamedTuple):
    """The emulated robot's reaction when it no longer receives certain commands."""

    after_s: float
    without: tuple[str, ...]
    """Commands that reset the fail-safe timer."""
    sets: Mapping[str, Template | Reading] = NOTHING
    """New values of state variables, keyed by variable; if empty, the body stops."""


class WorldSpec(NamedTuple):
    """A robot body, its inputs and sensors, and its surroundings."""

    body: BodySpec = BodySpec()
    drive: Mapping[str, Template | float | bool] = NOTHING
    """Expressions for the body's inputs, keyed by input."""
    senses: Mapping[str, Template] = NOTHING
    """Expressions for sensor values, keyed by signal."""
    failsafe: Failsafe | None = None
    map: PlanSpec | None = None
    """Surroundings of the robot; None means the default room."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Initial x and y of the robot, in metres, and its initial direction, in radians."""
    datum: tuple[float, float, float] = (46.5191, 6.5668, 400.0)
    """Latitude and longitude in degrees, and altitude in metres, of the origin x = y = 0."""
    seed: int = 1
    odometry: OdometrySpec = OdometrySpec()
    laser: LaserSpec = LaserSpec()
    camera: CameraSpec = CameraSpec()
    battery: BatterySpec = BatterySpec()
