"""The controls of a server that was held up: what moves is stopped, and nothing else."""

import pytest

from tests.unit.web.test_controls import Scene, scene
from urc.testing.clock import settle
from urc.web.wire import drive as wire

pytestmark = pytest.mark.anyio


def told(it: Scene) -> list[tuple[str, str]]:
    """Return the entries of the robot's log with their levels."""
    return [(note.level, note.text) for note in it.hub.notes]


async def test_a_server_that_was_held_up_stops_what_moves() -> None:
    """A short time is told alone; after half a second whoever drives begins anew."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        it.tick(ann)
        await it.clock.advance(0.05)
        await it.clock.hold_up(0.2)
        assert told(it) == [("info", "the server was blocked for 150 ms")]
        it.tick(ann)
        assert it.backend.texts[-1] == "drive speed=0.5"
        await it.clock.hold_up(0.7)
        assert it.backend.texts[-1] == "drive stop"
        assert {"t": "stopped", "command": "drive", "reason": "expired"} in it.read(ann)
        it.tick(ann)
        assert it.backend.texts[-1] == "drive stop"
        assert it.controls.watch.count == 2
        assert told(it)[1:] == [("warning", "the server was blocked for 600 ms")]


async def test_a_server_that_was_held_up_says_no_stop_twice() -> None:
    """The movers have stopped by themselves when the lease was over; at rest there is silence."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        it.tick(ann)
        await it.clock.hold_up(0.9)
        assert it.backend.texts == ["drive speed=0.5", "drive stop"]
        it.controls.handle(ann, wire.Release("drive"))
        it.say(ann, "take")
        it.tick(ann)
        it.controls.handle(ann, wire.Release("drive"))
        await settle()
        for _ in range(3):
            await it.clock.hold_up(0.9)
        assert it.backend.texts == ["drive speed=0.5", "drive stop"] * 2
