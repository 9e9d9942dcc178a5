"""An old image slows a motion; without an image, there is no motion."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.model.exchange import Sight
from urc.motion.driving_lock import BLIND_S, Permit, SeenImage, SentImages, permit_of, slowed

SIGHT = Sight("front", 0.6, 0.2)


@pytest.mark.parametrize(
    ("age_s", "share"), [(0.0, 1.0), (0.2, 1.0), (0.3, 0.75), (0.4, 0.5), (0.59, 0.025)]
)
def test_the_permitted_speed_falls_linearly_between_both_ages(age_s: float, share: float) -> None:
    permit = permit_of(SIGHT, age_s)
    assert permit.share == pytest.approx(share)
    assert permit.for_s == pytest.approx(0.6 - age_s)


@pytest.mark.parametrize("age_s", [0.6, 0.7, 1e9, BLIND_S, math.nan])
def test_nothing_moves_by_an_image_that_is_too_old_or_missing(age_s: float) -> None:
    assert permit_of(SIGHT, age_s) == Permit(0.0, 0.0)


def test_without_the_first_age_the_speed_stays_until_the_end() -> None:
    sight = Sight("front", 0.6)
    assert permit_of(sight, 0.59).share == 1.0
    assert permit_of(sight, 0.6).share == 0.0


@given(st.floats(0, 10), st.floats(0, 10))
def test_an_older_image_never_permits_more(one: float, other: float) -> None:
    younger, older = sorted((one, other))
    assert permit_of(SIGHT, older).share <= permit_of(SIGHT, younger).share <= 1.0


def images() -> SentImages:
    """Return a page that has received image 7, taken at 10.0, at 10.1."""
    made = SentImages(frozenset({"front"}))
    made.sent("front", 7, 10.0, 10.1)
    return made


def test_the_age_counts_on_the_clock_of_the_server() -> None:
    """However long the tick was on its way, and whatever clock the page has."""
    assert images().age_s("front", SeenImage(7, 0.0), 10.15) == pytest.approx(0.15)
    assert images().age_s("front", SeenImage(7, 0.3), 10.5) == pytest.approx(0.5)


def test_a_page_that_reports_nothing_is_blind() -> None:
    assert images().age_s("front", None, 10.15) == BLIND_S


@pytest.mark.parametrize(
    "lie",
    [
        SeenImage(8, 0.0),  # not sent yet
        SeenImage(6, 0.0),  # sent to another page
        SeenImage(7, 0.2),  # shown before it was sent
        SeenImage(7, -0.1),  # shown in the future
        SeenImage(7, math.nan),
        SeenImage(7, math.inf),
    ],
)
def test_a_page_that_claims_what_it_cannot_show_is_blind(lie: SeenImage) -> None:
    assert images().age_s("front", lie, 10.15) == BLIND_S


def test_an_image_of_another_camera_is_no_view() -> None:
    made = SentImages(frozenset({"front", "rear"}))
    made.sent("rear", 7, 10.0, 10.1)
    assert made.age_s("front", SeenImage(7, 0.0), 10.15) == BLIND_S


def test_a_stamp_in_the_future_makes_no_image_younger() -> None:
    made = SentImages(frozenset({"front"}))
    made.sent("front", 7, 99.0, 10.1)
    assert made.age_s("front", SeenImage(7, 0.0), 10.6) == pytest.approx(0.5)


def test_a_number_that_returns_in_another_form_is_no_fresh_image() -> None:
    """The page shows image 7 of the old form since 10.2, and the new image 7 leaves at 10.6."""
    made = images()
    made.forget("front")
    assert made.age_s("front", SeenImage(7, 0.3), 10.5) == BLIND_S
    made.sent("front", 7, 10.5, 10.6)
    assert made.age_s("front", SeenImage(7, 0.5), 10.7) == BLIND_S


def test_only_the_newest_images_are_remembered_and_only_of_cameras_that_are_needed() -> None:
    made = SentImages(frozenset({"front"}))
    for number in range(2000):
        made.sent("front", number, 10.0, 10.0)
        made.sent("rear", number, 10.0, 10.0)
    assert made.age_s("front", SeenImage(1999, 0.0), 10.1) == pytest.approx(0.1)
    assert made.age_s("front", SeenImage(0, 0.0), 10.1) == BLIND_S
    assert made.age_s("rear", SeenImage(1999, 0.0), 10.1) == BLIND_S


def test_speeds_shrink_towards_rest_and_other_arguments_stay() -> None:
    rests = {"speed": 0.0, "us": 1500, "axes": (0.0, 10.0)}
    wanted = {"speed": -0.8, "us": 1901, "axes": (1.0, 20.0, 4.0), "gain": 0.5, "name": "a"}
    assert slowed(wanted, rests, 0.5) == {
        "speed": -0.4, "us": 1700, "axes": (0.5, 15.0, 2.0), "gain": 0.5, "name": "a",
    }  # fmt: skip


@pytest.mark.parametrize("value", [True, "fast", None, math.inf])
def test_what_is_no_number_is_left_to_the_check_of_the_arguments(value: object) -> None:
    assert slowed({"speed": value}, {"speed": 0.0}, 0.5) == {"speed": value}  # type: ignore[dict-item]


@given(st.integers(-1000, 1000) | st.floats(-1e6, 1e6), st.floats(0, 1))
def test_a_slowed_value_lies_between_rest_and_what_was_wanted(wanted: float, share: float) -> None:
    found = slowed({"speed": wanted}, {"speed": 0}, share)["speed"]
    assert isinstance(found, (int, float))
    assert abs(found) <= abs(wanted)
    assert found * wanted >= 0
    assert type(found) is type(wanted)
