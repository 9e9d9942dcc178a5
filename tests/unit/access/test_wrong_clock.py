"""A clock that is earlier than a known event."""

import time

import pytest

from urc.access.wrong_clock import RELEASED, KnownTime, clock_fault

RELEASE = RELEASED.timestamp()


@pytest.mark.parametrize("now", [RELEASE - 119, RELEASE, RELEASE + 1e9])
def test_a_clock_after_all_known_events_may_be_right(now: float) -> None:
    assert clock_fault(now) == ""
    assert clock_fault(now, [KnownTime(now + 119, "a sign-in"), KnownTime(0.0, "nothing")]) == ""


def test_a_clock_before_the_release_is_wrong() -> None:
    fault = clock_fault(0.0)
    assert time.strftime("%Y-%m-%d", time.localtime(0.0)) in fault
    assert "earlier than the release of this version of URC (2026-" in fault
    assert "\n" not in fault
    assert clock_fault(RELEASE - 121)
    assert "1970" in clock_fault(-1e30), "no calendar has this day"


def test_the_newest_event_is_named() -> None:
    known = [KnownTime(RELEASE + 10_000, "the newest sign-in"), KnownTime(RELEASE + 500, "old")]
    assert "earlier than the newest sign-in (" in clock_fault(RELEASE + 9_000, known)
