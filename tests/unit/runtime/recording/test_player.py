"""A recording is played in its time: it runs, stands, goes elsewhere, and commands nothing."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from urc.problems import UrcError
from urc.runtime.hub import Hub
from urc.runtime.recording import player as module
from urc.runtime.recording.events import is_state
from urc.runtime.recording.player import FASTEST, REFUSAL, Player
from urc.runtime.recording.reader import RecordedMessage, Recording
from urc.runtime.session import CommandFailed
from urc.testing.clock import FakeClock, settle
from urc.testing.profile import line_profile

pytestmark = pytest.mark.anyio

START_NS = 1_700_000_000_000_000_000
LENGTH_S = 10


class Kept(Recording):
    """A recording that is no file: a value a second, and the robot is live from the beginning."""

    __slots__ = ()

    @property
    def extra(self) -> list[RecordedMessage]:
        """Of this test alone."""
        return self.topics  # type: ignore[return-value]

    def messages(self, from_ns: int) -> Iterator[RecordedMessage]:  # type: ignore[override]
        return (message for message in every(self.extra) if message.time_ns >= from_ns)

    def before(self, until_ns: int) -> list[RecordedMessage]:
        told = [one for one in every(self.extra) if one.time_ns < until_ns]
        return sorted({one.topic: one for one in told if is_state(one.topic)}.values())


def every(extra: Sequence[RecordedMessage]) -> list[RecordedMessage]:
    told = [*extra, said(0, "/link/wire", state="live", address="tcp bot:1")]
    told += [said(at, "/signals/battery", value=at) for at in range(LENGTH_S + 1)]
    told.append(said(5, "/log", level=2, name="wire", message="half of it"))
    return sorted(told, key=lambda message: message.time_ns)


def said(at_s: float, topic: str, **message: object) -> RecordedMessage:
    return RecordedMessage(START_NS + round(at_s * 1e9), topic, json.dumps(message).encode())


@pytest.fixture(autouse=True)
def nobody_waits_for_a_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    async def here(work: Callable[..., Any], *arguments: Any) -> Any:
        await asyncio.sleep(0)
        return work(*arguments)

    monkeypatch.setattr(module.asyncio, "to_thread", here)


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


def player(clock: FakeClock, **options: Any) -> Player:
    recording = Kept(Path("bot.mcap"), "", START_NS, START_NS + LENGTH_S * 10**9, [])
    return Player(recording, line_profile(), {"host": "x", "port": 1}, clock=clock, **options)


@asynccontextmanager
async def shown(played: Player) -> AsyncIterator[Hub]:
    async with played.session() as session:
        await settle()
        yield session.hub


def battery(hub: Hub) -> object:
    latest = hub.latest("battery")
    return latest.value if latest is not None else None


async def advance(clock: FakeClock, seconds: float) -> None:
    for _ in range(round(seconds * 4)):
        await clock.advance(0.25)
        await settle()


async def test_readings_come_in_their_time(clock: FakeClock) -> None:
    played = player(clock)
    async with shown(played) as hub:
        assert (battery(hub), hub.links["wire"].state) == (0, "live")
        await advance(clock, 3.25)
        assert battery(hub) == 3
        assert played.position_s == 3.25
        assert not hub.notes
        await advance(clock, 2)
        assert [note.text for note in hub.notes] == ["half of it"]


async def test_it_runs_only_while_somebody_looks_on(clock: FakeClock) -> None:
    """Who opens the page again finds it where it was left."""
    played = player(clock)
    await advance(clock, 5)
    assert played.position_s == 0.0
    async with shown(played):
        await advance(clock, 2)
    await advance(clock, 5)
    assert played.position_s == 2.0
    async with shown(played) as hub:
        assert battery(hub) == 2 or played.position_s == 2.0
        await advance(clock, 1)
        assert battery(hub) == 3


async def test_it_stands_while_it_is_paused(clock: FakeClock) -> None:
    played = player(clock)
    async with shown(played) as hub:
        await advance(clock, 2.5)
        played.pause()
        await advance(clock, 4)
        assert (battery(hub), played.position_s, played.is_playing) == (2, 2.5, False)
        played.play()
        await advance(clock, 1)
        assert (battery(hub), played.position_s) == (3, 3.5)


@pytest.mark.parametrize(("place", "value"), [(7.5, 7), (0.5, 0), (-3, 0), (10, 10), (99, 10)])
async def test_it_goes_to_any_place_while_it_stands(
    clock: FakeClock, place: float, value: int
) -> None:
    """What held there is shown at once; what is beyond an end means that end."""
    played = player(clock)
    async with shown(played) as hub:
        await advance(clock, 4.5)
        played.pause()
        played.seek(place)
        await settle()
        assert battery(hub) == value
        assert played.position_s == min(max(place, 0), LENGTH_S)


async def test_what_held_there_is_as_old_as_it_was(clock: FakeClock) -> None:
    played = player(clock)
    async with shown(played) as hub:
        played.pause()
        played.seek(4.75)
        await settle()
        latest = hub.latest("battery")
        assert latest is not None
        assert clock.now() - latest.time_s == pytest.approx(0.75)


async def test_nothing_stands_that_was_not_told_yet(clock: FakeClock) -> None:
    """Of a drive that went wrong nobody is shown what came later."""
    played = player(clock)
    played.recording.extra.append(said(6, "/signals/note", value="from the future"))
    async with shown(played) as hub:
        played.seek(7)
        await settle()
        latest = hub.latest("note")
        assert latest is not None
        assert latest.value == "from the future"
        played.seek(2)
        await settle()
        latest = hub.latest("note")
        assert latest is not None
        assert latest.value is None


async def test_a_file_that_goes_is_told_and_it_stands(
    clock: FakeClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bar does not run on over a page that stands still; back again, it is played on."""
    played = player(clock)
    async with shown(played) as hub:
        with monkeypatch.context() as patched:
            patched.setattr(Kept, "before", gone)
            played.seek(4)
            await settle()
        assert [note.text for note in hub.notes] == ["bot.mcap cannot be read"]
        assert not played.is_playing
        played.seek(4)
        await settle()
        assert battery(hub) == 4


def gone(*_: object) -> list[RecordedMessage]:
    raise UrcError("bot.mcap cannot be read")


async def test_it_runs_faster(clock: FakeClock) -> None:
    played = player(clock, speed=4.0)
    async with shown(played) as hub:
        await advance(clock, 2)
        assert (battery(hub), played.position_s) == (8, 8.0)
    assert player(clock, speed=1e9).speed == FASTEST


async def test_it_stands_at_its_end_and_begins_anew_when_it_is_told(clock: FakeClock) -> None:
    played = player(clock)
    async with shown(played) as hub:
        await advance(clock, 12)
        assert (battery(hub), played.position_s, played.is_playing) == (10, 10.0, False)
        played.play()
        await settle()
        await advance(clock, 1.5)
        assert (battery(hub), played.position_s, played.is_playing) == (1, 1.5, True)


async def test_it_is_looped(clock: FakeClock) -> None:
    played = player(clock, is_looped=True, start_s=8.0)
    async with shown(played) as hub:
        assert battery(hub) == 8
        await advance(clock, 4)
        assert played.is_playing
        assert played.position_s < 3


async def test_one_that_is_looped_stands_at_its_end_while_it_is_paused(clock: FakeClock) -> None:
    played = player(clock, is_looped=True)
    async with shown(played) as hub:
        played.pause()
        played.seek(LENGTH_S)
        await settle()
        assert (battery(hub), played.position_s) == (10, 10.0)


async def test_one_of_a_moment_is_not_looped_for_ever(clock: FakeClock) -> None:
    recording = Kept(Path("bot.mcap"), "", START_NS, START_NS, [])
    played = Player(recording, line_profile(), {}, clock=clock, is_looped=True)
    async with shown(played):
        assert (played.length_s, played.is_playing) == (0.0, False)


async def test_large_messages_are_read_a_few_at_a_time(
    clock: FakeClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A keyframe of a 4K camera has a megabyte, so a number of messages bounds no memory."""
    large = [RecordedMessage(START_NS + at * 10**8, "/other", bytes(10**6)) for at in range(60, 99)]
    read: list[RecordedMessage] = []

    def counted(_: Kept, from_ns: int) -> Iterator[RecordedMessage]:
        for message in every(large):
            read.append(message)
            yield message

    monkeypatch.setattr(Kept, "messages", counted)
    played = player(clock)
    async with shown(played) as hub:
        assert sum(one in large for one in read) <= 5
        await advance(clock, 12)
        assert battery(hub) == 10
        assert len(read) == len(every(large))


async def test_nothing_can_be_commanded(clock: FakeClock) -> None:
    async with player(clock).session() as session:
        assert session.backend is None
        with pytest.raises(CommandFailed) as refused:
            await session.command("ask", {})
        assert refused.value.message == REFUSAL


async def test_moving_it_again_and_again_leaves_nothing_behind(clock: FakeClock) -> None:
    played = player(clock)
    async with shown(played) as hub:
        for place in (9, 1, 8, 2, 7, 3):
            played.seek(place)
            played.pause()
            played.play()
            await settle()
        await advance(clock, 1.25)
        assert battery(hub) == 4
    await settle()
    assert len(asyncio.all_tasks()) <= 2
