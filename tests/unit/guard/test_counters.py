"""Frames of held motion that carry a counter, beside polls, commands and a keepalive that do too.

Numbers on the wire are gapless and rise in the order in which frames leave, and no stop is older
than anything that the robot has heard.
"""

import asyncio
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from tests.unit.guard.counted import NUMBERS, Robot, World, opened, parted
from urc.guard.sent_counters import SentCounters
from urc.model.exchange import MOST_STOPS
from urc.model.payload import Count, Numbered
from urc.motion.hold_to_run import STOP_EVERY_S, STOP_FOR_S

pytestmark = pytest.mark.anyio


def judge(robot: Robot) -> None:
    """Fail unless the numbers of each connection are gapless, and rise."""
    for texts in robot.heard:
        numbers, _ = parted(texts)
        assert numbers == [at % NUMBERS for at in range(len(numbers))], texts


async def hold(it: World, command: str, seconds: float) -> None:
    """Hold a control, and change its value with each sample."""
    for at in range(round(seconds / 0.05)):
        it.tick(command, at % 9 + 1)
        await it.clock.advance(0.05)


async def test_numbers_of_held_motion_are_gapless_beside_polls() -> None:
    async with opened(is_prompt=True) as it:
        it.take()
        it.delay(0.003)
        await hold(it, "drive", 2.0)
        it.controller.release("ann", "drive")
        await it.clock.advance(0.3)
        _, words = parted(it.robot.heard[0])
    judge(it.robot)
    assert words.count("DRIVE 0") == 1
    assert sum(word.startswith("DRIVE") for word in words) > 20
    assert words.count("VOLTS") > 30


async def test_ticks_that_are_replaced_before_they_leave_use_no_number_up() -> None:
    async with opened(is_prompt=True) as it:
        it.take()
        for value in range(1, 9):
            it.tick("drive", value)
        await it.clock.advance(0.2)
    judge(it.robot)


async def test_stop_of_a_frozen_server_is_newer_than_a_poll_that_has_left_since_it_was_armed() -> (
    None
):
    """The guard stops alone: nothing more comes from the server's side."""
    async with opened(is_prompt=True) as it:
        it.take()
        await hold(it, "drive", 0.5)
        it.delay(30.0)
        await it.clock.advance(0.4)
        numbers, words = parted(it.robot.heard[0])
        assert words[-1] == "DRIVE 0"
        assert numbers == list(range(len(numbers)))
        it.delay(0.0)


@pytest.mark.parametrize("is_prompt", [True, False])
async def test_each_repeat_of_a_stop_has_a_number_of_its_own(is_prompt: bool) -> None:
    async with opened(is_prompt=is_prompt, is_lossy=True) as it:
        it.take()
        await hold(it, "drive", 0.2)
        await hold(it, "turn", 0.2)
        it.delay(30.0)  # the server stands still, and both controls are to be stopped
        await it.clock.advance(1.2)
        _, words = parted(it.robot.heard[0])
        stops = words[words.index("DRIVE 0") :]
        assert stops.count("DRIVE 0") == stops.count("TURN 0") == MOST_STOPS
        it.delay(0.0)
    judge(it.robot)


def test_as_many_stops_are_made_as_are_sent() -> None:
    assert int(STOP_FOR_S / STOP_EVERY_S) + 1 == MOST_STOPS


async def test_first_stop_on_a_new_connection_has_its_first_number() -> None:
    """A connection begins with the first number, and so does the guard, which is alone then."""
    async with opened(is_prompt=True) as it:
        it.take()
        await hold(it, "drive", 0.5)
        it.delay(0.5)
        it.robot.cut()
        await it.clock.advance(0.1)
        assert it.robot.heard[1] == ["0 DRIVE 0"]
        it.delay(0.0)
        await it.clock.advance(3.0)
        assert len(it.robot.heard[1]) > 20, "the server goes on where the guard has begun"
    judge(it.robot)


async def test_requests_that_are_made_again_keep_their_order_and_find_their_answers() -> None:
    """Their numbers were used up on the way; the answers carry the numbers that left."""
    async with opened(is_prompt=True) as it:
        it.take()
        it.delay(0.02)
        for at in range(40):
            it.tick("drive", at % 9 + 1)
            it.ask("ping")
            it.ask("beep")
            await it.clock.advance(0.05)
        it.controller.release("ann", "drive")
        await it.clock.advance(1.0)
        assert it.failures == []
    judge(it.robot)
    _, words = parted(it.robot.heard[0])
    asked = [word for word in words if word in ("PING", "BEEP")]
    assert asked == ["PING", "BEEP"] * 40


STEP = st.one_of(
    st.tuples(st.just("hold"), st.sampled_from(("drive", "turn")), st.integers(1, 9)),
    st.tuples(st.just("tick"), st.sampled_from(("drive", "turn")), st.integers(1, 9)),
    st.tuples(st.just("wait"), st.sampled_from((0.0, 0.001, 0.02, 0.06, 0.3, 0.7))),
    st.tuples(st.just("pipe"), st.sampled_from((0.0, 0.001, 0.004, 0.03, 0.3))),
    st.tuples(st.just("release"), st.sampled_from(("drive", "turn"))),
    st.tuples(st.just("freeze"), st.booleans()),
    st.tuples(st.sampled_from(("take", "ping", "beep", "stop", "cut"))),
)
Step = tuple[str, ...]


async def do(it: World, step: Sequence[object]) -> None:
    """Do one step; time passes in some of them only."""
    match step:
        case ("hold", str(command), int(value)):
            for more in range(4):
                it.tick(command, (value + more) % 9 + 1)
                await it.clock.advance(0.05)
        case ("tick", str(command), int(value)):
            it.tick(command, value)
        case ("wait", float(seconds)):
            await it.clock.advance(seconds)
        case ("pipe", float(seconds)):
            it.delay(seconds)
        case ("release", str(command)):
            it.controller.release("ann", command)
        case ("freeze", bool(is_frozen)):
            it.robot.freeze(is_frozen)
        case ("take",):
            it.take()
        case ("stop",):
            it.controller.stop("ann")
        case ("cut",):
            it.robot.cut()
        case (str(command),):
            it.ask(command)


async def play(
    steps: Sequence[Sequence[object]], *, is_prompt: bool, is_lossy: bool, is_bytewise: bool
) -> None:
    async with opened(is_prompt=is_prompt, is_lossy=is_lossy, is_bytewise=is_bytewise) as it:
        it.take()
        for step in steps:
            await do(it, step)
        it.delay(0.0)
        it.robot.freeze(False)
        await it.clock.advance(2.0)
    judge(it.robot)
    moving: dict[str, str] = {}
    for word in parted(it.robot.heard[-1])[1]:
        command, _, value = word.partition(" ")
        if value and command in ("DRIVE", "TURN"):
            moving[command] = value
    assert all(value == "0" for value in moving.values()), moving


@settings(max_examples=examples(600), deadline=None)
@given(
    steps=st.lists(STEP, min_size=3, max_size=25),
    is_prompt=st.booleans(),
    is_lossy=st.booleans(),
    is_bytewise=st.booleans(),
)
def test_whatever_happens_numbers_are_gapless_and_the_stop_is_last(
    steps: list[Sequence[object]], is_prompt: bool, is_lossy: bool, is_bytewise: bool
) -> None:
    """Polls, ticks, leases, releases, commands, cuts and the end, whole and byte by byte."""
    asyncio.run(play(steps, is_prompt=is_prompt, is_lossy=is_lossy, is_bytewise=is_bytewise))


def test_counters_change_only_when_numbers_have_left() -> None:
    sent_counters = SentCounters()
    assert not sent_counters.is_changed
    sent_counters.left(Count({}, {"n": 7}))
    assert sent_counters.is_changed
    sent_counters.reset()
    assert not sent_counters.is_changed


def test_stop_with_a_wrong_number_is_better_than_none() -> None:
    """The last one is of the newest numbers."""
    sent_counters = SentCounters()
    stops = [Numbered(b"%d" % at, Count({"n": at - 1}, {"n": at})) for at in (5, 6, 7)]
    assert sent_counters.choose(stops).data == b"7"
    sent_counters.left(stops[0].takes)
    assert sent_counters.choose(stops).data == b"6"
