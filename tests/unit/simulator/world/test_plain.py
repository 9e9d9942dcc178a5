"""The sensors without numpy show what those with numpy show."""

import io
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from urc.images import media_type, picture_size
from urc.simulator.world import plain
from urc.simulator.world.laser import sweep
from urc.simulator.world.picture import CameraPose, camera_picture
from urc.simulator.world.plan import ROOM, WorldMap
from urc.simulator.world.rays import EdgeArrays

PLAN = WorldMap(ROOM)
SIZE = (160, 120)
VIEW = math.radians(69)
POSES = [
    (0.0, 0.0, 0.3),
    (-2.3, 1.1, 2.0),
    (4.2, -1.3, -1.2),
    (1.0, -2.0, 4.0),
    (3.3, 0.4, math.pi),
]


@pytest.mark.parametrize("pose", POSES)
def test_a_picture_is_the_picture_of_numpy_but_at_edges(pose: tuple[float, float, float]) -> None:
    """Numpy rounds directions to a quarter of a degree, so edges may be off by a pixel."""
    x, y, yaw = pose
    planes = plain.level_picture(PLAN, plain.LevelPose(x, y, 0.24, yaw), SIZE, VIEW)
    mine = np.stack([np.frombuffer(one, np.uint8).reshape(SIZE[::-1]) for one in planes], -1)
    other = camera_picture(PLAN, EdgeArrays(PLAN), CameraPose(x, y, 0.24, yaw), SIZE, VIEW)
    differs = np.abs(mine.astype(int) - other.astype(int)).max(axis=-1) > 8
    assert differs.mean() < 0.06
    assert mine.std() > 10


@pytest.mark.parametrize(("pitch", "roll"), [(0.04, 0.0), (-0.04, 0.0), (0.0, 0.03), (0.02, -0.03)])
@pytest.mark.parametrize("pose", POSES)
def test_a_leaning_camera_sees_almost_what_numpy_sees(
    pose: tuple[float, float, float], pitch: float, roll: float
) -> None:
    """A robot leans as soon as it moves; the image is then far from the level image."""
    x, y, yaw = pose

    def seen(*lean: float) -> Any:
        planes = plain.level_picture(PLAN, plain.LevelPose(x, y, 0.24, yaw, *lean), SIZE, VIEW)
        rows = [np.frombuffer(one, np.uint8).reshape(SIZE[::-1]) for one in planes]
        return np.stack(rows, -1).astype(int)

    leaning = CameraPose(x, y, 0.24, yaw, pitch, roll)
    other = camera_picture(PLAN, EdgeArrays(PLAN), leaning, SIZE, VIEW)
    fault = np.abs(seen(pitch, roll) - other).mean()
    assert fault < np.abs(seen() - other).mean() * 0.6
    assert (np.abs(seen(pitch, roll) - other).max(axis=-1) > 8).mean() < 0.1


@pytest.mark.parametrize("rows", [-200, -1, 0, 1, 119, 120, 200])
def test_a_moved_column_keeps_its_length(rows: int) -> None:
    """Also if it moves by more than the image's height."""
    moved = plain._moved_up(bytearray(range(120)), rows)
    assert len(moved) == 120
    assert moved[60] == min(119, max(0, 60 + rows))


@pytest.mark.parametrize(("flip", "mirror"), [(False, False), (True, False), (False, True)])
def test_a_png_contains_the_planes(flip: bool, mirror: bool) -> None:
    """As an independent decoder reads them."""
    planes = [bytearray(range(base, base + 12)) for base in (0, 50, 100)]
    data = plain.png(planes, 4, flip=flip, mirror=mirror)
    assert (media_type(data), picture_size(data)) == ("image/png", (4, 3))
    expected = np.stack([np.frombuffer(one, np.uint8).reshape(3, 4) for one in planes], -1)
    expected = expected[::-1] if flip else expected
    expected = expected[:, ::-1] if mirror else expected
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(data))), expected)


def moment(x: float, y: float, yaw: float, first: float, last: float) -> Any:
    """Return the input of a scanner without noise."""
    laser = SimpleNamespace(first=first, last=last, rays=360, max=12.0, noise=0.0)
    motion = SimpleNamespace(x=x, y=y, z=0.0, yaw=yaw)
    return SimpleNamespace(
        spec=SimpleNamespace(laser=laser, seed=1), motion=motion, tick=7, noise=1.0
    )


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("span", [(-math.pi, math.pi), (math.pi, -math.pi), (-1.0, 2.0)])
def test_a_scan_without_noise_is_that_of_numpy(
    pose: tuple[float, float, float], span: tuple[float, float]
) -> None:
    """Ray by ray, in both directions of rotation."""
    given = moment(*pose, *span)
    mine, other = plain.sweep(PLAN, given), sweep(EdgeArrays(PLAN), given)
    assert {**mine, "ranges": ()} == {**other, "ranges": ()}
    assert mine["ranges"] == other["ranges"]


def test_noise_depends_on_seed_and_tick_alone() -> None:
    """The same world gives the same scan."""
    given = moment(0.0, 0.0, 0.3, -math.pi, math.pi)
    given.spec.laser.noise = 0.05
    first = plain.sweep(PLAN, given)
    assert plain.sweep(PLAN, given) == first
    given.tick += 1
    assert plain.sweep(PLAN, given)["ranges"] != first["ranges"]
