"""The camera image of the emulated robot as JPEG, rendered by ray casting: walls, ground and sky.

Pure. The module imports numpy and Pillow, so it is loaded only on first use. Each image column
corresponds to one direction on the ground. The obstacles of each column are drawn from the farthest
to the nearest.
"""

import io
import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from urc.simulator.world.plan import WorldMap
from urc.simulator.world.rays import EdgeArrays, cast

__all__ = ["CameraPose", "camera_picture", "jpeg", "panorama_picture"]

Array = NDArray[np.float32]
_BINS: Final = 1440
"""Number of directions in a full circle around the camera."""
_LAYERS: Final = 4
"""Maximum number of edges drawn per direction. Several edges may be visible in one direction,
because a low box hides only the bottom of a wall."""
_SKY: Final = ((150, 184, 222), (226, 233, 240))
"""Colours of the sky, at the top and at the horizon."""
_GROUNDS: Final = {
    "floor": ((150, 146, 138), (128, 124, 118)),
    "grass": ((104, 138, 84), (92, 126, 74)),
    "water": ((70, 122, 150), (62, 112, 142)),
}
_FAR_M: Final = 25.0
"""Distance in metres at which a colour is blended equally with the colour of the horizon."""
_QUALITY: Final = 80


class CameraPose(NamedTuple):
    """Pose of the camera, in metres and radians."""

    x: float
    y: float
    z: float
    yaw: float
    pitch: float = 0.0
    """Pitch in radians, positive with the nose down."""
    roll: float = 0.0
    """Roll in radians, positive with the right side down."""


def camera_picture(
    plan: WorldMap, faces: EdgeArrays, pose: CameraPose, size: tuple[int, int], view: float
) -> NDArray[np.uint8]:
    """Return the image in the forward direction, as an array of rows, columns and RGB values.

    Args:
        plan: the obstacles.
        faces: edges of the world map.
        pose: pose of the camera.
        size: columns and rows of the image.
        view: horizontal field of view in radians, below pi.
    """
    ahead = _straight(*size, view)
    rotated = ahead @ _rotation(pose.pitch, pose.roll).T
    azimuth = np.arctan2(rotated[..., 1], rotated[..., 0])
    slope = rotated[..., 2] / np.hypot(rotated[..., 0], rotated[..., 1])
    return _seen(plan, faces, pose, azimuth, slope)


def panorama_picture(
    plan: WorldMap, faces: EdgeArrays, pose: CameraPose, size: tuple[int, int]
) -> NDArray[np.uint8]:
    """Return the panorama image, with a direction for each column and a height for each row."""
    columns, rows = size
    azimuth = np.linspace(math.pi, -math.pi, columns, endpoint=False, dtype=np.float32)
    height = np.linspace(math.pi / 2 - 0.01, -math.pi / 2 + 0.01, rows, dtype=np.float32)
    grid = (
        np.broadcast_to(azimuth, (rows, columns)),
        np.broadcast_to(height[:, None], (rows, columns)),
    )
    if abs(pose.pitch) > 1e-4 or abs(pose.roll) > 1e-4:
        around = np.cos(grid[1])
        ray = np.stack((around * np.cos(grid[0]), around * np.sin(grid[0]), np.sin(grid[1])), -1)
        ray = ray @ _rotation(pose.pitch, pose.roll).T
        flat = np.maximum(np.hypot(ray[..., 0], ray[..., 1]), 1e-4)
        return _seen(plan, faces, pose, np.arctan2(ray[..., 1], ray[..., 0]), ray[..., 2] / flat)
    return _seen(plan, faces, pose, grid[0], np.tan(grid[1]))


def jpeg(picture: NDArray[np.uint8], *, flip: bool = False, mirror: bool = False) -> bytes:
    """Return an image as JPEG, optionally upside down or mirrored."""
    if flip:
        picture = picture[::-1]
    if mirror:
        picture = picture[:, ::-1]
    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(out, "JPEG", quality=_QUALITY)
    return out.getvalue()


@lru_cache(maxsize=8)
def _straight(columns: int, rows: int, view: float) -> Array:
    """Return each pixel's direction for a level camera, as forward, left and up components."""
    focus = columns / 2 / math.tan(view / 2)
    left = (columns / 2 - 0.5 - np.arange(columns, dtype=np.float32)) / focus
    up = (rows / 2 - 0.5 - np.arange(rows, dtype=np.float32)) / focus
    shape = rows, columns
    parts = (np.ones(shape), np.broadcast_to(left, shape), np.broadcast_to(up[:, None], shape))
    return np.stack(parts, axis=-1).astype(np.float32)


def _rotation(pitch: float, roll: float) -> Array:
    """Return the rotation from camera directions to level directions, without yaw."""
    sp, cp, sr, cr = math.sin(pitch), math.cos(pitch), math.sin(roll), math.cos(roll)
    rows = ((cp, sp * sr, sp * cr), (0.0, cr, -sr), (-sp, cp * sr, cp * cr))
    return np.array(rows, dtype=np.float32)


def _seen(
    plan: WorldMap, faces: EdgeArrays, pose: CameraPose, azimuth: Array, slope: Array
) -> NDArray[np.uint8]:
    """Return the colours in the given directions.

    `azimuth` is the angle from the forward direction, positive to the left. `slope` is the rise
    over the horizontal distance, positive upwards.
    """
    direction = azimuth + np.float32(pose.yaw)
    picture = _open_country(plan, pose, direction, slope)
    if len(faces.height):
        bins = np.floor(direction * np.float32(_BINS / (2 * math.pi))).astype(np.int32) % _BINS
        _paint_edges(picture, faces, pose, bins, slope)
    return np.clip(picture, 0, 255).astype(np.uint8)


def _open_country(plan: WorldMap, pose: CameraPose, direction: Array, slope: Array) -> Array:
    """Return the colours of sky and ground in the given directions."""
    above, horizon = (np.array(one, dtype=np.float32) for one in _SKY)
    share = np.clip(slope * 1.5, 0, 1)[..., None]
    picture: Array = horizon + (above - horizon) * share
    below = slope < -1e-3
    far = np.float32(max(pose.z, 0.02)) / -slope[below]
    x = np.float32(pose.x) + far * np.cos(direction[below])
    y = np.float32(pose.y) + far * np.sin(direction[below])
    first, second = (np.array(one, dtype=np.float32) for one in _GROUNDS[plan.spec.ground])
    is_odd = ((np.floor(x).astype(np.int32) + np.floor(y).astype(np.int32)) & 1).astype(bool)
    ground = np.where(is_odd[:, None], first, second)
    for hole in plan.spec.holes:
        inside = (np.abs(x - hole.x) <= hole.width / 2) & (np.abs(y - hole.y) <= hole.depth / 2)
        ground[inside] = (40, 38, 36)
    haze = (far / (far + np.float32(_FAR_M)))[:, None]
    picture[below] = ground + (horizon - ground) * haze
    return picture


def _paint_edges(
    picture: Array, faces: EdgeArrays, pose: CameraPose, bins: NDArray[np.int32], slope: Array
) -> None:
    """Draw the obstacles, from the farthest to the nearest."""
    horizon = np.array(_SKY[1], dtype=np.float32)
    angles = (np.arange(_BINS, dtype=np.float64) + 0.5) * (2 * math.pi / _BINS)
    distance, share = cast(faces, pose.x, pose.y, angles)
    order = np.argsort(distance, axis=1)[:, :_LAYERS]
    rows = np.arange(_BINS)
    for layer in reversed(range(order.shape[1])):
        which = order[:, layer]
        far = distance[rows, which]
        if not np.isfinite(far).any():
            continue
        # Faces along x are a little darker than those along y; stripes make speed visible.
        shade = 0.82 + 0.18 * np.abs(faces.along[which, 0]) / np.maximum(faces.length[which], 1e-6)
        stripe = np.floor(share[rows, which] * faces.length[which] * 2).astype(np.int64) & 1
        colour = faces.colour[which] * (shade * (1 - 0.08 * stripe))[:, None]
        far = np.where(np.isfinite(far), far, 1e9).astype(np.float32)
        haze = (far / (far + _FAR_M))[:, None]
        colour = (colour + (horizon - colour) * haze).astype(np.float32)
        top = ((faces.height[which] - pose.z) / far).astype(np.float32)
        foot = (-pose.z / far).astype(np.float32)
        seen = (slope <= top[bins]) & (slope >= foot[bins]) & (far[bins] < 1e8)
        place = bins[seen]
        skirting = slope[seen] < foot[place] + np.float32(0.08) / far[place]
        picture[seen] = colour[place] * np.where(skirting, 0.7, 1.0).astype(np.float32)[:, None]
