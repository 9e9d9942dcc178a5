"""Connecting in a hurry: over a long way, and to a robot that cannot be reached for a while."""

import asyncio
import socket
from collections.abc import Collection, Iterator

import pytest

from urc.testing.clock import settle
from urc.transports import connect_race
from urc.transports.connect_race import HURRY, ConnectRace, connected

pytestmark = pytest.mark.anyio

EVERY_S = 0.03
LONG_S = 0.16
"""What it takes there and back, far more than the time to the next try."""
ADDRESS = ("192.0.2.1", 7)


class Line(socket.socket):
    """A socket by its name alone: nothing of the system's is behind it."""

    def __init__(self, begun_s: float) -> None:
        self.begun_s = begun_s
        self.is_closed = False

    def close(self) -> None:
        self.is_closed = True


class Way:
    """A way to a robot, on which time passes only while somebody waits."""

    def __init__(self) -> None:
        self.now = 0.0
        self.trip_s = LONG_S
        self.heals_s = 0.0
        """What is begun before that is lost."""
        self.refuses_until_s = 0.0
        """What arrives before that is refused."""
        self.begun: list[float] = []
        self.lines: list[Line] = []
        self.ends: dict[asyncio.Task[object] | None, tuple[float, asyncio.Event]] = {}

    async def once(self, family: int, address: object) -> Line:
        """Connect once."""
        begun_s, over = self.now, asyncio.Event()
        self.begun.append(begun_s)
        at_s = begun_s + self.trip_s if begun_s >= self.heals_s else float("inf")
        task = asyncio.current_task()
        self.ends[task] = (at_s, over)
        try:
            await over.wait()
        finally:
            del self.ends[task]
        if at_s < self.refuses_until_s:
            raise ConnectionRefusedError("nobody listens")
        self.lines.append(Line(begun_s))
        return self.lines[-1]

    async def wait(
        self, tries: Collection["asyncio.Task[object]"], *, timeout: float, return_when: str
    ) -> tuple[set["asyncio.Task[object]"], set["asyncio.Task[object]"]]:
        """Wait as asyncio does, on this way's own time."""
        assert return_when == asyncio.FIRST_COMPLETED
        await settle()
        end_s = self.now + timeout
        self.now = min([end_s, *(at_s for at_s, _ in self.ends.values())])
        for at_s, over in list(self.ends.values()):
            if at_s <= self.now:
                over.set()
        await settle()
        done = {one for one in tries if one.done()}
        return done, set(tries) - done


@pytest.fixture
def way(monkeypatch: pytest.MonkeyPatch) -> Iterator[Way]:
    """Connect by a way of the test."""
    made = Way()
    monkeypatch.setattr(connect_race, "_once", made.once)
    monkeypatch.setattr("urc.transports.connect_race.asyncio.wait", made.wait)
    token = HURRY.set(ConnectRace(EVERY_S))
    yield made
    HURRY.reset(token)


async def test_a_way_that_is_longer_than_the_time_to_the_next_try_is_gone_to_its_end(
    way: Way,
) -> None:
    """The first try is through after its own time; nobody has given it up for a newer one."""
    line = await connected(socket.AF_INET, ADDRESS)
    assert way.now == pytest.approx(LONG_S)
    assert isinstance(line, Line)
    assert line.begun_s == 0
    assert way.begun == pytest.approx([place * EVERY_S for place in range(6)])
    assert not line.is_closed


async def test_a_robot_that_comes_back_is_reached_by_the_next_try(way: Way) -> None:
    """Not when the system would repeat the first one, a second later and then two."""
    way.heals_s = 1.0
    await connected(socket.AF_INET, ADDRESS)
    assert way.now <= 1.0 + EVERY_S + LONG_S


async def test_what_is_left_of_the_tries_is_taken_back(way: Way) -> None:
    """Of two that came through together one is used; no socket and no task stays."""
    way.trip_s = 2 * EVERY_S
    way.heals_s = 0.0
    first = await connected(socket.AF_INET, ADDRESS)
    assert [line for line in way.lines if not line.is_closed] == [first]
    await settle()
    assert way.ends == {}


async def test_two_that_arrive_at_once_leave_one_open(way: Way) -> None:
    """Whichever it is."""
    way.trip_s = EVERY_S
    begun = way.once

    async def both(family: int, address: object) -> Line:
        way.trip_s = max(EVERY_S, 2 * EVERY_S - way.now)  # the second is through with the first
        return await begun(family, address)

    connect_race._once = both  # the fixture puts it back
    way.trip_s = 2 * EVERY_S
    used = await connected(socket.AF_INET, ADDRESS)
    assert len(way.lines) == 2
    assert [line for line in way.lines if not line.is_closed] == [used]


async def test_a_robot_that_refuses_is_told_at_once(way: Way) -> None:
    """Whoever opens the line decides when the next attempt is; nothing stays behind."""
    way.refuses_until_s = 10.0
    with pytest.raises(ConnectionRefusedError, match="nobody listens"):
        await connected(socket.AF_INET, ADDRESS)
    assert way.now == pytest.approx(LONG_S)
    await settle()
    assert way.ends == {}


async def test_being_cancelled_leaves_nothing(way: Way) -> None:
    """The time of whoever opens the line is over."""
    way.heals_s = float("inf")
    opening = asyncio.create_task(connected(socket.AF_INET, ADDRESS))
    await settle()
    opening.cancel()
    await asyncio.gather(opening, return_exceptions=True)
    assert opening.cancelled()
    assert way.ends == {}


async def test_without_a_hurry_there_is_one_try(way: Way) -> None:
    """The system repeats it as it thinks fit."""
    HURRY.set(None)
    opening = asyncio.create_task(connected(socket.AF_INET, ADDRESS))
    await settle()
    assert way.begun == [0.0]
    opening.cancel()
    await asyncio.gather(opening, return_exceptions=True)
