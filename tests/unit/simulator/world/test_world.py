"""The world of an emulated robot: walls, sensors, pictures, and the same again each time."""

import io
import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from urc.model.world import (
    READINGS,
    BatterySpec,
    BodySpec,
    Box,
    CameraSpec,
    LaserSpec,
    OdometrySpec,
    PlanSpec,
    Wall,
    WorldSpec,
)
from urc.simulator.world.chance import gauss, uniform, wander
from urc.simulator.world.plan import WorldMap
from urc.simulator.world.rays import EdgeArrays, first_hits
from urc.simulator.world.sensors import place_on_earth, quaternion
from urc.simulator.world.world import FARTHEST_S, World

SQUARE = PlanSpec(
    walls=(
        Wall(-2, -2, 2, -2, 2, "#ff0000"),
        Wall(2, -2, 2, 2, 2, "#00ff00"),
        Wall(2, 2, -2, 2, 2, "#0000ff"),
        Wall(-2, 2, -2, -2, 2, "#ffff00"),
    )
)
QUICK = BodySpec(radius=0.2, acceleration=1e9, turn_acceleration=1e9)


def world(spec: WorldSpec, **inputs: float) -> World:
    """Return a world at the time 0 whose body is always told the same."""
    made = World(spec, lambda _: inputs)
    made.advance(0.0)
    return made


def reading(made: World, name: str, now_s: float) -> Mapping[str, float]:
    """Return what one sensor tells."""
    found = made.view(now_s)[name]
    assert isinstance(found, Mapping)
    return found


def test_a_body_stops_at_a_wall_and_says_on_which_side_it_touches() -> None:
    """It is never nearer than its radius, and slides along."""
    made = world(WorldSpec(body=QUICK, map=SQUARE), forward=0.5)
    made.advance(10.0)
    assert made.motion.x == pytest.approx(1.8)
    touch = reading(made, "contact", 10.0)
    assert (touch["bump"], touch["bump_left"], touch["bump_right"]) == (True, True, True)
    slope = world(WorldSpec(body=QUICK, map=SQUARE, start=(0, 0, 0.5)), forward=0.5)
    slope.advance(20.0)
    assert (slope.motion.x, slope.motion.y) == pytest.approx((1.8, 1.8))


def test_a_wall_to_the_right_is_touched_on_the_right() -> None:
    """Beside it, not ahead."""
    spec = WorldSpec(body=QUICK, map=SQUARE, start=(-1.0, -1.0, -0.4))
    made = world(spec, forward=0.5)
    while made.touch is None:
        made.advance((made.time_s or 0) + 0.02)
    touch = reading(made, "contact", made.time_s or 0)
    assert (touch["bump_left"], touch["bump_right"]) == (False, True)


def test_what_flies_passes_over_a_box() -> None:
    """A box of half a metre holds up what rolls, and not what is higher."""
    plan = PlanSpec(boxes=(Box(1.0, 0.0, 0.4, 0.4, 0.5),))
    assert WorldMap(plan).touch(0.75, 0.0, 0.0, 0.2) is not None
    assert WorldMap(plan).touch(0.75, 0.0, 0.6, 0.2) is None


def test_cliff_sensors_look_over_the_edge() -> None:
    """Before the robot is there, and on its own side."""
    plan = PlanSpec(holes=(Box(1.0, 0.0, 1.0, 2.0),))
    made = world(WorldSpec(body=QUICK, map=plan, start=(0.2, 0.0, 0.0)), forward=0.5)
    assert not reading(made, "contact", 0.0)["cliff"]
    made.advance(0.2)
    touch = reading(made, "contact", 0.2)
    assert touch["cliff_front_left"]
    assert touch["cliff_front_right"]
    assert not touch["drop"]
    made.advance(2.0)
    assert reading(made, "contact", 2.0)["drop"]


def test_rays_go_as_far_as_geometry_says() -> None:
    """From the middle of a square: 2 / cos to the nearest side."""
    angles = np.radians(np.arange(0, 360, 7.0))
    told = first_hits(EdgeArrays(WorldMap(SQUARE)), 0.0, 0.0, 0.1, angles)
    expected = 2 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    assert told == pytest.approx(expected)
    assert np.isinf(first_hits(EdgeArrays(WorldMap(SQUARE)), 0.0, 0.0, 3.0, angles)).all()
    assert np.isinf(first_hits(EdgeArrays(WorldMap(PlanSpec())), 0.0, 0.0, 0.1, angles)).all()


def test_a_sweep_begins_where_it_says_and_goes_to_the_left() -> None:
    """Four rays: behind, right, ahead, left; what is too far is nothing."""
    spec = WorldSpec(map=SQUARE, start=(1.0, 0.5, 0.0), laser=LaserSpec(4, max=2.9, noise=0))
    sweep = reading(world(spec), "laser", 0.0)
    assert sweep["ranges"] == (None, 2.5, 1.0, 1.5)
    assert (sweep["nearest"], sweep["ahead"]) == (1.0, 1.0)
    assert (sweep["first"], sweep["step"]) == pytest.approx((-math.pi, math.pi / 2))


def test_noise_is_as_wide_as_declared() -> None:
    """Ten thousand ranges of 2 m, within three of their own standard errors."""
    spec = WorldSpec(map=SQUARE, laser=LaserSpec(2000, noise=0.05, max=5))
    made = world(spec)
    angles = -math.pi + 2 * math.pi / 2000 * np.arange(2000)
    real = first_hits(made.faces(), 0.0, 0.0, 0.1, angles)
    errors = []
    for step in range(5):
        ranges = reading(made, "laser", 0.02 * step)["ranges"]
        errors += (np.array(ranges) - real).tolist()
    assert np.std(errors) == pytest.approx(0.05, rel=0.03)
    assert abs(np.mean(errors)) < 3 * 0.05 / 100


def test_odometry_is_always_a_little_wrong_and_the_imu_feels_gravity() -> None:
    """The same way each time, by no more than declared."""
    spec = WorldSpec(body=QUICK, map=PlanSpec(), odometry=OdometrySpec(0.05))
    made = world(spec, forward=0.5)
    told = reading(made, "odometry", 10.0)
    assert made.motion.x == pytest.approx(5.0)
    assert 0 < abs(told["x"] - 5.0) <= 0.05 * 5
    exact = WorldSpec(body=QUICK, map=PlanSpec(), odometry=OdometrySpec(0.0))
    still = reading(world(exact), "imu", 1.0)
    assert still["az"] == pytest.approx(9.81, abs=0.1)
    assert (still["ax"], still["ay"]) == pytest.approx((0, 0), abs=0.1)
    turned = world(exact, turn=0.5)
    wheels = reading(turned, "odometry", 2.0)
    assert wheels["right"] - wheels["left"] == pytest.approx(1.0 * QUICK.radius * 1.6)
    assert (wheels["qz"], wheels["qw"]) == pytest.approx((math.sin(0.5), math.cos(0.5)))


def test_a_quaternion_is_that_of_three_turns() -> None:
    """Ten degrees of roll, twenty of pitch and thirty of yaw."""
    angles = (math.radians(10), math.radians(20), math.radians(30))
    assert quaternion(*angles) == pytest.approx((0.0381, 0.1893, 0.2393, 0.9515), abs=5e-5)


def test_metres_become_degrees_on_the_earth() -> None:
    """A minute of latitude is a nautical mile, within what the ellipsoid makes of it."""
    spec = WorldSpec(datum=(45.0, 7.0, 0.0))
    latitude, longitude = place_on_earth(spec, 0.0, 1852.0)
    assert (latitude - 45) * 60 == pytest.approx(1.0, abs=0.006)
    assert longitude == 7.0
    assert (place_on_earth(spec, 1000.0, 0.0)[1] - 7) == pytest.approx(1 / 78.847, rel=1e-4)


def test_a_receiver_writes_its_place_as_nmea_does() -> None:
    """Degrees and minutes side by side, south and west by letters."""
    spec = WorldSpec(map=PlanSpec(), datum=(-33.5, -7.25, 10.0))
    told = World(spec, lambda _: {}).view(1_700_000_000.0)["gps"]
    assert isinstance(told, Mapping)
    assert told["ddmm_latitude"].startswith(("3329.99", "3330.00"))
    assert told["ddmm_longitude"].startswith(("00714.99", "00715.00"))
    assert (told["north"], told["east"]) == ("S", "W")
    assert (told["time"], told["date"]) == ("221320", "141123")
    assert told["clock"] == "2023-11-14T22:13:20.000Z"


def test_a_battery_gives_as_much_as_is_drawn() -> None:
    """Five minutes of twelve amperes are half of two ampere hours; empty, it moves nothing."""
    spec = WorldSpec(
        body=QUICK, map=PlanSpec(), battery=BatterySpec(2.0, 100.0, idle=1.0, drive=2.0)
    )
    made = world(spec._replace(battery=BatterySpec(2.0, 100.0, idle=12.0)))
    for minute in range(1, 6):
        made.advance(60.0 * minute)
    assert made.battery.level == pytest.approx(50.0, abs=0.01)
    driven = world(spec, forward=1.0)
    driven.advance(36.0)
    assert driven.battery.charge == pytest.approx(2.0 - 3.0 * 36 / 3600, abs=1e-4)
    driven.battery.drain(0.0)
    driven.advance(40.0)
    assert driven.motion.forward == 0.0
    volts = reading(driven, "battery", 40.0)["voltage"]
    assert volts == pytest.approx(10.2, abs=0.05)


def test_somebody_changes_an_empty_battery_of_a_robot_that_stands() -> None:
    """Half a minute later; a low one is left to the operator."""
    spec = WorldSpec(body=QUICK, map=PlanSpec(), battery=BatterySpec(2.0, 80.0, idle=0.1))
    made = world(spec)
    made.low_battery()
    made.advance(50.0)
    assert made.battery.level == pytest.approx(12.0, abs=0.1)
    made.battery.drain(1.0)
    made.advance(70.0)
    assert made.battery.level < 1.0
    made.advance(85.0)
    assert made.battery.level == pytest.approx(80.0, abs=0.1)


def told(seed: int, moments: list[float]) -> list[object]:
    """Return what sensors tell at last, after looks at some moments."""
    spec = WorldSpec(seed=seed, laser=LaserSpec(8))
    made = world(spec, forward=0.4, turn=0.3)
    for now_s in moments:
        made.view(now_s)["imu"]
    view = made.view(5.0)
    return [view[name] for name in ("odometry", "imu", "gps", "battery", "laser")]


def test_the_same_seed_gives_the_same_world_however_often_one_looks() -> None:
    """And another one another."""
    assert told(3, []) == told(3, [0.7, 1.23, 1.24, 4.999])
    assert told(3, []) != told(4, [])


def test_chance_is_even_and_normal() -> None:
    """Means and deviations of ten thousand numbers."""
    flat = [uniform(1, tick, "a") for tick in range(10_000)]
    assert (np.mean(flat), np.std(flat)) == pytest.approx((0.5, 12**-0.5), abs=0.01)
    bell = [gauss(1, tick, "a") for tick in range(10_000)]
    assert (np.mean(bell), np.std(bell)) == pytest.approx((0, 1), abs=0.03)
    slow = [wander(1, float(second), "a") for second in range(600)]
    assert max(map(abs, slow)) <= 1
    assert max(abs(b - a) for a, b in pairwise(slow)) < 0.2


def test_a_world_that_nobody_looked_at_is_made_up_for_a_minute_at_most() -> None:
    """And a clock that is put back does not stop it for good."""
    made = world(WorldSpec(body=QUICK, map=PlanSpec()), forward=1.0)
    made.advance(1e6)
    assert made.motion.x == pytest.approx(FARTHEST_S, abs=0.05)
    made.advance(10.0)
    made.advance(11.0)
    assert made.motion.x == pytest.approx(FARTHEST_S + 1, abs=0.05)


def image(data: bytes) -> np.ndarray[tuple[int, ...], np.dtype[np.int16]]:
    """Return the points of a JPEG."""
    with Image.open(io.BytesIO(data)) as opened:
        assert opened.format == "JPEG"
        return np.asarray(opened.convert("RGB")).astype(np.int16)


def test_the_camera_sees_the_wall_it_looks_at() -> None:
    """A green one ahead, a blue one after a quarter turn to the left; sky above, ground below."""
    low = SQUARE._replace(walls=tuple(wall._replace(height=0.6) for wall in SQUARE.walls))
    spec = WorldSpec(map=low, camera=CameraSpec(fov=0.9))
    ahead = image(world(spec).picture())
    assert ahead.shape == (240, 320, 3)
    red, green, blue = ahead[110, 160]
    assert green > 150 > max(red, blue)
    red, green, blue = image(world(spec._replace(start=(0, 0, math.pi / 2))).picture())[110, 160]
    assert blue > 150 > max(red, green)
    assert ahead[5, 160].min() > 140  # above the wall
    assert np.ptp(ahead[235, 160]) < 40  # grey ground


def test_the_horizon_follows_roll_and_pitch() -> None:
    """Nose down moves it up the picture; the right side down makes it rise to the right."""

    def horizon(column: int, **held: float) -> int:
        made = world(WorldSpec(map=PlanSpec(ground="grass")))
        for name, value in held.items():
            setattr(made.motion, name, value)
        seen = image(made.picture())[:, column]
        return int(np.argmax(seen[:, 2] < seen[:, 1] - 10))  # the first green point from above

    level = horizon(160)
    assert horizon(20) == pytest.approx(level, abs=4)
    assert horizon(160, pitch=0.2) < level - 20
    assert horizon(300, roll=0.2) < level - 10 < level + 10 < horizon(20, roll=0.2)


def test_a_picture_changes_as_it_goes_and_can_be_turned_over() -> None:
    """Flipped and mirrored by what the document says."""
    made = world(WorldSpec(body=QUICK), forward=0.5)
    before = image(made.picture())
    made.advance(1.0)
    after = image(made.picture())
    assert np.abs(after - before).mean() > 2
    spec = WorldSpec(camera=CameraSpec(flip=True, mirror=True))
    upright = image(world(WorldSpec()).picture())
    assert np.abs(image(world(spec).picture())[::-1, ::-1] - upright).mean() < 3


def test_pictures_are_drawn_only_so_often() -> None:
    """Ten a second of the camera; asked again at once, the same one is given."""
    made = world(WorldSpec(body=QUICK), forward=0.5)
    made.advance(1.0)
    first = made.picture()
    made.advance(1.04)
    assert made.picture() is first
    made.advance(1.2)
    assert made.picture() is not first


def test_a_still_shows_all_around_with_ahead_in_the_middle() -> None:
    """Of the square: green ahead, blue left, yellow behind at both edges, red right."""
    seen = image(world(WorldSpec(map=SQUARE)).panorama())
    assert seen.shape == (256, 512, 3)
    row = 120
    assert seen[row, 256].argmax() == 1
    assert seen[row, 128].argmax() == 2
    assert seen[row, 384].argmax() == 0
    for edge in (2, 509):
        assert seen[row, edge, 2] < seen[row, edge, :2].min() - 50


def test_the_view_from_above_shows_where_it_is() -> None:
    """The robot's blue moves with it; a size that is none is made one."""
    spec = WorldSpec(body=QUICK, map=SQUARE)

    def blue(made: World) -> float:
        seen = image(made.top_view(200, 150))
        mask = (seen[..., 2] > seen[..., 0] + 80) & (seen[..., 2] > seen[..., 1] + 60)
        return float(np.nonzero(mask)[1].mean())

    start = world(spec)
    gone = world(spec, forward=0.5)
    gone.advance(2.0)
    assert blue(gone) > blue(start) + 20
    assert image(start.top_view(1, 10**6)).shape == (2000, 16, 3)
    assert image(world(spec._replace(map=PlanSpec())).top_view(64, 48)).shape == (48, 64, 3)
    fish = spec._replace(body=BodySpec("swimmer"))
    assert image(world(fish, forward=1.0).top_view(64, 48)).shape == (48, 64, 3)


def test_a_view_has_all_that_documents_may_read() -> None:
    """No name without a value, and no part either."""
    view = world(WorldSpec(body=BodySpec("swimmer", legs=4))).view(0.0)
    assert set(view) == set(READINGS)
    assert len(view) == len(READINGS)
    for name, parts in READINGS.items():
        value = view[name]
        if parts:
            assert isinstance(value, Mapping)
            assert set(value) == parts, name
    with pytest.raises(KeyError):
        view["nothing"]
