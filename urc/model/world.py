"""The small world of an emulated robot, as a document declares it.

Lengths are metres, angles radians, times seconds, counted as REP 103 does: x ahead, y to the left,
z up, angles to the left. What the robot can read of its world has the names in `READINGS`.
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
"""Kind of body → what `drive` may tell it."""

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
"""Key of a body → the kinds that have it; a key that is not here is for all."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


READINGS: Final[Mapping[str, frozenset[str]]] = {
    **dict.fromkeys(
        _words("x y z roll pitch yaw heading speed sideways climb turn"), frozenset[str]()
    ),
    **dict.fromkeys(_words("joints legs picture panorama top"), frozenset[str]()),
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
"""What ``world.NAME`` gives; of those with parts, ``world.NAME.PART``."""


class Wall(NamedTuple):
    """A wall between two points."""

    x1: float
    y1: float
    x2: float
    y2: float
    height: float = 2.2
    colour: str = "#c8c4ba"


class Box(NamedTuple):
    """A box that stands along the axes, by its middle."""

    x: float
    y: float
    width: float
    """Along x."""
    depth: float
    """Along y."""
    height: float = 0.8
    colour: str = "#a5794b"


class PlanSpec(NamedTuple):
    """What stands in the world."""

    walls: tuple[Wall, ...] = ()
    boxes: tuple[Box, ...] = ()
    holes: tuple[Box, ...] = ()
    """Where the ground is missing; their height and colour mean nothing."""
    ground: Literal["floor", "grass", "water"] = "floor"


class BodySpec(NamedTuple):
    """How the robot moves."""

    type: BodyType = "differential"
    radius: float = 0.18
    """Of the circle that touches walls."""
    speed: float = 1.0
    """Most, in m/s."""
    turn: float = 2.0
    """Most, in rad/s."""
    acceleration: float = 1.5
    """In m/s²."""
    turn_acceleration: float = 6.0
    """In rad/s²; of `ackermann`, how fast the front wheels turn, in rad/s."""
    track: float | None = None
    """From the left to the right wheel; None: 1.6 times the radius."""
    slip: float = 0.15
    """Part of a turn that tracks lose."""
    roughness: float = 0.01
    """How much the ground rocks it, in rad."""
    wheelbase: float = 0.4
    steer: float = 0.52
    """How far the front wheels turn at most, in rad."""
    joints: int = 8
    legs: int = 0
    amplitude: float = 0.7
    """Of the wave at full drive, in rad."""
    frequency: float = 1.0
    """Of the wave at full drive, in Hz."""
    climb: float = 0.8
    """Most, in m/s."""
    hover: float = 0.8
    """Height to which it rises by itself once it flies."""


class OdometrySpec(NamedTuple):
    """How wrong the robot's own reckoning of its way is."""

    scale: float = 0.01
    """Share by which distances and turns are at most told wrong, always the same way."""


class LaserSpec(NamedTuple):
    """A scanner that turns at the height of the robot's middle."""

    rays: int = 36
    first: float = -pi
    """Direction of the first ray."""
    last: float = pi
    """Direction after the last ray: the field of view is shared by all."""
    max: float = 8.0
    """Farther is nothing."""
    noise: float = 0.01
    """Standard deviation."""


class CameraSpec(NamedTuple):
    """A camera that looks ahead."""

    width: int = 320
    height: int = 240
    view: float = 1.2
    """Angle from the left to the right edge."""
    up: float = 0.25
    """Height of the eye above the robot's foot."""
    tilt: float = 0.0
    """How far it looks up."""
    flip: Template | bool = False
    """Whether the picture is upside down."""
    mirror: Template | bool = False


class BatterySpec(NamedTuple):
    """What the robot lives on."""

    capacity: float = 2.6
    """In A·h."""
    level: float = 90.0
    """At the beginning, in %."""
    full: float = 12.6
    """Volts when it is full."""
    empty: float = 10.2
    """Volts when it is empty."""
    idle: float = 0.3
    """Current while it stands, in A."""
    drive: float = 2.0
    """Current on top of it at full effort, in A."""


class Failsafe(NamedTuple):
    """What the robot does by itself when commands stop."""

    after_s: float
    without: tuple[str, ...]
    """Commands of which none must have come for that long."""
    sets: Mapping[str, Template | Reading] = NOTHING
    """State that changes then; without any the body is told to stand still."""


class WorldSpec(NamedTuple):
    """A robot's body, what moves it, and what its sensors tell."""

    body: BodySpec = BodySpec()
    drive: Mapping[str, Template | float | bool] = NOTHING
    """Input of the body → its value now."""
    senses: Mapping[str, Template] = NOTHING
    """Signal → what it is now."""
    failsafe: Failsafe | None = None
    plan: PlanSpec | None = None
    """None: the room that every robot has by itself."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """x, y and the direction."""
    datum: tuple[float, float, float] = (46.5191, 6.5668, 400.0)
    """Latitude and longitude of x = y = 0 in degrees, and its height above the sea."""
    seed: int = 1
    odometry: OdometrySpec = OdometrySpec()
    laser: LaserSpec = LaserSpec()
    camera: CameraSpec = CameraSpec()
    battery: BatterySpec = BatterySpec()
