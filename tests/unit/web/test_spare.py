"""A second line of a page that drives: whatever comes first counts, and nothing twice."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.unit.web.test_client import FakeLine
from tests.unit.web.test_controls import Scene, scene
from urc.testing.clock import settle
from urc.web.drive.operator_session import OperatorSession
from urc.web.drive.redundant_socket import (
    CLOSE_NO_SEAT,
    CLOSE_NOT_TAKEN,
    KEY_WITHIN_S,
    MESSAGES_PER_S,
    RedundantSocket,
)
from urc.web.feed.client_socket import FixedRights, SocketPeer
from urc.web.wire import drive as wire

pytestmark = pytest.mark.anyio


class Doubled(Scene):
    """A page that drives, `ann`, and a second line of hers."""

    def __init__(self, it: Scene, ann: OperatorSession, line: FakeLine) -> None:
        self.__dict__.update(it.__dict__)
        self.ann, self.line = ann, line

    def tick_of(self, number: int, speed: float = 0.5) -> dict[str, Any]:
        """Return a tick, as a page writes it."""
        self.read(self.ann)
        return {
            "t": "tick",
            "command": "drive",
            "epoch": self.controls.controller.lease.state.epoch,
            "number": number,
            "echo": self.beats["s1"],
            "arguments": {"speed": speed},
        }

    async def on_spare(self, message: dict[str, Any]) -> None:
        """Let it come on the second line."""
        self.line.say(message)
        await settle()

    async def on_main(self, message: dict[str, Any]) -> None:
        """Let it come on the first one."""
        words = {name: value for name, value in message.items() if name != "t"}
        kinds = {"tick": wire.Tick, "release": wire.Release, "stop": wire.Stop}
        self.controls.handle(self.ann, kinds[message["t"]](**words))
        await settle()


@asynccontextmanager
async def opened(it: Scene) -> AsyncIterator[FakeLine]:
    """Open a line that has said nothing yet."""
    line = FakeLine()
    task = asyncio.create_task(RedundantSocket(line, it.controls, it.clock, line).serve())
    yield line
    line.leave()
    await settle()
    assert task.done()


@asynccontextmanager
async def doubled() -> AsyncIterator[Doubled]:
    """Let somebody drive with two lines."""
    async with scene() as it, opened(it) as line:
        ann = it.add_page()
        it.say(ann, "take")
        line.say({"t": "spare", "key": ann.key})
        await settle()
        yield Doubled(it, ann, line)


async def test_what_comes_on_both_lines_counts_once_whichever_is_first() -> None:
    """A tick that one line has lost comes on the other, and moves the robot in time."""
    async with doubled() as it:
        await it.on_main(it.tick_of(1, 0.1))
        await it.on_spare(it.tick_of(1, 0.1))
        await it.clock.advance(0.05)
        await it.on_spare(it.tick_of(2, 0.2))
        await it.clock.advance(0.05)
        await it.on_spare(it.tick_of(3, 0.3))
        await it.on_main(it.tick_of(2, 0.2))
        await it.on_main(it.tick_of(3, 0.3))
        await it.clock.advance(0.05)
        assert it.backend.texts == [f"drive speed={value}" for value in (0.1, 0.2, 0.3)]
        assert [one for one in it.audit if one.what == "refused"] == []


async def test_a_tick_that_was_held_up_moves_nothing_that_was_let_go_since() -> None:
    """The release came on the other line; it comes again, and ends no new gesture."""
    async with doubled() as it:
        await it.on_main(it.tick_of(1))
        late = it.tick_of(2)
        let_go = {"t": "release", "command": "drive", "number": 3}
        await it.on_spare(let_go)
        await it.on_main(late)
        await it.clock.advance(0.1)
        assert it.backend.texts == ["drive speed=0.5", "drive stop"]
        await it.on_spare(it.tick_of(4, 0.25))
        await it.on_main(let_go)
        await it.clock.advance(0.1)
        assert it.backend.texts[2:] == ["drive speed=0.25"]


async def test_a_stop_counts_once_so_that_it_does_not_come_back_after_a_reset() -> None:
    """On either line; one without a number always counts."""
    async with doubled() as it:
        stop = {"t": "stop", "number": 7}
        await it.on_spare(stop)
        assert it.controls.controller.lease.state.latched_by == "screen 1"
        it.say(it.ann, "reset")
        await it.on_main(stop)
        assert it.controls.controller.lease.state.latched_by == ""
        await it.on_main({"t": "stop"})
        assert it.controls.controller.lease.state.latched_by == "screen 1"


async def test_both_lines_are_told_the_beats() -> None:
    """The page echoes the newest that it has, by whichever line."""
    async with doubled() as it:
        await it.clock.advance(0.2)
        it.read(it.ann)
        beats = [message["n"] for message in it.line.sent]
        assert len(beats) >= 3
        assert beats[-1] == it.beats["s1"]
        it.line.free.clear()
        await it.clock.advance(0.2)
        assert [message["n"] for message in it.line.sent] == beats, "none waits behind another"


async def test_a_second_line_ends_with_its_page_and_with_the_next_one() -> None:
    """Nothing that comes on it then is for anybody."""
    async with doubled() as it, opened(it) as other:
        other.say({"t": "spare", "key": it.ann.key})
        await settle()
        assert it.line.was_aborted
        await it.on_spare(it.tick_of(1))
        assert it.backend.texts == []
        it.controls.remove_page(it.ann)
        assert other.was_aborted


@pytest.mark.parametrize("first", [{"t": "spare", "key": "0"}, {"t": "tick"}, {"t": "spare"}])
async def test_who_does_not_know_the_key_is_turned_away(first: dict[str, str]) -> None:
    """Whatever is said first; no seat has a second line then."""
    async with scene() as it, opened(it) as line:
        ann = it.add_page()
        line.say(first)
        await settle()
        assert line.closed is not None
        assert line.closed[0] == CLOSE_NO_SEAT
        assert ann.spare is None


async def test_a_line_that_says_nothing_is_closed_in_time() -> None:
    """It holds a socket of ours."""
    async with scene() as it, opened(it) as line:
        await settle()
        await it.clock.advance(KEY_WITHIN_S + 0.1)
        assert line.closed is not None


@pytest.mark.parametrize(
    "said",
    [
        {"t": "drive", "verb": "take"},
        {"t": "run", "id": 1, "command": "beep"},
        {"t": "release", "command": "drive"},
        {"t": "tick", "command": 5},
    ],
)
async def test_it_takes_nothing_but_numbered_words_of_held_controls(said: dict[str, Any]) -> None:
    """Anything else closes it; the page's own line goes on."""
    async with doubled() as it:
        await it.on_spare(said)
        assert it.line.closed is not None
        assert it.line.closed[0] == CLOSE_NOT_TAKEN
        assert it.ann.spare is None
        await it.on_main(it.tick_of(5))
        assert it.backend.texts == ["drive speed=0.5"]


async def test_a_flood_closes_it() -> None:
    """As it closes a page's own line."""
    async with doubled() as it:
        for number in range(MESSAGES_PER_S + 1):
            it.line.say({"t": "release", "command": "drive", "number": number + 1})
        while it.line.closed is None:
            await settle()
        assert it.ann.spare is None


async def test_viewers_are_told_no_key() -> None:
    """They drive nothing."""
    async with scene() as it:
        operator = it.controls.add_page(SocketPeer(rights=FixedRights("watch")), lambda: None)
        (lease,) = it.read(operator)
        assert lease["spare"] == ""
