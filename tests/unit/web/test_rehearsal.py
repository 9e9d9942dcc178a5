"""A tick is rehearsed shortly before it is due, and nobody but the processor notices."""

import json

import pytest

from tests.unit.web.test_controls import Scene, scene
from urc.web.drive.controls import Seat
from urc.web.drive.rehearsal import AHEAD_S, APART_S, EVERY_S, MOST
from urc.web.wire import drive as wire

pytestmark = pytest.mark.anyio

TICK_S = 0.05


def offer(it: Scene, seat: Seat, number: int, speed: float = 0.5) -> str:
    """Let a tick come as a page sends it."""
    it.read(seat)
    tick = {
        "t": "tick",
        "command": "drive",
        "epoch": it.controls.desk.lease.state.epoch,
        "number": number,
        "echo": it.beats["s1"],
        "arguments": {"speed": speed},
    }
    return it.controls.offer(seat, json.dumps(tick, separators=(",", ":")).encode())


async def drive(it: Scene, seat: Seat, first: int = 1, ticks: int = 4) -> None:
    """Tick at a page's pace; the last has just come."""
    for number in range(first, first + ticks):
        await it.clock.advance(TICK_S)
        offer(it, seat, number, number / 10)


async def test_the_last_tick_is_rehearsed_until_the_next_one_comes() -> None:
    """From shortly before it is due; what is written is what was ticked, and nothing else."""
    async with scene() as it:
        ann = it.sit()
        it.say(ann, "take")
        await drive(it, ann)
        it.movers.rehearsed.clear()
        await it.clock.advance(TICK_S - AHEAD_S - 0.0005)
        assert it.movers.rehearsed == []
        await it.clock.advance(AHEAD_S + 0.0005 - APART_S / 2)
        assert it.movers.rehearsed == [b"drive speed=0.4"] * round(AHEAD_S / EVERY_S)
        await it.clock.advance(APART_S)
        assert len(it.movers.rehearsed) == round(AHEAD_S / EVERY_S), "the tick would have to wait"
        assert offer(it, ann, 5, 0.5) == "in time"
        assert it.movers.texts == [f"drive speed={number / 10}" for number in range(1, 6)]


async def test_one_that_does_not_come_is_not_waited_for() -> None:
    """So many rehearsals, and then silence; the lease runs out as ever."""
    async with scene() as it:
        ann = it.sit()
        it.say(ann, "take")
        await drive(it, ann)
        it.movers.rehearsed.clear()
        await it.clock.advance(10)
        assert len(it.movers.rehearsed) == MOST - 1
        assert it.movers.texts[-1] == "drive stop"
        assert it.movers.reasons == ["expired"]


@pytest.mark.parametrize("end", ["release", "stop", "leave", "gone"])
async def test_nothing_is_rehearsed_when_nobody_drives(end: str) -> None:
    """However it ended."""
    async with scene() as it:
        ann = it.sit()
        it.say(ann, "take")
        await drive(it, ann)
        if end == "release":
            it.controls.hear(ann, wire.Release("drive", 5))
        elif end == "stop":
            it.controls.stop("ann")
        elif end == "leave":
            it.say(ann, "leave")
        else:
            it.controls.rise(ann)
        it.movers.rehearsed.clear()
        await it.clock.advance(10)
        assert it.movers.rehearsed == []


async def test_a_frame_with_a_number_is_made_once() -> None:
    """A rehearsal would use up a number that the robot never sees."""
    async with scene() as it:
        it.frames.number = 1
        ann = it.sit()
        it.say(ann, "take")
        await drive(it, ann)
        used = it.frames.number
        await it.clock.advance(TICK_S - EVERY_S / 2)
        assert (it.frames.number, it.movers.rehearsed) == (used, [])
