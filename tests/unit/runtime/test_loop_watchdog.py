"""An event loop that was held up is noticed by its own alarms."""

import logging

import pytest

from urc.runtime.loop_watchdog import LATE_S, LoopWatchdog
from urc.testing.clock import FakeClock

pytestmark = pytest.mark.anyio


class Scene:
    """A watch, and what it told."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.told: list[tuple[float, bool]] = []
        self.watch = LoopWatchdog(self.clock, lambda late, first: self.told.append((late, first)))
        self.watch.start()


async def test_a_loop_that_keeps_time_is_no_news() -> None:
    it = Scene()
    await it.clock.advance(60)
    assert (it.told, it.watch.count) == ([], 0)


async def test_a_loop_that_was_held_up_is_told_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A row of them is one line in the log; after a quiet time there is another."""
    it = Scene()
    with caplog.at_level(logging.WARNING):
        for held_s in (0.35, 0.8, LATE_S / 2):
            await it.clock.advance(0.05)
            await it.clock.hold_up(held_s)
        assert [(round(late, 2), first) for late, first in it.told] == [(0.3, True), (0.75, False)]
        assert [record.getMessage() for record in caplog.records] == [
            "the server was blocked for 300 ms"
        ]
        await it.clock.advance(20)
        await it.clock.hold_up(1.0)
    assert it.told[-1][1]
    assert len(caplog.records) == 2
    assert it.watch.count == 3


async def test_an_ended_watch_looks_no_more() -> None:
    it = Scene()
    it.watch.end()
    await it.clock.hold_up(5.0)
    assert it.told == []


async def test_a_watch_may_be_ended_twice_and_begun_again() -> None:
    it = Scene()
    it.watch.end()
    it.watch.end()
    it.watch.start()
    await it.clock.hold_up(5.0)
    assert len(it.told) == 1


async def test_the_worst_is_remembered() -> None:
    it = Scene()
    assert it.watch.worst_s == 0.0
    for held_s in (0.35, 0.85, 0.45):
        await it.clock.advance(0.05)
        await it.clock.hold_up(held_s)
    assert it.watch.worst_s == pytest.approx(0.8)
