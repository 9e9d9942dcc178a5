"""The hub: what a reader gets who comes late, reads slowly, or must not miss a thing."""

import asyncio
from collections.abc import Callable
from dataclasses import replace

import pytest

from urc.model.values import Sample, Signal
from urc.runtime import hub as hub_module
from urc.runtime.hub import (
    Hub,
    LinkState,
    LinkStatus,
    LogEntry,
    MotionRecord,
    Tapped,
    Traffic,
)

pytestmark = pytest.mark.anyio

SIGNALS = {name: Signal(name) for name in ("a", "b", "c")}
NOTE = LogEntry(1.0, "warning", "wire", "the robot hung up")
TRAFFIC = Traffic(1.0, "wire", "received", b"42\n")


def sample(name: str, value: float = 1.0) -> Sample:
    return Sample(name, value, 0.0)


@pytest.fixture
def hub() -> Hub:
    return Hub(SIGNALS)


@pytest.mark.parametrize(
    ("state", "is_ready", "attempts", "is_opening"),
    [
        ("connecting", False, 0, True),
        ("connecting", True, 0, False),
        ("connecting", False, 1, False),
        ("live", True, 0, False),
        ("lost", False, 0, False),
    ],
)
def test_a_link_opens_until_its_login_ends_or_an_attempt_fails(
    state: LinkState, is_ready: bool, attempts: int, is_opening: bool
) -> None:
    """A program that drives waits for no more than that: many robots never speak first."""
    link = LinkStatus("wire", state, "tcp x:1", 0.0, attempts=attempts, is_ready=is_ready)
    assert link.is_opening == is_opening


def test_signals_keep_the_order_of_the_driver(hub: Hub) -> None:
    """Clients are told indices, so they must never move."""
    assert hub.names == ("a", "b", "c")
    assert hub.index == {"a": 0, "b": 1, "c": 2}


@pytest.mark.parametrize(
    "change",
    [
        lambda hub: hub.publish([sample("a")]),
        lambda hub: hub.set_link(LinkStatus("wire", "live", "tcp x:1", 0.0)),
        lambda hub: hub.log(NOTE),
        lambda hub: hub.saw(TRAFFIC),
    ],
    ids=["sample", "link", "note", "traffic"],
)
def test_every_change_is_a_new_revision(hub: Hub, change: Callable[[Hub], None]) -> None:
    """Whoever has seen an older one knows that there is more."""
    before = hub.revision
    change(hub)
    assert hub.revision == before + 1


def test_link_that_did_not_change_is_no_new_revision(hub: Hub) -> None:
    """Nobody is woken for nothing."""
    hub.set_link(LinkStatus("wire", "live", "tcp x:1", 0.0))
    before = hub.revision
    hub.set_link(LinkStatus("wire", "live", "tcp x:1", 0.0))
    assert hub.revision == before


def test_reader_gets_the_newest_of_each_changed_signal_once(hub: Hub) -> None:
    """Newest wins: what was overwritten before it looked is not repeated."""
    with hub.subscribe() as subscription:
        hub.publish([sample("a", 1), sample("b", 1)])
        hub.publish([sample("a", 2)])
        assert subscription.changes() == [sample("a", 2), sample("b", 1)]
        assert subscription.changes() == []
        hub.publish([sample("b", 1)])
        assert subscription.changes() == [sample("b", 1)], "a repeated value has a new age"
    assert hub.latest("a") == sample("a", 2)
    assert hub.latest("c") is None


@pytest.mark.parametrize("count", [2, 40])
def test_a_signal_that_came_twice_at_once_counts_once(count: int) -> None:
    """The later one is the newest."""
    names = [f"s{place}" for place in range(count - 1)]
    hub = Hub({name: Signal(name) for name in names})
    newest = [sample(name, 2) for name in names]
    hub.publish([sample("s0", 1), *newest])
    assert hub.readings_since(0) == hub.changed_since(0) == newest
    assert hub.readings_since(1) == []
    assert hub.latest("s0") == sample("s0", 2)


def test_much_that_came_is_found_by_signal_whatever_comes_next() -> None:
    """The same again, other signals, a few, or a question."""
    names = [f"s{place}" for place in range(60)]
    hub = Hub({name: Signal(name) for name in names})
    for value in (1, 2):
        hub.publish([sample(name, value) for name in names[:30]])
    hub.publish([sample(name, 3) for name in names[20:]])
    assert (hub.latest("s0"), hub.latest("s25")) == (sample("s0", 2), sample("s25", 3))
    hub.publish([sample(name, 4) for name in names[20:]])
    hub.publish([sample("s1", 5)])
    found = {each.signal: each.value for each in hub.changed_since(2)}
    assert found == {"s1": 5, **dict.fromkeys(names[20:], 4)}


async def test_reader_is_woken_by_a_change_and_waits_without_one(hub: Hub) -> None:
    """`changed` returns at once when there is news, else with the next news."""
    with hub.subscribe() as subscription:
        hub.publish([sample("a")])
        await subscription.changed()
        subscription.changes()
        waiting = asyncio.create_task(subscription.changed())
        await asyncio.sleep(0)
        assert not waiting.done()
        hub.log(NOTE)
        async with asyncio.timeout(5):
            await waiting


async def test_reader_that_has_left_is_not_kept(hub: Hub) -> None:
    """Neither subscriptions nor taps outlive their context."""
    with hub.subscribe() as subscription, hub.tap(with_traffic=True) as tap:
        pass
    hub.publish([sample("a")])
    hub.saw(TRAFFIC)
    assert tap.drain() == []
    waiting = asyncio.create_task(subscription.changed())
    await asyncio.sleep(0)
    assert waiting.done(), "what happened can still be asked for"
    assert hub.traffic_watchers == 0


def test_tap_gives_everything_in_order(hub: Hub) -> None:
    """Samples that repeat a signal, notes, and the traffic around them."""
    hub.publish([sample("c")])
    with hub.tap(with_traffic=True) as tap:
        assert hub.traffic_watchers == 1
        hub.saw(TRAFFIC)
        hub.publish([sample("a", 1), sample("a", 2)])
        hub.log(NOTE)
        hub.publish([sample("a", 3)])
        expected: list[Tapped] = [TRAFFIC, sample("a", 1), sample("a", 2), NOTE, sample("a", 3)]
        assert tap.drain() == expected
        assert tap.drain() == []
        assert tap.dropped == 0


def test_tap_hears_of_lines_and_of_what_people_did(hub: Hub) -> None:
    """Nobody else does: who drove is no news to pages."""
    live, moved = (
        LinkStatus("wire", "live", "tcp x:1", 0.0),
        MotionRecord(1.0, "drive", {"speed": 1}),
    )
    assert not hub.is_tapped
    with hub.tap() as tap, hub.subscribe() as subscription:
        assert hub.is_tapped
        hub.set_link(live)
        hub.set_link(live)
        subscription.changes()
        hub.publish_record(moved)
        assert tap.drain() == [live, moved]
        assert hub.revision == subscription.seen


def test_tap_without_traffic_asks_for_none(hub: Hub) -> None:
    """Recording costs, so it is done for those only who look at it."""
    with hub.tap() as tap, hub.tap(with_traffic=True):
        hub.saw(TRAFFIC)
        assert tap.drain() == []


def test_full_tap_drops_the_oldest_and_counts_them(
    hub: Hub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reader that stands still costs bounded memory, and knows what it missed."""
    monkeypatch.setattr(hub_module, "TAP_KEPT", 3)
    with hub.tap() as tap:
        hub.publish([sample("a", number) for number in range(5)])
        hub.log(NOTE)
        assert tap.drain() == [sample("a", 3), sample("a", 4), NOTE]
        assert tap.dropped == 3
        hub.publish([sample("b")])
        assert tap.drain() == [sample("b")]
        assert tap.dropped == 3


async def test_tap_waits_for_the_next(hub: Hub) -> None:
    """`filled` returns at once when something is there, else when something comes."""
    with hub.tap() as tap:
        hub.publish([sample("a")])
        await tap.filled()
        tap.drain()
        waiting = asyncio.create_task(tap.filled())
        await asyncio.sleep(0)
        hub.publish([])
        await asyncio.sleep(0)
        assert not waiting.done(), "an empty batch is nothing to take"
        hub.publish([sample("b")])
        async with asyncio.timeout(5):
            await waiting
        assert tap.drain() == [sample("b")]


def test_notes_and_traffic_are_bounded(hub: Hub) -> None:
    """The hub keeps the last of them; the count of the log says how many there were."""
    for number in range(hub_module.NOTES_KEPT + 1):
        hub.log(replace(NOTE, text=str(number)))
    for _ in range(hub_module.TRAFFIC_KEPT + 1):
        hub.saw(TRAFFIC)
    assert (len(hub.notes), hub.notes_count) == (500, 501)
    assert len(hub.traffic) == 1000
