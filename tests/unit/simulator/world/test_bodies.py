"""How bodies move, against what geometry and mechanics say."""

import math

import pytest

from urc.model.world import BodySpec
from urc.simulator.world.bodies import GRAVITY, Motion, joints_of, legs_of, move

DT_S = 0.02
INSTANT = 1e9
"""Acceleration at which a body is at its speed within the first step."""


def travel(body: BodySpec, seconds: float, **inputs: float) -> Motion:
    """Return where a body is after a time of the same inputs."""
    motion = Motion()
    for _ in range(round(seconds / DT_S)):
        move(body, motion, inputs, DT_S)
    return motion


@pytest.mark.parametrize(("speed", "turn"), [(0.5, 0.4), (0.3, -0.9), (-0.4, 0.5)])
def test_wheels_go_on_a_circle_of_speed_over_turn(speed: float, turn: float) -> None:
    """After any time the middle of the circle is speed / turn to the left."""
    body = BodySpec(speed=1, turn=2, acceleration=INSTANT, turn_acceleration=INSTANT)
    for seconds in (1.0, 3.14, 7.5):
        motion = travel(body, seconds, forward=speed, turn=turn)
        angle, radius = turn * round(seconds / DT_S) * DT_S, speed / turn
        assert (motion.x, motion.y) == pytest.approx(
            (radius * math.sin(angle), radius * (1 - math.cos(angle)))
        )
        assert motion.yaw == pytest.approx(math.remainder(angle, 2 * math.pi))


def test_wheels_go_straight_on_and_turn_on_the_spot() -> None:
    """Without a turn there is no circle, and without a speed no way."""
    body = BodySpec(acceleration=INSTANT, turn_acceleration=INSTANT)
    ahead = travel(body, 2.0, forward=0.5)
    assert (ahead.x, ahead.y, ahead.yaw) == pytest.approx((1.0, 0.0, 0.0))
    spot = travel(body, 1.0, turn=1.5)
    assert (spot.x, spot.y, spot.yaw) == pytest.approx((0.0, 0.0, 1.5))


def test_nothing_is_faster_than_it_can_nor_quicker_at_it() -> None:
    """From standing, v²/2a are needed, and then the greatest speed holds."""
    body = BodySpec(speed=1.0, acceleration=0.5)
    motion = travel(body, 4.0, forward=9.0)
    assert motion.forward == 1.0
    assert motion.x == pytest.approx(1.0 + 2.0, abs=0.02)


def test_tracks_lose_a_part_of_each_turn() -> None:
    """What the tracks were told to do is more than what comes of it."""
    body = BodySpec("tracks", slip=0.25, turn_acceleration=INSTANT)
    motion = travel(body, 1.0, turn=1.0)
    assert motion.yaw == pytest.approx(0.75)
    assert motion.told_turn == 1.0


def test_wheels_for_all_directions_go_sideways() -> None:
    """To the left is positive."""
    motion = travel(BodySpec("holonomic", acceleration=INSTANT), 2.0, forward=0.3, sideways=0.4)
    assert (motion.x, motion.y) == pytest.approx((0.6, 0.8))


def test_steered_wheels_turn_round_the_rear_axle() -> None:
    """Radius = wheelbase / tan(steer); without going there is no turn."""
    body = BodySpec("ackermann", wheelbase=0.4, acceleration=INSTANT, turn_acceleration=INSTANT)
    motion = travel(body, 2.0, forward=0.5, steer=0.3)
    radius = 0.4 / math.tan(0.3)
    assert math.hypot(motion.x, motion.y - radius) == pytest.approx(radius)
    assert motion.yaw == pytest.approx(1.0 / radius)
    assert travel(body, 2.0, steer=0.3).yaw == 0.0


def test_a_swimmer_goes_by_a_wave_that_runs_from_its_head_to_its_tail() -> None:
    """Each joint does what the one before did an eighth of a period ago."""
    body = BodySpec("swimmer", joints=8, frequency=1.0, amplitude=0.5, speed=0.4)
    motion = travel(body, 5.0, forward=1.0)
    assert motion.forward == pytest.approx(0.4)
    before = joints_of(body, motion)
    for _ in range(round(0.125 / 0.005)):
        move(body, motion, {"forward": 1.0}, 0.005)
    assert joints_of(body, motion)[1:] == pytest.approx(before[:-1], abs=1e-6)
    assert max(map(abs, before)) <= 0.5
    bent = travel(body, 3.0, forward=1.0, turn=1.0)
    assert bent.turn > 0
    assert sum(joints_of(body, bent)) / 8 == pytest.approx(0.5 / 3)
    assert travel(body, 3.0, turn=1.0).yaw == 0.0  # a bent body that does not swim stays


def test_legs_trot() -> None:
    """Those across from each other are half a turn apart, the diagonal ones together."""
    body = BodySpec("swimmer", legs=4)
    first, second, third, fourth = legs_of(body, Motion(phase=0.1))
    assert first == pytest.approx(fourth)
    assert second == pytest.approx(third)
    assert abs(first - second) == pytest.approx(math.pi)


def test_a_quadrotor_rises_hovers_leans_and_lands() -> None:
    """It obeys its sticks only once it is up, and leans into what accelerates it."""
    body = BodySpec("quadrotor", hover=0.8, speed=1.0, acceleration=2.0)
    motion = Motion()
    for _ in range(20):
        move(body, motion, {"flies": 1, "forward": 1.0}, DT_S)
    assert 0 < motion.z < 0.8
    assert motion.x == 0.0
    for _ in range(200):
        move(body, motion, {"flies": 1}, DT_S)
    assert motion.z == pytest.approx(0.8, abs=0.05)
    for _ in range(20):
        move(body, motion, {"flies": 1, "forward": 1.0, "sideways": 1.0}, DT_S)
    assert motion.pitch > 0.1  # nose down
    assert motion.roll < -0.1  # right side up: to the left
    for _ in range(300):
        move(body, motion, {"flies": 0}, DT_S)
    assert (motion.z, motion.forward) == (0.0, 0.0)


def test_a_quadrotor_whose_motors_are_cut_falls() -> None:
    """By half g t squared."""
    body, motion = BodySpec("quadrotor"), Motion(z=10.0, is_up=True)
    for _ in range(50):
        move(body, motion, {"flies": 1, "cut": 1}, DT_S)
    assert motion.z == pytest.approx(10 - GRAVITY / 2, abs=0.15)


def test_a_curve_is_felt_as_an_acceleration_to_its_middle() -> None:
    """v times w, to the left in a curve to the left."""
    body = BodySpec(acceleration=INSTANT, turn_acceleration=INSTANT)
    assert travel(body, 1.0, forward=0.5, turn=0.8).accelerations[1] == pytest.approx(0.4)
