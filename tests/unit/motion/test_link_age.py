"""The age of input from another site: measured by one clock, and a cap of the speed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.motion.freshness import ControlInput, Freshness
from urc.motion.link_age import (
    FULL_SPEED_S,
    LONGEST_WAY_S,
    SHOWN_S,
    TOO_OLD_S,
    LinkAge,
    link_permit,
)

ways = st.floats(0, 2)
waits = st.floats(0, 0.2)


@pytest.mark.parametrize(
    ("age_s", "share"),
    [(0, 1), (0.15, 1), (0.185, 0.9), (0.325, 0.5), (0.465, 0.1), (0.5, 0), (0.9, 0)],
)
def test_the_speed_falls_linearly_between_150_and_500_ms(age_s: float, share: float) -> None:
    permit = link_permit(age_s)
    assert permit.share == pytest.approx(share)
    assert permit.for_s == pytest.approx(max(0.0, 0.5 - age_s))


def test_an_unknown_age_permits_nothing() -> None:
    assert link_permit(float("nan")) == (0, 0)


@given(st.lists(st.floats(0, 1), min_size=2))
def test_an_older_tick_never_permits_more(ages: list[float]) -> None:
    permits = [link_permit(age_s) for age_s in sorted(ages)]
    shares = [permit.share for permit in permits]
    assert shares == sorted(shares, reverse=True)
    assert all(permit.for_s <= TOO_OLD_S for permit in permits)


def test_on_a_steady_link_half_of_the_round_trip_is_age() -> None:
    link = LinkAge()
    assert link.measure(0.2, 1.0) == pytest.approx(0.1)
    assert link.measure(0.25, 1.1) == pytest.approx(0.15)


def test_a_delay_after_better_times_counts_whole() -> None:
    """It may be on the way from the page alone."""
    link = LinkAge()
    link.measure(0.1, 1.0)
    assert link.measure(0.5, 2.0) == pytest.approx(0.45)


def test_a_long_round_trip_from_the_beginning_counts_nearly_whole() -> None:
    """It may always have been slow on the way from the page alone."""
    assert LinkAge().measure(0.6, 1.0) == pytest.approx(0.45)


@given(st.lists(st.tuples(ways, waits, ways), min_size=1))
def test_a_tick_that_moves_is_never_older_than_both_limits_together(
    ticks: list[tuple[float, float, float]],
) -> None:
    """Whatever the ways are, and however much a page claims by echoing an old heartbeat."""
    link = LinkAge()
    for down_s, wait_s, up_s in ticks:
        age_s = link.measure(down_s + wait_s + up_s, 1.0)
        assert age_s >= (down_s + wait_s + up_s) / 2
        if link_permit(age_s).share > 0:
            assert up_s < TOO_OLD_S + LONGEST_WAY_S


@given(ways, st.lists(st.tuples(st.floats(0, 2), waits), min_size=1))
def test_on_a_link_with_equal_ways_no_tick_counts_as_fresher_than_it_is(
    way_s: float, delays: list[tuple[float, float]]
) -> None:
    """Both ways have the same smallest delay; everything above it counts as age."""
    link = LinkAge()
    link.measure(2 * way_s, 0.0)
    for more_s, wait_s in delays:
        age_s = link.measure(2 * way_s + wait_s + more_s, 1.0)
        assert age_s >= way_s + more_s - 1e-9


def test_the_state_is_told_for_a_moment_only() -> None:
    link = LinkAge()
    assert link.state(5.0) is None
    link.measure(0.35, 5.0)
    link.measure(0.5, 5.0)
    state = link.state(5.0 + SHOWN_S)
    assert state is not None
    assert state.age_s == pytest.approx(0.35)
    assert state.share == pytest.approx((TOO_OLD_S - 0.35) / (TOO_OLD_S - FULL_SPEED_S))
    assert link.state(5.01 + SHOWN_S) is None


def test_a_tick_of_another_site_is_refused_from_500_ms() -> None:
    """Its round trip may be longer than a page of this site is allowed."""
    fresh = Freshness(link=LinkAge())
    for number, (round_trip_s, refusal) in enumerate(
        [(0.3, ""), (0.6, ""), (0.64, ""), (0.651, "Link too slow: your input arrived 501 ms late")]
    ):
        echo = fresh.issue(10.0 + number)
        said = fresh.refusal(ControlInput(1, number, echo), 1, 10.0 + number + round_trip_s)
        assert said == refusal


def test_a_late_tick_may_be_followed_by_a_timely_one() -> None:
    fresh = Freshness(link=LinkAge())
    late, timely = fresh.issue(10.0), fresh.issue(10.9)
    assert fresh.refusal(ControlInput(1, 1, late), 1, 11.0) != ""
    assert fresh.refusal(ControlInput(1, 2, timely), 1, 11.0) == ""
