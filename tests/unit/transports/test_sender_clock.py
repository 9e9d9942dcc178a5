"""Times of capture from the sender reports of RTCP."""

import pytest

from urc.transports.sender_clock import SenderClock

REPORT = (2_208_988_800 + 1_700_000_000) << 32 | 1 << 31
"""Half a second after 1,700,000,000 s since 1970."""


def test_a_stamp_is_a_time_of_day_after_the_first_report() -> None:
    clock = SenderClock(90_000)
    assert clock.captured_s(5) is None
    clock.hear(REPORT, 90_000)
    assert clock.captured_s(90_000) == pytest.approx(1_700_000_000.5, abs=1e-5)
    assert clock.captured_s(135_000) == pytest.approx(1_700_000_001.0, abs=1e-5)


def test_stamps_begin_anew() -> None:
    clock = SenderClock(90_000)
    clock.hear(REPORT, 2**32 - 45_000)
    assert clock.captured_s(45_000) == pytest.approx(1_700_000_001.5, abs=1e-5)
    clock.hear(REPORT, 45_000)
    assert clock.captured_s(2**32 - 45_000) == pytest.approx(1_699_999_999.5, abs=1e-5)


def test_a_sender_without_a_clock_states_no_time() -> None:
    clock = SenderClock(90_000)
    clock.hear(REPORT, 0)
    clock.hear(0, 0)
    assert clock.captured_s(0) is None


def test_a_stamp_far_from_the_report_belongs_to_another_clock() -> None:
    clock = SenderClock(90_000)
    clock.hear(REPORT, 0)
    assert clock.captured_s(90_000 * 601) is None
