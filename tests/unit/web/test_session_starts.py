"""Robots that start together: few guards load at once, and no robot waits without end."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from urc.testing.clock import settle
from urc.web.fleet.session_starts import SessionStarts

pytestmark = pytest.mark.anyio


class Starting:
    """A session, whose guard starts when the test says so."""

    def __init__(self) -> None:
        self.is_open = False
        self.guard = asyncio.Event()

    async def started(self) -> None:
        await self.guard.wait()

    @asynccontextmanager
    async def open(self) -> AsyncIterator["Starting"]:
        self.is_open = True
        yield self


class Broken(Starting):
    """A session that cannot be opened."""

    @asynccontextmanager
    async def open(self) -> AsyncIterator["Starting"]:
        raise OSError("no process")
        yield self


async def begin(
    stack: AsyncExitStack, starts: SessionStarts, *sessions: Starting
) -> list[asyncio.Task[Starting]]:
    """Request the starts in this order."""
    tasks = [asyncio.create_task(starts.enter(stack, one.open(), one)) for one in sessions]
    await settle()
    return tasks


async def test_start_waits_for_the_guards_before_it() -> None:
    starts, sessions = SessionStarts(at_once=2), [Starting() for _ in range(4)]
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, *sessions)
        assert [one.is_open for one in sessions] == [True, True, False, False]
        assert [task.done() for task in tasks[:2]] == [True, True], "an open session is not kept"
        sessions[1].guard.set()
        await settle()
        assert [one.is_open for one in sessions] == [True, True, True, False]
        sessions[0].guard.set()
        sessions[2].guard.set()
        assert await asyncio.gather(*tasks) == sessions


async def test_guard_that_does_not_start_keeps_no_other_robot_waiting() -> None:
    starts, (mute, other) = SessionStarts(at_once=1, timeout_s=0), (Starting(), Starting())
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, mute, other)
        assert await asyncio.gather(*tasks) == [mute, other]


async def test_session_that_fails_to_open_gives_its_turn_back() -> None:
    starts, (broken, other) = SessionStarts(at_once=1), (Broken(), Starting())
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, broken, other)
        with pytest.raises(OSError, match="no process"):
            await tasks[0]
        assert await tasks[1] is other


async def test_start_that_is_given_up_while_it_waits_takes_no_turn() -> None:
    starts, (first, second, third) = SessionStarts(at_once=1), (Starting(), Starting(), Starting())
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, first, second, third)
        tasks[1].cancel()
        first.guard.set()
        assert await tasks[2] is third
        assert not second.is_open


async def test_start_for_a_stop_does_not_wait() -> None:
    """The first is told when it asks, the second while it waits."""
    starts, (mute, owing, stopped, last) = SessionStarts(at_once=1), (Starting() for _ in range(4))
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, mute, stopped, last)
        assert await starts.enter(stack, owing.open(), owing, is_urgent=True) is owing
        starts.hurry(stopped)
        assert await tasks[1] is stopped
        for one in (mute, owing):
            one.guard.set()
        await settle()
        assert not last.is_open, "the guard of the stopped robot is still starting"
        stopped.guard.set()
        assert await tasks[2] is last
        starts.hurry(mute)


async def test_start_that_is_given_up_in_its_turn_gives_it_back() -> None:
    starts, (first, second, third) = SessionStarts(at_once=1), (Starting(), Starting(), Starting())
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, first, second, third)
        starts.hurry(second)
        tasks[1].cancel()
        first.guard.set()
        assert await tasks[2] is third
        assert not second.is_open


async def test_turn_of_a_start_that_was_just_given_up_goes_to_the_next() -> None:
    starts, (first, second, third) = SessionStarts(at_once=1), (Starting(), Starting(), Starting())
    async with AsyncExitStack() as stack:
        tasks = await begin(stack, starts, first, second, third)
        tasks[1].cancel()
        starts.hurry(second)
        first.guard.set()
        assert await tasks[2] is third
        assert not second.is_open
        fourth = asyncio.create_task(starts.enter(stack, (other := Starting()).open(), other))
        await settle()
        assert not fourth.done(), "the third guard is still starting"
        third.guard.set()
        assert await fourth is other
