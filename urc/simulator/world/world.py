"""The world of an emulated robot: a body with inputs and sensors.

The module does not use clocks or sockets. Time is an argument, and the world advances in steps of
`STEP_S`. The same commands at the same times produce the same world, for any number of
observations.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Final

from urc.expressions import Template
from urc.model.world import READINGS, WorldSpec
from urc.simulator.world.bodies import Motion, joints_of, legs_of, move
from urc.simulator.world.plan import ROOM, Contact, WorldMap
from urc.simulator.world.sensors import (
    Battery,
    Odometry,
    SensorInput,
    contact,
    gps,
    imu,
    odometry,
)

if TYPE_CHECKING:
    from urc.simulator.world.picture import CameraPose
    from urc.simulator.world.rays import EdgeArrays

__all__ = ["FARTHEST_S", "STEP_S", "SensorView", "World"]

STEP_S: Final = 0.02
"""Length of a simulation step, in seconds."""
FARTHEST_S: Final = 60.0
"""Maximum simulated time between two observations, in seconds. If a gap is longer, the simulation
skips its earlier part."""
_ASKED_EVERY_S: Final = 0.1
"""Interval at which time-dependent inputs are evaluated during a long gap, in seconds."""
_TRAIL_EVERY_M: Final = 0.05
_TRAIL_MOST: Final = 400
_LOW: Final = 12.0
"""Battery level after a low-battery fault, in per cent."""
_RENDERED: Final = frozenset({"laser", "point_cloud", "picture", "panorama", "top"})
"""Readings that need numpy or Pillow."""
PLAIN: Final = frozenset({"laser", "picture"})
"""Readings that `urc.simulator.world.plain` renders without numpy and Pillow."""
_PANORAMA: Final = (512, 256)
"""Columns and rows of a panorama image."""

Inputs = Callable[[float], Mapping[str, float]]
"""Function that returns the inputs of the body at a given time."""


class World:
    """One robot's world.

    Args:
        spec: the declaration.
        inputs: function that returns the inputs of the body at a given time. The function may
            observe the world at the current step.
        holds: function that evaluates a camera condition, which a document may declare as a
            template.
        has_rendering: whether numpy and Pillow are installed.
        is_plain: whether to render level cameras and laser scanners without these packages, which
            is slower.
    """

    def __init__(
        self,
        spec: WorldSpec,
        inputs: Inputs,
        holds: Callable[[Template | bool], bool] = bool,
        *,
        has_rendering: bool = True,
        is_plain: bool = False,
    ) -> None:
        self.spec = spec
        self.plan = WorldMap(ROOM if spec.map is None else spec.map)
        x, y, yaw = spec.start
        self.motion = Motion(x=x, y=y, yaw=yaw)
        self.odometry = Odometry(spec)
        self.battery = Battery(spec)
        self.touch: Contact | None = None
        self.tick = 0
        """Number of completed simulation steps."""
        self.time_s: float | None = None
        """End of the last step, in seconds since the epoch; None before the first observation."""
        self.noise = 1.0
        self.is_plain = is_plain and not has_rendering
        drawn = _RENDERED if has_rendering else PLAIN if is_plain else frozenset[str]()
        self.missing = _RENDERED - drawn
        """Names of `READINGS` that require a missing package."""
        self.dropped = set(self.missing)
        """Names of the `READINGS` that have no value, because their sensors have failed."""
        self._inputs = inputs
        self._holds = holds
        self._is_busy = False
        self._trail: deque[tuple[float, float]] = deque([(x, y)], _TRAIL_MOST)
        self._kept: dict[object, tuple[float, bytes]] = {}
        """Time and bytes of the last image, keyed by kind of image."""
        self._faces: EdgeArrays | None = None

    def advance(self, now_s: float) -> None:
        """Advance to `now_s` in whole steps; leave the remainder for the next call."""
        if self.time_s is None or now_s < self.time_s - FARTHEST_S:
            self.time_s = now_s  # the first observation, or the clock was set back
        if self._is_busy:
            return
        self.time_s = max(self.time_s, now_s - FARTHEST_S)
        self._is_busy = True
        try:
            while (steps := int((now_s - self.time_s) / STEP_S + 1e-6)) > 0:
                inputs = self._inputs(self.time_s)
                for _ in range(min(steps, round(_ASKED_EVERY_S / STEP_S))):
                    self._advance(inputs)
        finally:
            self._is_busy = False

    def low_battery(self) -> None:
        """Reduce the battery level to at most `_LOW` per cent."""
        self.battery.drain(_LOW)

    def view(self, now_s: float) -> "SensorView":
        """Advance the world to `now_s`, and return its sensor view."""
        self.advance(now_s)
        return SensorView(self)

    @cached_property
    def occupancy_grid(self) -> Mapping[str, object]:
        """The map of the world as the fields of nav_msgs/OccupancyGrid."""
        from urc.simulator.world.occupancy import occupancy_grid

        return occupancy_grid(self.plan, self.spec.start[:2])

    @cached_property
    def costmap(self) -> Mapping[str, object]:
        """The costs of the map for this robot, as the fields of nav_msgs/OccupancyGrid."""
        from urc.simulator.world.occupancy import costmap

        return costmap(dict(self.occupancy_grid), self.spec.body.radius)

    def top_view(self, width: int, height: int) -> bytes:
        """Return a top view of the world as JPEG; draw at most five new images per second.

        `width` and `height` are in pixels, from 16 to 2000.
        """
        size = min(2000, max(16, width)), min(2000, max(16, height))

        def draw() -> bytes:
            from urc.simulator.world.top import top_picture

            trail = [*self._trail, (self.motion.x, self.motion.y)]
            return top_picture(self.plan, self.spec.body, self.motion, trail, size)

        return self._once(("top", size), 0.2, draw)

    def picture(self) -> bytes:
        """Return the camera image as JPEG, or as PNG if `is_plain`; draw at most ten per second."""
        flip, mirror = self._holds(self.spec.camera.flip), self._holds(self.spec.camera.mirror)

        def draw() -> bytes:
            if self.is_plain:
                return self._plain_picture(flip=flip, mirror=mirror)
            from urc.simulator.world.picture import camera_picture, jpeg

            spec = self.spec.camera
            seen = camera_picture(
                self.plan, self.faces(), self._pose(), (spec.width, spec.height), spec.fov
            )
            return jpeg(seen, flip=flip, mirror=mirror)

        return self._once(("camera", flip, mirror), 0.1, draw)

    def panorama(self) -> bytes:
        """Return a panorama as JPEG, with the forward direction in the middle.

        Each image column corresponds to a direction, and each row to a height.
        """

        def draw() -> bytes:
            from urc.simulator.world.picture import jpeg, panorama_picture

            return jpeg(panorama_picture(self.plan, self.faces(), self._pose(), _PANORAMA))

        return self._once("panorama", 0.5, draw)

    def point_cloud(self) -> bytes:
        """Return the points of a laser scanner with several rings, at most ten times per second."""

        def measure() -> bytes:
            from urc.simulator.world.points import scanned_points

            return scanned_points(self.faces(), _moment(self))

        return self._once("points", 0.1, measure)

    def faces(self) -> "EdgeArrays":
        """Return the edges of the map for ray casting."""
        if self._faces is None:
            from urc.simulator.world.rays import EdgeArrays

            self._faces = EdgeArrays(self.plan)
        return self._faces

    def _plain_picture(self, *, flip: bool, mirror: bool) -> bytes:
        """Return the image of a camera without tilt as PNG; raise KeyError for any other camera."""
        from urc.simulator.world.plain import LevelPose, level_picture, png

        spec, motion = self.spec.camera, self.motion
        if spec.tilt:
            raise KeyError("picture")
        place = (motion.x, motion.y, motion.z + spec.mount_height)
        pose = LevelPose(*place, motion.yaw, motion.pitch, motion.roll)
        planes = level_picture(self.plan, pose, (spec.width, spec.height), spec.fov)
        return png(planes, spec.width, flip=flip, mirror=mirror)

    def _pose(self) -> "CameraPose":
        from urc.simulator.world.picture import CameraPose

        motion, camera = self.motion, self.spec.camera
        return CameraPose(
            motion.x,
            motion.y,
            motion.z + camera.mount_height,
            motion.yaw,
            motion.pitch - camera.tilt,
            motion.roll,
        )

    def _once(self, name: object, every_s: float, draw: Callable[[], bytes]) -> bytes:
        now_s = self.time_s or 0.0
        kept = self._kept.get(name)
        if kept is not None and 0 <= now_s - kept[0] < every_s:
            return kept[1]
        while len(self._kept) >= 8:
            del self._kept[next(iter(self._kept))]
        picture = draw()
        self._kept[name] = now_s, picture
        return picture

    def _advance(self, inputs: Mapping[str, float]) -> None:
        motion = self.motion
        if self.battery.charge <= 0:
            inputs = {}
        move(self.spec.body, motion, inputs, STEP_S)
        self.odometry.advance(motion, STEP_S, self.noise)
        self.battery.advance(motion.effort, STEP_S)
        self._collide()
        self.tick += 1
        self.time_s = (self.time_s or 0.0) + STEP_S
        last = self._trail[-1]
        if math.hypot(motion.x - last[0], motion.y - last[1]) > _TRAIL_EVERY_M:
            self._trail.append((motion.x, motion.y))

    def _collide(self) -> None:
        """Move a body that overlaps an obstacle back to the obstacle's edge."""
        motion, self.touch = self.motion, None
        for _ in range(3):  # a corner has two edges
            touch = self.plan.touch(motion.x, motion.y, motion.z, self.spec.body.radius)
            if touch is None or touch.depth < 1e-9:
                return
            self.touch = touch
            dx, dy = motion.x - touch.x, motion.y - touch.y
            far = math.hypot(dx, dy)
            if far < 1e-9:
                dx, dy, far = -math.cos(motion.yaw), -math.sin(motion.yaw), 1.0
            motion.x += dx / far * touch.depth
            motion.y += dy / far * touch.depth


class SensorView(Mapping[str, object]):
    """The sensor view of a world; each value in `READINGS` is computed on access."""

    __slots__ = ("_world",)

    def __init__(self, world: World) -> None:
        """View `world`. The world must not advance while the view is in use."""
        self._world = world

    def __getitem__(self, name: str) -> object:
        world, motion = self._world, self._world.motion
        if name in world.dropped:
            raise KeyError(name)
        if name in _PLAIN:
            return getattr(motion, _PLAIN[name])
        if name == "heading":
            return math.degrees(math.pi / 2 - motion.yaw) % 360
        if name in ("joints", "legs"):
            return (joints_of if name == "joints" else legs_of)(world.spec.body, motion)
        if name in _SENSORS:
            return _SENSORS[name](world)
        if name == "picture":
            return world.picture()
        if name == "panorama":
            return world.panorama()
        if name == "occupancy_grid":
            return world.occupancy_grid
        if name == "costmap":
            return world.costmap
        if name == "point_cloud":
            return world.point_cloud()
        if name == "top":
            return world.top_view(320, 240)
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return iter(READINGS)

    def __len__(self) -> int:
        return len(READINGS)


_PLAIN: Final = {
    "x": "x",
    "y": "y",
    "z": "z",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
    "speed": "forward",
    "sideways": "sideways",
    "climb": "climb",
    "turn": "turn",
}


def _moment(world: World) -> SensorInput:
    return SensorInput(
        world.spec,
        world.plan,
        world.motion,
        world.touch,
        world.tick,
        world.time_s or 0.0,
        world.noise,
    )


def _laser(world: World) -> Mapping[str, object]:
    if world.is_plain:
        from urc.simulator.world.plain import sweep as plain_sweep

        return plain_sweep(world.plan, _moment(world))
    from urc.simulator.world.laser import sweep

    return sweep(world.faces(), _moment(world))


_SENSORS: Final[Mapping[str, Callable[[World], Mapping[str, object]]]] = {
    "odometry": lambda world: odometry(_moment(world), world.odometry),
    "imu": lambda world: imu(_moment(world)),
    "gps": lambda world: gps(_moment(world)),
    "contact": lambda world: contact(_moment(world)),
    "battery": lambda world: world.battery.readings(),
    "laser": _laser,
}
