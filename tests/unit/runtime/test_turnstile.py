"""Who waits goes on in the order in which they came."""

import asyncio
from contextlib import suppress

import pytest

from urc.runtime.session import FifoEvent

pytestmark = pytest.mark.anyio


async def turn_of_the_loop() -> None:
    await asyncio.sleep(0)


class Door:
    """A turnstile, and the names of those who are through."""

    def __init__(self) -> None:
        self.event = asyncio.Event()
        self.turnstile = FifoEvent(self.event)
        self.through: list[str] = []

    async def go(self, name: str) -> None:
        if not self.turnstile.is_open:
            await self.turnstile.wait()
        self.through.append(name)


async def test_nobody_who_comes_late_overtakes_those_who_wait() -> None:
    """Not even somebody who comes when it has just happened, before they could go on."""
    door = Door()
    async with asyncio.TaskGroup() as group:
        for name in ("first", "second", "third"):
            group.create_task(door.go(name))
        await turn_of_the_loop()
        assert door.through == []
        late = group.create_task(door.go("late"))  # begins in the next turn of the loop
        door.event.set()  # the others go on in the one after it
        while not late.done():
            await turn_of_the_loop()
            group.create_task(door.go("later"))
    assert door.through[:4] == ["first", "second", "third", "late"]


async def test_who_gives_up_holds_up_nobody() -> None:
    """The others go on, and it is open afterwards."""
    door = Door()
    tasks = [asyncio.create_task(door.go(name)) for name in ("first", "second", "third")]
    await turn_of_the_loop()
    for one in tasks[:2]:
        one.cancel()
        with suppress(asyncio.CancelledError):
            await one
    door.event.set()
    await tasks[2]
    assert door.through == ["third"]
    assert door.turnstile.is_open
