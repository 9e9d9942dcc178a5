"""Server-Sent Events: the newest values, slow readers, and the end of a stream."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Any

import pytest
from starlette.types import Message

from urc.model.values import Signal
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.api import event_stream
from urc.web.api.event_stream import BEAT_S, EVENTS_PER_S, EventStream
from urc.web.fleet.robots import Robot, RobotService

pytestmark = pytest.mark.anyio


class Reader:
    """A reader that a test can make deaf."""

    def __init__(self, clock: FakeClock, robot: FakeRobot, service: RobotService) -> None:
        self.clock = clock
        self.robot = robot
        self.service = service
        self.chunks: list[bytes] = []
        self.is_over = False
        self.may_read = True
        self.aborted = 0
        self.rechecks: set[Callable[[], None]] = set()
        self._hears = asyncio.Event()
        self._hears.set()
        self._left = asyncio.Event()
        self.closing = asyncio.Event()
        self.task: asyncio.Task[None] | None = None

    async def open(self, *signals: str, method: str = "GET") -> None:
        with self.service.visit():
            live = await self.service.live()
            stream = EventStream(
                live,
                signals or ("battery",),
                self.clock,
                may_read=lambda: self.may_read,
                followed=self.followed,
                visit=self.service.visit(),
            )
            state = {"abort": self.abort, "closing": self.closing}
            scope = {"type": "http", "method": method, "state": state}
            self.task = asyncio.create_task(stream(scope, self.receive, self.send))
            await settle()

    @contextmanager
    def followed(self, recheck: Callable[[], None]) -> Iterator[None]:
        self.rechecks.add(recheck)
        try:
            yield
        finally:
            self.rechecks.discard(recheck)

    async def send(self, message: Message) -> None:
        await self._hears.wait()
        if message["type"] == "http.response.body":
            self.chunks.append(message["body"])
            self.is_over = not message.get("more_body", False)

    async def receive(self) -> Message:
        await self._left.wait()
        return {"type": "http.disconnect"}

    def abort(self) -> None:
        self.aborted += 1

    def deafen(self) -> None:
        self._hears.clear()

    def hear(self) -> None:
        self._hears.set()

    async def leave(self) -> None:
        self._left.set()
        await settle()

    async def reading(self, value: int) -> None:
        self.robot.set_reading("battery", value)
        await self.clock.advance(2 / EVENTS_PER_S)

    @property
    def events(self) -> list[tuple[str, Any]]:
        """Name and data of all events, in order; comments are left out."""
        found = []
        for block in b"".join(self.chunks).decode().split("\n\n"):
            if block.startswith("event: "):
                name, data = block.split("\n")
                found.append((name[7:], json.loads(data[6:])))
        return found

    @property
    def values(self) -> list[object]:
        told = [data["values"] for name, data in self.events if name == "values"]
        return [one["battery"]["value"] for one in told if "battery" in one]


@asynccontextmanager
async def reader() -> AsyncIterator[Reader]:
    clock = FakeClock()
    profile = dashboard_profile(
        signals={"battery": Signal("battery", "integer"), "mode": Signal("mode", "string")}
    )
    robot = FakeRobot(profile, clock)
    service = RobotService(Robot(profile, {}, robot.open), clock=clock)
    running = asyncio.create_task(service.run())
    found = Reader(clock, robot, service)
    try:
        yield found
    finally:
        await found.leave()
        running.cancel()
        await settle()


async def test_changes_are_sent_and_nothing_else() -> None:
    async with reader() as it:
        await it.open()
        await it.reading(40)
        it.robot.set_reading("mode", "auto")
        await it.clock.advance(1.0)
        await it.reading(41)
        assert it.values == [40, 41]
        assert it.events[0] == ("connections", {"wire": "live"})
        it.robot.link("lost")
        await it.clock.advance(1.0)
        assert it.events[-1] == ("connections", {"wire": "lost"})


async def test_a_slow_reader_skips_to_the_newest_value() -> None:
    """Nothing is queued for it, and a second reader is not delayed."""
    async with reader() as it:
        await it.open()
        await it.reading(1)
        it.deafen()
        for value in range(2, 50):
            await it.reading(value)
        it.hear()
        await it.clock.advance(1.0)
        assert it.values[0] == 1
        assert it.values[-1] == 49
        assert len(it.values) <= 3


async def test_bursts_are_limited() -> None:
    async with reader() as it:
        await it.open()
        for value in range(1000):
            it.robot.set_reading("battery", value)
            await it.clock.advance(0.001)
        assert len(it.values) <= EVENTS_PER_S + 2
        await it.clock.advance(1.0)
        assert it.values[-1] == 999


async def test_a_quiet_stream_has_comments() -> None:
    async with reader() as it:
        await it.open()
        await it.clock.advance(3 * BEAT_S)
        assert b"".join(it.chunks).count(b": beat\n\n") in (2, 3)


async def test_a_stream_ends_with_the_right() -> None:
    async with reader() as it:
        await it.open()
        await it.reading(40)
        it.may_read = False
        for recheck in tuple(it.rechecks):
            recheck()
        await settle()
        assert it.events[-1][0] == "end"
        assert it.is_over
        assert it.task is not None
        assert it.task.done()
        assert it.rechecks == set()


async def test_a_deaf_reader_without_a_right_gets_nothing_more() -> None:
    """What is not sent yet is dropped."""
    async with reader() as it:
        await it.open()
        await it.reading(40)
        it.deafen()
        await it.reading(41)
        it.may_read = False
        for recheck in tuple(it.rechecks):
            recheck()
        await it.reading(42)
        it.hear()
        await settle()
        assert it.values == [40]
        assert it.events[-1][0] == "end"


async def test_a_reader_that_reads_nothing_is_disconnected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(event_stream, "STALL_S", 0.02)
    async with reader() as it:
        await it.open()
        it.deafen()
        await it.reading(41)
        await asyncio.sleep(0.1)
        assert it.aborted == 1
        assert it.task is not None
        assert it.task.done()


async def test_a_stream_ends_with_the_session_of_the_robot() -> None:
    async with reader() as it:
        await it.open()
        it.service.replace(it.service.robot)
        await it.clock.advance(1.0)
        assert it.events[-1] == ("end", {"reason": "the session of the robot has ended"})
        assert it.is_over


async def test_a_look_at_the_headers_ends_at_once() -> None:
    """A response to HEAD has no body, so nothing would ever end it."""
    async with reader() as it:
        await it.open(method="HEAD")
        assert it.task is not None
        assert it.task.done()
        assert (it.is_over, it.chunks) == (True, [b""])


async def test_a_reader_that_leaves_frees_the_robot() -> None:
    async with reader() as it:
        await it.open()
        assert it.robot.is_open
        await it.leave()
        await it.clock.advance(3.0)
        assert not it.robot.is_open
