"""Top views of the world as JPEG, for cards and pages of an emulated robot.

Pure. The module imports Pillow, so it is loaded only on first use.
"""

import io
import math
from collections.abc import Iterable
from typing import Final

from PIL import Image, ImageDraw

from urc.model.world import BodySpec
from urc.simulator.world.bodies import Motion, joints_of
from urc.simulator.world.plan import WorldMap

__all__ = ["top_picture"]

_GROUNDS: Final = {"floor": "#e9e6df", "grass": "#cfe0c0", "water": "#bcd9e6"}
_HOLE: Final = "#55504a"
_TRAIL: Final = "#7f8fa3"
_ROBOT: Final = "#1f6fd6"
_NOSE: Final = "#ffffff"
_OPEN_M: Final = 8.0
"""Width of the visible area in a world without obstacles, in metres."""

Point = tuple[float, float]


class _Map:
    """The transform from metres in the world to pixels in the top view."""

    def __init__(self, plan: WorldMap, motion: Motion, size: tuple[int, int]) -> None:
        low_x, low_y, high_x, high_y = plan.bounds
        if not plan.edges:
            low_x, high_x = motion.x - _OPEN_M / 2, motion.x + _OPEN_M / 2
            low_y, high_y = motion.y - _OPEN_M / 2, motion.y + _OPEN_M / 2
        self.scale = min(size[0] / (high_x - low_x + 0.4), size[1] / (high_y - low_y + 0.4))
        self._x = (low_x + high_x) / 2 - size[0] / 2 / self.scale
        self._y = (low_y + high_y) / 2 + size[1] / 2 / self.scale
        self.size = size

    def __call__(self, x: float, y: float) -> Point:
        return (x - self._x) * self.scale, (self._y - y) * self.scale


def top_picture(
    plan: WorldMap, body: BodySpec, motion: Motion, trail: Iterable[Point], size: tuple[int, int]
) -> bytes:
    """Return the top view, with north (y) up.

    Args:
        plan: the obstacles.
        body: declaration of the robot's body.
        motion: pose of the robot.
        trail: past positions of the robot, oldest first.
        size: columns and rows of the image, at least 16 each.
    """
    place = _Map(plan, motion, size)
    picture = Image.new("RGB", size, _GROUNDS[plan.spec.ground])
    draw = ImageDraw.Draw(picture)
    if not plan.edges:
        _draw_grid(draw, place, motion)
    for hole in plan.spec.holes:
        half_x, half_y = hole.width / 2, hole.depth / 2
        corners = (
            *place(hole.x - half_x, hole.y + half_y),
            *place(hole.x + half_x, hole.y - half_y),
        )
        draw.rectangle(corners, fill=_HOLE)
    for box in plan.spec.boxes:
        half_x, half_y = box.width / 2, box.depth / 2
        corners = (*place(box.x - half_x, box.y + half_y), *place(box.x + half_x, box.y - half_y))
        draw.rectangle(corners, fill=box.colour, outline="#4a4a4a")
    for wall in plan.spec.walls:
        ends = (place(wall.x1, wall.y1), place(wall.x2, wall.y2))
        draw.line(ends, fill="#3f4650", width=max(2, round(0.12 * place.scale)))
    points = [place(*one) for one in trail]
    if len(points) > 1:
        draw.line(points, fill=_TRAIL, width=max(1, round(0.04 * place.scale)))
    _draw_robot(draw, place, body, motion)
    out = io.BytesIO()
    picture.save(out, "JPEG", quality=80)
    return out.getvalue()


def _draw_grid(draw: ImageDraw.ImageDraw, place: _Map, motion: Motion) -> None:
    """Draw a grid line every metre, so that motion is visible in open space."""
    reach = math.ceil(max(place.size) / place.scale)
    for step in range(-reach, reach + 1):
        x, y = math.floor(motion.x) + step, math.floor(motion.y) + step
        draw.line((*place(x, motion.y - reach), *place(x, motion.y + reach)), fill="#d4d6d2")
        draw.line((*place(motion.x - reach, y), *place(motion.x + reach, y)), fill="#d4d6d2")


def _draw_robot(draw: ImageDraw.ImageDraw, place: _Map, body: BodySpec, motion: Motion) -> None:
    if body.type == "swimmer":
        points = [place(*point) for point in _spine(body, motion)]
        draw.line(points, fill=_ROBOT, width=max(3, round(0.1 * place.scale)), joint="curve")
        _dot(draw, points[0], max(2.0, 0.07 * place.scale), "#e0762a")
        return
    x, y = place(motion.x, motion.y)
    radius = max(5.0, body.radius * place.scale)
    if motion.z > 0.02:  # its shadow stays behind while it climbs
        shift = min(20.0, motion.z * place.scale / 4)
        _dot(draw, (x + shift, y + shift), radius, "#a9a9a4")
    _dot(draw, (x, y), radius, _ROBOT)
    nose = [
        (
            x + radius * 0.8 * math.cos(motion.yaw + turn),
            y - radius * 0.8 * math.sin(motion.yaw + turn),
        )
        for turn in (0.0, 2.5, -2.5)
    ]
    draw.polygon(nose, fill=_NOSE)


def _dot(draw: ImageDraw.ImageDraw, at: Point, radius: float, colour: str) -> None:
    draw.ellipse((at[0] - radius, at[1] - radius, at[0] + radius, at[1] + radius), fill=colour)


def _spine(body: BodySpec, motion: Motion) -> list[Point]:
    """Return the points along a jointed body, from head to tail."""
    length = 3 * body.radius / max(1, body.joints) * 2
    x, y = motion.x, motion.y
    angle = motion.yaw + math.pi
    points = [(x, y)]
    for joint in joints_of(body, motion):
        x, y = x + length * math.cos(angle), y + length * math.sin(angle)
        points.append((x, y))
        angle -= joint / 2
    return points
