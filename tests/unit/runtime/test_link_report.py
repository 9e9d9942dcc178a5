"""What people are told of a line, and that nobody can flood them with it."""

import pytest

from urc.protocol.events import Violation
from urc.runtime.hub import Hub
from urc.runtime.link_report import BURST, KINDS, LinkReport, LogRateLimiter
from urc.testing.clock import FakeClock

pytestmark = pytest.mark.anyio


async def test_notes_of_a_kind_are_told_a_few_at_once_then_seldom() -> None:
    """What was kept back is said with the next one that is told."""
    clock = FakeClock()
    limiter = LogRateLimiter(clock)
    assert [limiter.admit("a") for _ in range(BURST + 3)] == [0] * BURST + [None] * 3
    assert limiter.admit("b") == 0
    await clock.advance(10)
    assert [limiter.admit("a"), limiter.admit("a")] == [3, None]


async def test_kinds_are_bounded() -> None:
    """An engine of somebody else may invent kinds without end."""
    limiter = LogRateLimiter(FakeClock())
    told = [limiter.admit(f"kind {number}") for number in range(10 * KINDS)]
    assert told.count(0) == KINDS + BURST
    assert told.count(None) == len(told) - KINDS - BURST


async def test_state_keeps_its_time_while_only_its_detail_changes() -> None:
    """Since when it is lost counts from the loss, not from the latest attempt."""
    clock, hub = FakeClock(100.0), Hub({})
    report = LinkReport("wire", "tcp h:1", hub, clock)
    for reason in ("refused", "unreachable"):
        await clock.advance(5)
        report.fail("lost", reason)
    report.count(Violation("wire", "no-match", "what?"))
    report.publish()
    link = hub.links["wire"]
    assert (link.state, link.detail, link.since_s) == ("lost", "unreachable", 105.0)
    assert (link.attempts, link.faults, link.address) == (2, 1, "tcp h:1")
    texts = [(note.level, note.text) for note in hub.notes]
    assert texts == [
        ("warning", "lost: refused"),
        ("warning", "no-match: what?"),
    ]


async def test_a_line_that_brings_only_faults_says_which() -> None:
    """A wrong password is told in place of “nothing received yet”."""
    hub = Hub({})
    report = LinkReport("web", "http h:80", hub, FakeClock())
    report.show("connecting", "connected; nothing received yet", is_ready=True)
    report.count(Violation("web", "refused", "401 Unauthorized"))
    report.publish()
    assert hub.links["web"].detail == "connected; 401 Unauthorized"
    assert not hub.links["web"].is_opening, "nobody waits for a connection that is open"
