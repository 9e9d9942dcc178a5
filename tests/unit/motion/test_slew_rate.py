"""Values grow as fast as they may, and fall as fast as anybody wants."""

from random import Random

import pytest

from urc.motion.slew_rate import SlewRateLimiter


def rover(rest: float = 0.0) -> SlewRateLimiter:
    """Return the limits of a rover that may gain 2 a second."""
    return SlewRateLimiter({"speed": 2.0}, {"speed": rest}, 0.05)


def test_speed_grows_at_the_rate_from_rest() -> None:
    """The first value is worth one period; how often they come changes nothing."""
    slew = rover()
    assert slew.limit({"speed": 1.0}, 10.0) == {"speed": 0.1}
    assert slew.limit({"speed": 1.0}, 10.05)["speed"] == pytest.approx(0.2)
    assert slew.limit({"speed": 1.0}, 10.06)["speed"] == pytest.approx(0.22)
    assert slew.limit({"speed": 1.0}, 10.9) == {"speed": 1.0}


def test_slowing_down_is_never_limited() -> None:
    """Down to rest at once, and through it: then up from there."""
    slew = rover()
    slew.limit({"speed": 1.0}, 10.0)
    slew.limit({"speed": 1.0}, 11.0)
    assert slew.limit({"speed": 0.25}, 11.001) == {"speed": 0.25}
    assert slew.limit({"speed": 0}, 11.002) == {"speed": 0}
    slew.limit({"speed": 1.0}, 12.0)
    assert slew.limit({"speed": -1.0}, 12.05)["speed"] == pytest.approx(-0.1)


def test_rest_need_not_be_zero() -> None:
    """A servo that stands at 1500 µs."""
    slew = SlewRateLimiter({"us": 400}, {"us": 1500}, 0.05)
    assert slew.limit({"us": 1900}, 1.0) == {"us": 1520}
    assert slew.limit({"us": 1100}, 1.05) == {"us": 1480}


def test_whole_numbers_stay_whole_and_get_there() -> None:
    """What a step leaves over is not lost."""
    slew = SlewRateLimiter({"v": 8.0}, {}, 0.0625)
    seen = [slew.limit({"v": 3}, 1.0 + step * 0.0625)["v"] for step in range(6)]
    assert seen == [0, 1, 1, 2, 2, 3]
    assert all(type(one) is int for one in seen)


def test_each_element_of_an_array_has_its_own_limit() -> None:
    slew = SlewRateLimiter({"joints": 1.0}, {"joints": (0.0, 1.0)}, 0.1)
    assert slew.limit({"joints": (1.0, 1.0)}, 1.0) == {"joints": (0.1, 1.0)}
    assert slew.limit({"joints": [0.0, 2.0]}, 1.1) == {"joints": (0.0, 1.1)}


def test_a_new_motion_begins_at_rest() -> None:
    slew = rover()
    slew.limit({"speed": 1.0}, 1.0)
    slew.limit({"speed": 1.0}, 2.0)
    slew.reset()
    assert slew.limit({"speed": 1.0}, 2.05) == {"speed": 0.1}


@pytest.mark.parametrize("bad", ["fast", None, True, float("nan"), float("inf"), (1.0, "x")])
def test_what_is_no_number_is_left_to_the_check(bad: object) -> None:
    given = rover().limit({"speed": bad}, 1.0)["speed"]  # type: ignore[dict-item]
    assert given is bad


def test_no_course_of_values_grows_faster_than_the_rate_or_leaves_its_bounds() -> None:
    dice = Random(3)  # noqa: S311 - it is no secret
    slew, now, before = rover(), 0.0, 0.0
    for step in range(20_000):
        passed_s = dice.choice((0.0, 0.01, 0.05, 0.2))
        now += passed_s
        wanted = dice.uniform(-1, 1)
        found = slew.limit({"speed": wanted}, now)["speed"]
        assert isinstance(found, float)
        assert abs(found) <= abs(wanted)
        gained = abs(found) - (abs(before) if found * before > 0 else 0.0)
        assert gained <= 2.0 * (passed_s if step else 0.05) + 1e-9
        before = found


def test_a_value_within_its_room_is_left_as_it_is() -> None:
    """To the last bit: what somebody typed is what the robot hears."""
    slew = SlewRateLimiter({"x": 100.0}, {"x": 0.7}, 1.0)
    assert slew.limit({"x": 0.1}, 1.0) == {"x": 0.1}


def test_other_side_of_a_rest_is_as_far_away_as_it_is() -> None:
    slew = SlewRateLimiter({"us": 400}, {"us": 90}, 0.05)
    assert slew.limit({"us": -85}, 1.0) == {"us": 70}


def test_elements_without_a_rest_stand_at_zero() -> None:
    slew = SlewRateLimiter({"wheels": 2.0}, {"wheels": (1.0,)}, 0.5)
    assert slew.limit({"wheels": (9.0, 9.0, -9.0)}, 1.0) == {"wheels": (2.0, 1.0, -1.0)}
