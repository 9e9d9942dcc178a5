"""A rate that delays nothing at its own rate."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.motion.rate_limiter import RateLimiter


def test_values_at_the_rate_pass_at_once_even_with_jitter() -> None:
    rate_limiter = RateLimiter(0.02)
    times = [0.02 * n + (0.009 if n % 2 else 0.0) for n in range(200)]
    assert all(rate_limiter.allow(now) for now in times)


def test_two_may_follow_each_other_and_no_third() -> None:
    rate_limiter = RateLimiter(0.1)
    assert [rate_limiter.allow(1.0) for _ in range(3)] == [True, True, False]
    assert rate_limiter.free_at == pytest.approx(1.1)


@settings(max_examples=examples(100))
@given(
    rate=st.sampled_from([5, 20, 50, 60]),
    waits=st.lists(st.floats(0.0, 0.05), min_size=50, max_size=400),
)
def test_no_second_has_more_than_one_beyond_the_rate(rate: int, waits: list[float]) -> None:
    rate_limiter, now, taken = RateLimiter(1 / rate), 0.0, []
    for wait in waits:
        now += wait
        if rate_limiter.allow(now):
            taken.append(now)
    for start in taken:
        assert sum(1 for at in taken if start <= at < start + 0.999) <= rate + 1


def test_a_rate_is_needed() -> None:
    with pytest.raises(ValueError, match="greater than 0"):
        RateLimiter(0.0)
