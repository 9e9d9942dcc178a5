"""A robot that moves in steps and stops by itself: nothing stops it, and all else holds."""

import pytest

from tests.unit.guard.lines import CountedWire, Rig, ScatteredWire
from urc.motion.hold_to_run import HoldTerms
from urc.testing.clock import settle

pytestmark = pytest.mark.anyio

STEPS = HoldTerms(b"", period_s=0.1, is_lossy=True)


async def driven(rigs: list[Rig], line: CountedWire | None = None) -> Rig:
    """Return a rig that has made one step, and is held."""
    rig = Rig(line or CountedWire())
    rigs.append(rig)
    await rig.transport.open(1.0)
    rig.guard.arm("drive", STEPS)
    rig.tick(b"step 1")
    await settle()
    return rig


async def test_a_step_never_comes_before_the_one_before_it_is_done(rigs: list[Rig]) -> None:
    """Else it would wait in the robot, and move it when it was let go."""
    rig = await driven(rigs)
    for number in range(2, 8):
        await rig.clock.advance(0.03)
        rig.tick(b"step %d" % number)
        await settle()
    assert rig.robot.written == [b"step 1", b"step 4"]


async def test_letting_go_writes_nothing_and_is_told(rigs: list[Rig]) -> None:
    """The next gesture goes on at once."""
    rig = await driven(rigs)
    rig.guard.release("drive")
    await rig.clock.advance(1.0)
    assert rig.robot.written == [b"step 1"]
    assert await rig.stops() == [("drive", "released")]
    rig.tick(b"step 2")
    await settle()
    assert rig.robot.written == [b"step 1", b"step 2"]


async def test_a_hand_that_is_gone_makes_no_further_step(rigs: list[Rig]) -> None:
    """The lease ends the motion, and ticks that go on coming move nothing."""
    rig = await driven(rigs)
    await rig.clock.advance(0.3)
    assert await rig.stops() == [("drive", "expired")]
    rig.tick(b"step 2")
    await rig.clock.advance(1.0)
    assert rig.robot.written == [b"step 1"]


async def test_stop_makes_no_further_step(rigs: list[Rig]) -> None:
    """It is told once, and the line was not used."""
    rig = await driven(rigs)
    rig.guard.stop({"drive": b""})
    rig.tick(b"step 2")
    await rig.clock.advance(1.0)
    assert await rig.stops() == [("drive", "stopped")]
    assert rig.robot.written == [b"step 1"]


async def test_after_a_cut_nothing_goes_on_by_itself(rigs: list[Rig]) -> None:
    """The step that was sent ends by itself; the gesture is over."""
    rig = await driven(rigs)
    rig.robot.cut()
    await rig.clock.advance(0.1)
    rig.tick(b"step 2")
    await rig.clock.advance(2.0)
    assert await rig.stops() == [("drive", "revoked")]
    rig.tick(b"step 3")
    await rig.clock.advance(1.0)
    assert rig.robot.written == [b"step 1"]


async def test_a_step_that_has_not_left_is_given_up_with_the_hand(rigs: list[Rig]) -> None:
    """Where each request has a connection of its own, it would come seconds later."""
    line = ScatteredWire()
    rig = await driven(rigs, line)
    line.is_stuck = True
    await rig.clock.advance(0.1)
    rig.tick(b"step 2")
    await settle()
    rig.guard.release("drive")
    await settle()
    assert (line.forgotten_bytes, line.stuck_bytes) == (len(b"step 2"), 0)
    assert await rig.stops() == [("drive", "released")]
