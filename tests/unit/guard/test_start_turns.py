"""Guards that start together: few load at once, and none waits without end."""

import asyncio
import os

import pytest

from urc.guard import start_turns as module
from urc.guard.start_turns import StartTurns, start_turns
from urc.testing.clock import settle

pytestmark = pytest.mark.anyio


class Launches:
    """The names of launched guards, in order."""

    def __init__(self, at_once: int) -> None:
        self.turns = StartTurns(at_once)
        self.names: list[str] = []

    def take(self, *names: str) -> None:
        for name in names:
            self.turns.take(name, lambda name=name: self.names.append(name))  # type: ignore[misc]


async def test_guards_start_in_order_as_soon_as_others_have_started() -> None:
    it = Launches(2)
    it.take("a", "b", "c", "d")
    assert it.names == ["a", "b"]
    it.turns.end("b")
    assert it.names == ["a", "b", "c"]
    it.turns.end("b")
    assert it.names == ["a", "b", "c"], "a turn ends once"
    it.turns.end("a")
    it.turns.end("c")
    assert it.names == ["a", "b", "c", "d"]


async def test_guard_in_a_hurry_waits_for_nobody_and_still_counts() -> None:
    it = Launches(1)
    it.take("a", "b", "c")
    it.turns.hurry("c")
    it.turns.hurry("c")
    assert it.names == ["a", "c"]
    it.turns.end("a")
    assert it.names == ["a", "c"]
    it.turns.end("c")
    assert it.names == ["a", "c", "b"]
    it.turns.hurry("nobody")
    assert it.names == ["a", "c", "b"]


async def test_guard_that_no_longer_wants_to_start_leaves_the_row() -> None:
    it = Launches(1)
    it.take("a", "b", "c")
    it.turns.end("b")
    it.turns.end("a")
    assert it.names == ["a", "c"]


async def test_guard_that_says_nothing_delays_others_for_a_bounded_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "START_TIMEOUT_S", 0.0)
    it = Launches(1)
    it.take("mute", "mute too", "c")
    async with asyncio.timeout(10):
        while it.names != ["mute", "mute too", "c"]:
            await settle()


async def test_guards_of_one_event_loop_share_its_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """One processor that this process may use stays free; at most four guards start."""
    assert start_turns() is start_turns()
    others = asyncio.new_event_loop()
    try:
        assert await asyncio.to_thread(others.run_until_complete, _own()) is not start_turns()
    finally:
        others.close()
    for processors, most in ((1, 1), (2, 1), (4, 3), (64, 4)):
        monkeypatch.setattr(module, "_turns", {})
        monkeypatch.setattr(
            os, "sched_getaffinity", lambda _, n=processors: set(range(n)), raising=False
        )
        it = Launches(0)
        it.turns = start_turns()
        it.take(*"abcdefghi")
        assert it.names == [*"abcdefghi"[:most]]


@pytest.mark.parametrize(("processors", "most"), [(None, 1), (1, 1), (3, 2), (64, 4)])
async def test_a_system_that_hides_what_a_process_may_use_counts_all_processors(
    monkeypatch: pytest.MonkeyPatch, processors: int | None, most: int
) -> None:
    """Or none: then one guard starts at a time."""
    monkeypatch.setattr(module, "_turns", {})
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: processors)
    it = Launches(0)
    it.turns = start_turns()
    it.take(*"abcdefghi")
    assert it.names == [*"abcdefghi"[:most]]


async def _own() -> StartTurns:
    return start_turns()
