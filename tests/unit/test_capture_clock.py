"""The age that times of capture state: growth of a delay, wrong clocks, and clocks that step."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.capture_clock import WINDOW_S, CaptureAge, CaptureClock, step_words

WRONG_S = 1_700_000_000.0
"""A clock that shares no beginning with a monotonic one."""


def fed(
    clock: CaptureClock, *images: tuple[float, float], wrong_s: float = WRONG_S
) -> list[CaptureAge]:
    """Feed images, each with its true time of capture and its delay."""
    return [clock.age(at + wrong_s, at + delay) for at, delay in images]


def ages(*images: tuple[float, float], wrong_s: float = WRONG_S) -> list[float]:
    return [round(one.older_s, 6) for one in fed(CaptureClock(), *images, wrong_s=wrong_s)]


@pytest.mark.parametrize("wrong_s", [0.0, 180.0, -180.0, WRONG_S])
def test_only_the_growth_of_a_delay_counts_whatever_the_clock_says(wrong_s: float) -> None:
    assert ages((0, 0.2), (1, 0.2), (2, 0.7), (3, 1.4), (4, 0.2), wrong_s=wrong_s) == [
        *(0, 0, 0.5, 1.2, 0)
    ]


def test_a_smaller_delay_becomes_the_measure() -> None:
    assert ages((0, 0.5), (1, 0.3), (2, 0.5)) == [0, 0, 0.2]


def test_a_stamp_that_stands_still_makes_the_images_older_and_older() -> None:
    clock = CaptureClock()
    found = [clock.age(WRONG_S, float(now)) for now in range(5)]
    assert [one.older_s for one in found] == [0, 1, 2, 3, 4]
    assert {one.step_s for one in found} == {0.0}


def test_a_delay_that_stays_longer_than_the_window_counts_as_constant() -> None:
    clock = CaptureClock()
    fed(clock, (0, 0.1))
    late = fed(clock, *((float(at), 2.1) for at in range(1, int(WINDOW_S) + 40)))
    assert late[0].older_s == pytest.approx(2.0)
    assert late[int(WINDOW_S) - 10].older_s == pytest.approx(2.0), "not before the window ends"
    assert late[-1].older_s == pytest.approx(0.0)


def test_a_clock_that_is_set_back_does_not_make_images_old() -> None:
    clock = CaptureClock()
    fed(clock, (0, 0.1), (0.05, 0.1))
    first, second = fed(clock, (0.1, 0.1), (0.15, 0.4), wrong_s=WRONG_S - 180)
    assert first.older_s == 0
    assert first.step_s == pytest.approx(-180)
    assert second.older_s == pytest.approx(0.3), "the new comparison works like the first"
    assert second.step_s == 0


def test_a_clock_that_is_set_forward_does_not_hide_a_later_delay() -> None:
    clock = CaptureClock()
    fed(clock, (0, 0.1), (0.05, 0.1))
    first, second, third = fed(clock, (0.1, 0.1), (0.15, 0.1), (0.2, 0.9), wrong_s=WRONG_S + 60)
    assert first.step_s == pytest.approx(60)
    assert [first.older_s, second.older_s] == pytest.approx([0, 0])
    assert third.older_s == pytest.approx(0.8)


def test_a_clock_that_steps_all_the_time_is_told_once_a_minute() -> None:
    clock = CaptureClock()
    told = 0
    for number in range(1200):  # a minute
        wrong_s = WRONG_S + (100 if number % 4 < 2 else 0)
        told += bool(clock.age(number * 0.05 + wrong_s, number * 0.05).step_s)
    assert told == 1


def test_a_queue_of_an_earlier_connection_is_no_step_of_the_clock() -> None:
    """A latched image, and then live ones."""
    found = fed(CaptureClock(), (0, 90.0), (90.1, 0.1), (90.2, 0.1))
    assert [one.older_s for one in found] == pytest.approx([0, 0, 0])
    assert {one.step_s for one in found} == {0.0}


def test_images_in_another_order_are_no_step_of_the_clock() -> None:
    """As in a video with B-frames."""
    clock = CaptureClock(0.5)
    times = (0.0, 0.12, 0.04, 0.08, 0.24, 0.16, 0.2)
    found = [clock.age(WRONG_S + at, place * 0.04) for place, at in enumerate(times)]
    assert {one.step_s for one in found} == {0.0}
    assert max(one.older_s for one in found) < 0.2


def test_the_log_names_the_direction() -> None:
    assert "180.0 s behind" in step_words(-180)
    assert "2.5 s ahead of" in step_words(2.5)


@given(st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(0, 1e4)), max_size=60))
def test_a_source_never_makes_an_image_younger_than_its_arrival(
    images: list[tuple[float, float]],
) -> None:
    clock, now_s = CaptureClock(), 0.0
    for captured_s, wait_s in images:
        now_s += wait_s
        assert clock.age(captured_s, now_s).older_s >= 0
        assert len(clock._parts) <= 22
