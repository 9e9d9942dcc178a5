"""The laser scanner and the level camera without numpy and Pillow, for browsers and small machines.

Pure. `urc.simulator.world.laser` and `urc.simulator.world.picture` do the same work faster and
support every camera. The scanner's noise is not the same, because the random number generators
differ.
"""

import math
import random
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from urc.simulator.world.plan import Edge, WorldMap
from urc.simulator.world.sensors import SensorInput

__all__ = ["LevelPose", "level_picture", "png", "sweep"]

SCANNER_M: Final = 0.15
"""Height of the scanner above the ground, in metres."""
LAYERS: Final = 4
"""Maximum number of edges drawn per column."""
_SKY: Final = ((150, 184, 222), (226, 233, 240))
_GROUNDS: Final = {
    "floor": ((150, 146, 138), (128, 124, 118)),
    "grass": ((104, 138, 84), (92, 126, 74)),
    "water": ((70, 122, 150), (62, 112, 142)),
}
_HOLE: Final = (40, 38, 36)
_FAR_M: Final = 25.0
"""Distance in metres at which a colour is blended equally with the colour of the horizon."""
_TILES_M: Final = 30.0
"""Distance in metres beyond which the ground tiles are smaller than a pixel."""
STRIDE: Final = 2
"""Number of neighbouring columns that share one ray; a separate ray for each column would take too
long."""
_SHADES: Final = 4096
"""Number of slopes in a table of colours."""
_NEAREST: Final = 1e-6
_STEPS: Final = 1e-9

Channels = tuple[bytes, bytes, bytes]
Colour = tuple[float, float, float]


class LevelPose(NamedTuple):
    """Pose of a nearly level camera, in metres and radians."""

    x: float
    y: float
    z: float
    yaw: float
    pitch: float = 0.0
    """Small pitch in radians, positive with the nose down."""
    roll: float = 0.0
    """Small roll in radians, positive with the right side down."""


class _Hit(NamedTuple):
    far: float
    share: float
    edge: Edge


class _Relative(NamedTuple):
    """An edge relative to the camera: start, direction, and twice the area of their triangle."""

    ax: float
    ay: float
    dx: float
    dy: float
    area: float
    edge: Edge


class _Column(NamedTuple):
    """The data of one image column that do not depend on the camera's pose."""

    turn: float
    """Direction of the column, in radians left of the forward direction."""
    scale: float
    """Change of the ray's slope from one pixel row to the next."""
    even: Channels
    """Colours of the sky and of the ground's even tiles."""
    odd: Channels
    hole: Channels


def sweep(plan: WorldMap, moment: SensorInput) -> Mapping[str, object]:
    """Return ``world.laser``. A ray without an echo has the range None."""
    spec, motion = moment.spec.laser, moment.motion
    step = (spec.last - spec.first) / spec.rays
    first = motion.yaw + spec.first
    far = [math.inf] * spec.rays
    for edge in plan.edges:
        if edge.height > motion.z + SCANNER_M:
            for ray, distance in _echoes(edge, motion.x, motion.y, first, step, spec.rays):
                far[ray] = min(far[ray], distance)
    noise = random.Random(moment.spec.seed * 1_000_003 + moment.tick)  # noqa: S311  # no secret
    scale = spec.noise * moment.noise
    ranges = tuple(
        round(max(0.0, real + noise.gauss(0.0, scale)), 3) if real <= spec.max else None
        for real in far
    )
    ahead = round(-spec.first / step) % spec.rays if step else 0
    return {
        "ranges": ranges,
        "first": spec.first,
        "step": step,
        "nearest": min((one for one in ranges if one is not None), default=None),
        "ahead": ranges[ahead],
    }


def _echoes(
    edge: Edge, x: float, y: float, first: float, step: float, rays: int
) -> Iterator[tuple[int, float]]:
    """Yield the index and the distance of each ray that hits an edge."""
    start = math.atan2(edge.y1 - y, edge.x1 - x)
    swept = math.remainder(math.atan2(edge.y2 - y, edge.x2 - x) - start, math.tau)
    low, size = (start, swept) if swept >= 0 else (start + swept, -swept)
    lead = (low - first) % math.tau if step > 0 else (first - low - size) % math.tau
    stride = abs(step)
    if stride < _STEPS:
        return
    for turn in (lead - math.tau, lead):
        begin, end = math.ceil(turn / stride - _STEPS), math.floor((turn + size) / stride + _STEPS)
        for ray in range(max(0, begin), min(rays - 1, end) + 1):
            found = _meet(edge, x, y, first + step * ray)
            if found is not None:
                yield ray, found.far


def _meet(edge: Edge, x: float, y: float, angle: float) -> _Hit | None:
    """Return the intersection of a ray with an edge, or None."""
    cosine, sine = math.cos(angle), math.sin(angle)
    dx, dy = edge.x2 - edge.x1, edge.y2 - edge.y1
    cross = cosine * dy - sine * dx
    if not cross:
        return None
    ax, ay = edge.x1 - x, edge.y1 - y
    far = (ax * dy - ay * dx) / cross
    share = (ax * sine - ay * cosine) / cross
    return _Hit(far, share, edge) if far > _NEAREST and 0 <= share <= 1 else None


def level_picture(
    plan: WorldMap, pose: LevelPose, size: tuple[int, int], view: float
) -> list[bytearray]:
    """Return the forward image as three planes of rows: red, green and blue.

    Pitch and roll move whole columns up or down, which is accurate enough for small angles.

    Args:
        plan: the obstacles.
        pose: pose of the camera.
        size: columns and rows of the image.
        view: horizontal field of view in radians, below pi.
    """
    width, height = size
    planes = [bytearray(width * height) for _ in range(3)]
    edges = [_relative(one, pose) for one in plan.edges if _is_ahead(one, pose)]
    columns = _columns(plan.spec.ground, width, height, view, max(pose.z, 0.02))
    focus, down, aside = _focus(width, view), math.tan(pose.pitch), math.tan(pose.roll)
    for number, column in enumerate(columns):
        drawn = [bytearray(channel) for channel in column.even]
        angle = pose.yaw + column.turn
        layers = sorted(_hits(edges, math.cos(angle), math.sin(angle)))[:LAYERS]
        _draw_ground(drawn, column, plan, pose, angle, layers[-1].far if layers else _TILES_M)
        for hit in reversed(layers):
            _draw_edge(drawn, column, pose, hit)
        if rows := round(focus * (down - aside * math.tan(column.turn))):
            drawn = [_moved_up(channel, rows) for channel in drawn]
        for place in range(number * STRIDE, min(width, number * STRIDE + STRIDE)):
            for plane, channel in zip(planes, drawn, strict=True):
                plane[place::width] = channel
    return planes


def _focus(width: int, view: float) -> float:
    """Return the camera's focal length, in pixels."""
    return width / 2 / math.tan(view / 2)


def _moved_up(channel: bytearray, rows: int) -> bytearray:
    """Return a column moved up by a number of rows; the pixel next to the gap fills the gap."""
    rows = max(-len(channel), min(len(channel), rows))
    if rows < 0:
        return channel[:1] * -rows + channel[: len(channel) + rows]
    return channel[rows:] + channel[-1:] * rows


def _relative(edge: Edge, pose: LevelPose) -> _Relative:
    dx, dy = edge.x2 - edge.x1, edge.y2 - edge.y1
    ax, ay = edge.x1 - pose.x, edge.y1 - pose.y
    return _Relative(ax, ay, dx, dy, ax * dy - ay * dx, edge)


def _hits(edges: Sequence[_Relative], cosine: float, sine: float) -> Iterator[_Hit]:
    """Yield the intersections of a ray from the camera with the edges."""
    for ax, ay, dx, dy, area, edge in edges:
        cross = cosine * dy - sine * dx
        if cross and (far := area / cross) > _NEAREST:
            share = (ax * sine - ay * cosine) / cross
            if 0 <= share <= 1:
                yield _Hit(far, share, edge)


def _is_ahead(edge: Edge, pose: LevelPose) -> bool:
    """Return whether any part of an edge may be in front of the camera."""
    cosine, sine = math.cos(pose.yaw), math.sin(pose.yaw)
    ends = ((edge.x1, edge.y1), (edge.x2, edge.y2))
    return any((x - pose.x) * cosine + (y - pose.y) * sine > 0 for x, y in ends)


@lru_cache(maxsize=4)
def _columns(ground: str, width: int, height: int, view: float, z: float) -> list[_Column]:
    focus = _focus(width, view)
    steepest = height / 2 / focus
    first, second = _GROUNDS[ground]
    shades = [_shades(colour, z, steepest) for colour in (second, first, _HOLE)]
    found = []
    for place in range(0, width, STRIDE):
        left = (width / 2 - STRIDE / 2 - place) / focus
        scale = 1 / (focus * math.hypot(1.0, left))
        share = scale * focus * _SHADES / height
        middle = (height - 1) / 2
        rows = [int(_SHADES / 2 + (row - middle) * share) for row in range(height)]
        looks = [tuple(bytes(map(one.__getitem__, rows)) for one in three) for three in shades]
        found.append(_Column(math.atan(left), scale, *looks))  # type: ignore[arg-type]  # three each
    return found


def _shades(ground: tuple[int, int, int], z: float, steepest: float) -> Channels:
    """Return the colours for the slopes from `steepest` down to ``-steepest``."""
    above, horizon = _SKY
    planes = [bytearray(_SHADES + 1) for _ in range(3)]
    for place in range(_SHADES + 1):
        slope = steepest * (1 - 2 * place / _SHADES)
        if slope < -1e-3:
            colour = _hazy(ground, z / -slope)
        else:
            colour = _blend(horizon, above, min(1.0, max(0.0, slope * 1.5)))
        for plane, value in zip(planes, colour, strict=True):
            plane[place] = int(value)
    red, green, blue = map(bytes, planes)
    return red, green, blue


def _hazy(colour: Colour, far: float) -> Colour:
    return _blend(colour, _SKY[1], far / (far + _FAR_M))


def _blend(one: Colour, other: Colour, share: float) -> Colour:
    red, green, blue = (a + (b - a) * share for a, b in zip(one, other, strict=True))
    return red, green, blue


def _row(column: _Column, height: int, slope: float) -> int:
    """Return the first image row whose ray is not above `slope`."""
    return min(height, max(0, math.ceil(height / 2 - 0.5 - slope / column.scale)))


def _draw_ground(
    drawn: list[bytearray],
    column: _Column,
    plan: WorldMap,
    pose: LevelPose,
    angle: float,
    end_m: float,
) -> None:
    """Draw the odd tiles and the holes between the camera and `end_m`."""
    height, z = len(drawn[0]), max(pose.z, 0.02)
    cosine, sine = math.cos(angle), math.sin(angle)
    end_m = min(end_m, _TILES_M)
    turns = sorted([*_crossings(pose.x, cosine, end_m), *_crossings(pose.y, sine, end_m)])
    is_odd = bool(math.floor(pose.x) + math.floor(pose.y) & 1)
    begin = 0.0
    for turn in (*turns, end_m):
        if is_odd and turn > begin:
            _paint(drawn, column.odd, _rows(column, height, z, begin, turn))
        begin, is_odd = turn, not is_odd
    for hole in plan.spec.holes:
        low, high = 0.0, end_m
        for at, way, middle, extent in (
            (pose.x, cosine, hole.x, hole.width),
            (pose.y, sine, hole.y, hole.depth),
        ):
            near, far = middle - extent / 2 - at, middle + extent / 2 - at
            if abs(way) < _STEPS:
                low, high = (low, high) if near <= 0 <= far else (1.0, 0.0)
            else:
                low = max(low, min(near / way, far / way))
                high = min(high, max(near / way, far / way))
        if low < high:
            _paint(drawn, column.hole, _rows(column, height, z, low, high))


def _crossings(at: float, way: float, end_m: float) -> Iterator[float]:
    """Yield the distances at which a ray crosses the tiles along one axis."""
    if abs(way) < 1e-3:
        return
    line = math.floor(at) + (1 if way > 0 else 0)
    while (far := (line - at) / way) < end_m:
        if far >= 0:
            yield far
        line += 1 if way > 0 else -1


def _rows(column: _Column, height: int, z: float, near: float, far: float) -> slice:
    top = _row(column, height, -z / far)
    return slice(top, height if near <= 0 else _row(column, height, -z / near))


def _paint(drawn: list[bytearray], look: Channels, rows: slice) -> None:
    for channel, source in zip(drawn, look, strict=True):
        channel[rows] = source[rows]


def _draw_edge(drawn: list[bytearray], column: _Column, pose: LevelPose, hit: _Hit) -> None:
    height, edge, far = len(drawn[0]), hit.edge, hit.far
    dx, dy = edge.x2 - edge.x1, edge.y2 - edge.y1
    length = max(math.hypot(dx, dy), 1e-6)
    # Faces along x are a little darker than those along y; stripes make speed visible.
    shade = 0.82 + 0.18 * abs(dx) / length
    if math.floor(hit.share * length * 2) & 1:
        shade *= 0.92
    red, green, blue = (int(edge.colour[at : at + 2], 16) * shade for at in (1, 3, 5))
    colour = _hazy((red, green, blue), far)
    top = _row(column, height, (edge.height - pose.z) / far)
    skirting = _row(column, height, (0.08 - pose.z) / far)
    foot = _row(column, height, -pose.z / far)
    for channel, value in zip(drawn, colour, strict=True):
        channel[top:foot] = bytes((int(value),)) * max(0, foot - top)
        low = max(top, skirting)
        channel[low:foot] = bytes((int(value * 0.7),)) * max(0, foot - low)


def png(
    planes: Sequence[bytearray], width: int, *, flip: bool = False, mirror: bool = False
) -> bytes:
    """Return three planes as a PNG image, optionally upside down or mirrored.

    Source: ISO/IEC 15948.
    """
    height = len(planes[0]) // width
    stride = 1 + 3 * width
    rows = bytearray(stride * height)
    for number in range(height):
        source = (height - 1 - number if flip else number) * width
        for channel, plane in enumerate(planes):
            line = plane[source : source + width]
            begin = number * stride + 1 + channel
            rows[begin : (number + 1) * stride : 3] = line[::-1] if mirror else line
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in parts
    )
