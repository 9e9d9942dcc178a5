"""The stick of a program: when its sampler ticks, and when it must not."""

import asyncio
import time
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.client.stick import (
    HELD_UP_S,
    TICK_S,
    MotionEnded,
    Stick,
    checked_validity,
    sample_stick,
)
from urc.model.values import Reading
from urc.problems import UrcError

pytestmark = pytest.mark.anyio


class Line:
    """What leaves for the robot, with its times on the clock of the test."""

    def __init__(self, now: "Clock") -> None:
        self.now = now
        self.ticks: list[tuple[float, Mapping[str, Reading]]] = []
        self.releases: list[float] = []
        self.refusal = ""

    def tick(self, command: str, arguments: Mapping[str, Reading]) -> str:
        assert command == "drive"
        if not self.refusal:
            self.ticks.append((self.now(), arguments))
        return self.refusal

    def release(self, command: str) -> None:
        assert command == "drive"
        self.releases.append(self.now())


class Clock:
    """The clock of this process, and pauses of it that no sleep has taken."""

    def __init__(self) -> None:
        self.ahead_s = 0.0

    def __call__(self) -> float:
        return time.monotonic() + self.ahead_s


@pytest.fixture
async def stick() -> Stick:
    """Return a stick that is valid for 200 ms."""
    return Stick("drive", 0.2)


async def test_no_input_is_no_motion(stick: Stick) -> None:
    """Not even a release: nothing was held."""
    line = Line(Clock())
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    await asyncio.sleep(0.12)
    task.cancel()
    assert (line.ticks, line.releases) == ([], [])


async def test_input_is_repeated_until_it_is_too_old(stick: Stick) -> None:
    """Then a release follows at once, and the stick says why."""
    line = Line(Clock())
    began_s = line.now()
    stick(speed=0.5)
    await sample_stick(stick, line, line.now)
    assert line.ticks[0][0] - began_s < TICK_S
    assert all(at - began_s < stick.valid_s for at, _ in line.ticks)
    assert {dict(arguments)["speed"] for _, arguments in line.ticks} == {0.5}
    assert len(line.releases) == 1
    assert stick.ended.startswith("the stick was not called for 200 ms")
    with pytest.raises(MotionEnded, match="the stick was not called"):
        stick(speed=0.5)
    with pytest.raises(MotionEnded):
        stick.release()


async def test_a_change_leaves_before_the_next_repetition(stick: Stick) -> None:
    """But not more often than every 10 ms."""
    line = Line(Clock())
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    for number in range(40):
        stick(speed=number)
        await asyncio.sleep(0.001)
    await asyncio.sleep(0.03)
    task.cancel()
    gaps = [
        later - sooner for (sooner, _), (later, _) in zip(line.ticks, line.ticks[1:], strict=False)
    ]
    assert min(gaps) >= 0.009
    assert line.ticks[-1][1] == {"speed": 39}, "the newest input always leaves"


async def test_a_pause_of_the_process_ends_the_motion(stick: Stick) -> None:
    """Nothing of the old input may leave after it."""
    stick.valid_s = 1.0
    line = Line(clock := Clock())
    stick(speed=0.5)
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    await asyncio.sleep(0.1)
    count = len(line.ticks)
    clock.ahead_s = HELD_UP_S + 0.1
    await task
    assert stick.ended.startswith("this program was blocked for")
    assert len(line.ticks) == count
    assert len(line.releases) == 1


async def test_guards_report_of_a_pause_names_the_pause(stick: Stick) -> None:
    """After a pause, the report that the lease has expired may be read before the next sample."""
    stick.valid_s = 1.0
    line = Line(clock := Clock())
    stick(speed=0.5)
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    await asyncio.sleep(0.02)
    stick.expire("the input arrived too late", clock() + HELD_UP_S + 0.1)
    await task
    assert stick.ended.startswith("this program was blocked for 3")


async def test_lease_that_expires_without_a_pause_is_the_reason(stick: Stick) -> None:
    """The network was slow; so it was not this program."""
    stick.expire("the input arrived too late", 1e9)
    assert stick.ended == "the input arrived too late", "no input was sampled before"
    other = Stick("drive", 1.0)
    line = Line(clock := Clock())
    other(speed=0.5)
    task = asyncio.create_task(sample_stick(other, line, line.now))
    await asyncio.sleep(0.02)
    other.expire("the input arrived too late", clock())
    await task
    assert other.ended == "the input arrived too late"


async def test_a_pause_before_the_first_input_ends_nothing(stick: Stick) -> None:
    """A program may wait in its block for as long as it likes."""
    line = Line(clock := Clock())
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    await asyncio.sleep(0.02)
    clock.ahead_s = 10
    await asyncio.sleep(0.1)
    assert stick.ended == ""
    task.cancel()


async def test_a_refusal_ends_the_motion(stick: Stick) -> None:
    """With its words; the first reason stays."""
    line = Line(Clock())
    line.refusal = "screen 2 has the controls"
    stick(speed=0.5)
    await sample_stick(stick, line, line.now)
    stick.end("another reason")
    assert stick.ended == "screen 2 has the controls"
    assert len(line.releases) == 1


async def test_a_release_of_its_own_ends_nothing(stick: Stick) -> None:
    """The next input moves the robot again."""
    line = Line(Clock())
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    stick(speed=0.5)
    await asyncio.sleep(0.03)
    stick.release()
    await asyncio.sleep(0.3)
    assert len(line.releases) == 1
    count = len(line.ticks)
    stick(speed=0.25)
    await asyncio.sleep(0.03)
    task.cancel()
    assert [arguments for _, arguments in line.ticks[count:]] == [{"speed": 0.25}]


async def test_a_hold_ends_with_the_motion(stick: Stick) -> None:
    """It never waits for a robot that does not move."""
    line = Line(Clock())
    task = asyncio.create_task(sample_stick(stick, line, line.now))
    holding = asyncio.create_task(stick.hold(30, speed=1))
    await asyncio.sleep(0.1)
    stick.end("STOP was pressed")
    with pytest.raises(MotionEnded, match="STOP was pressed"):
        await holding
    await task
    assert len(line.releases) == 1


async def test_arguments_are_copied(stick: Stick) -> None:
    """A program that goes on with its dictionary changes nothing that waits."""
    given = {"speed": 0.5}
    stick.put(given)
    given["speed"] = 99
    found = stick.sample()
    assert found is not None
    assert found[0] == {"speed": 0.5}


@given(st.floats(allow_nan=True))
def test_validity_is_a_twentieth_of_a_second_to_a_second(valid_s: float) -> None:
    """Everything else is refused, also what is no number."""
    if 0.05 <= valid_s <= 1.0:
        assert checked_validity(valid_s) == valid_s
    else:
        with pytest.raises(UrcError, match="valid_s: expected"):
            checked_validity(valid_s)
