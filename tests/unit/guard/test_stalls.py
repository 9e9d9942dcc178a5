"""A line that does not take what is written: what waits, what is reset, and what comes first."""

import asyncio

import pytest

from tests.unit.guard.lines import STOP, TERMS, CountedWire, Rig, ScatteredWire, SlowWire
from urc.guard import messages
from urc.model.payload import Envelope, Payload
from urc.motion.stall import AFRESH_S, SHORTEST_CUT_S, STALLED_S, STOP_WITHIN_S
from urc.testing.clock import settle
from urc.transports.base import PeerClosed

pytestmark = pytest.mark.anyio


@pytest.mark.parametrize("began_s", [0.0, 0.013, 0.049, 0.05])
async def test_cut_of_a_fifth_of_a_second_is_followed_by_the_stop_in_a_tenth(
    rig: Rig, began_s: float
) -> None:
    """However it falls between two ticks: the line is open afresh by then, with time left."""
    robot = rig.robot
    assert isinstance(robot, CountedWire)
    await rig.drive()
    await rig.clock.advance(0.05 - began_s)
    cut_s = rig.clock.now()
    robot.is_stuck = True
    await rig.clock.advance(began_s)
    while STOP not in robot.written:
        rig.tick(b"go %d" % len(robot.written))
        for _ in range(50):
            await rig.clock.advance(0.001)
            if STOP in robot.written:
                break
    assert rig.clock.now() - cut_s <= SHORTEST_CUT_S + STOP_WITHIN_S - AFRESH_S + 0.0011
    assert robot.aborts == 1


async def test_newest_waits_while_bytes_are_unsent(rig: Rig) -> None:
    """For a moment they may be: acknowledgements are put off. Then nothing more is written."""
    robot = rig.robot
    assert isinstance(robot, CountedWire)
    robot.is_stuck = True
    await rig.drive()
    for number in range(2, 6):
        await rig.clock.advance(0.04)
        rig.tick(b"go %d" % number)
    await rig.clock.advance(0.02)
    assert robot.written == [b"go 1", b"go 2", b"go 3", b"go 4"]
    robot.stuck_bytes = 0
    robot.is_stuck = False
    await rig.clock.advance(0.01)
    assert robot.written[-1] == b"go 5"


async def test_nothing_at_all_may_be_unsent_where_opening_is_dear(rigs: list[Rig]) -> None:
    robot = CountedWire()
    rig = Rig(robot, stalled_s=1.0, is_strict=True)
    rigs.append(rig)
    robot.is_stuck = True
    await rig.drive()
    await rig.clock.advance(0.04)
    rig.tick(b"go 2")
    assert robot.written == [b"go 1"]
    await rig.clock.advance(0.4)
    assert robot.written == [b"go 1", STOP], "the stop goes out with it"
    assert robot.aborts == 0


async def test_line_that_is_held_up_by_what_is_no_motion_is_reset_too(rigs: list[Rig]) -> None:
    """A ping fell into the cut, so motion waited: nothing of it was in doubt, and nothing moved."""
    robot = CountedWire()
    rig = Rig(robot, stalled_s=1.0, is_strict=True)
    rigs.append(rig)
    await rig.drive()
    await rig.clock.advance(0.04)
    robot.stuck_bytes = 6
    rig.tick(b"go 2")
    for number in range(3, 22):
        await rig.clock.advance(0.05)
        rig.tick(b"go %d" % number)
    assert (robot.written, robot.aborts) == ([b"go 1"], 0)
    await rig.clock.advance(0.05)
    rig.tick(b"go 22")
    await rig.clock.advance(0.05)
    assert (robot.written, robot.aborts, robot.opens) == ([b"go 1", STOP], 1, 2)
    assert await rig.stops() == [("drive", "revoked")]


async def test_stalled_line_is_reset_and_the_stop_is_first(rig: Rig) -> None:
    robot = rig.robot
    assert isinstance(robot, CountedWire)
    await rig.drive()
    robot.is_stuck = True
    for number in range(2, 9):
        await rig.clock.advance(0.05)
        rig.tick(b"go %d" % number)
    await rig.clock.advance(0.05)
    assert robot.aborts == 1
    assert robot.written.index(STOP) == len(robot.written) - 1
    assert robot.opens == 2
    with pytest.raises(PeerClosed, match="has accepted no data for 220 ms while moving"):
        await rig.transport.receive()
    assert await rig.stops() == [("drive", "revoked")]


async def test_line_that_only_waits_is_reset_too(rigs: list[Rig]) -> None:
    robot = SlowWire()
    rig = Rig(robot)
    rigs.append(rig)
    await rig.drive()
    assert robot.written == [b"go 1"]
    robot.flowing.clear()
    rig.tick(b"go 2")
    for _ in range(8):
        await rig.clock.advance(0.05)
        rig.tick(b"go 3")
    robot.flowing.set()
    await rig.clock.advance(0.1)
    assert robot.opens == 2
    assert robot.written == [b"go 1", STOP]


async def test_motion_by_a_connection_of_its_own_does_not_come_after_its_stop(
    rigs: list[Rig],
) -> None:
    """One at a time is on its way, and it is given up before the stop goes."""
    robot = ScatteredWire()
    rig = Rig(robot)
    rigs.append(rig)
    robot.is_stuck = True
    await rig.drive()
    await rig.clock.advance(0.05)
    rig.tick(b"go 2")
    await settle()
    assert robot.written == [b"go 1"]
    rig.guard.release("drive")
    await settle()
    assert (robot.written, robot.forgotten_bytes) == ([b"go 1", STOP], len(b"go 1"))
    assert robot.aborts == 0


async def test_line_is_not_younger_for_what_was_given_up(rigs: list[Rig]) -> None:
    """A stop that has no connection yet waits no longer than the motion before it would have."""
    robot = ScatteredWire()
    rig = Rig(robot)
    rigs.append(rig)
    robot.is_stuck = True
    await rig.drive()
    await rig.clock.advance(0.2)
    rig.guard.release("drive")
    await rig.clock.advance(0.04)
    assert (robot.aborts, robot.opens) == (1, 2)
    assert robot.written == [b"go 1", STOP, STOP]


async def test_a_stop_that_is_on_its_way_is_not_given_up_for_the_next_one(rigs: list[Rig]) -> None:
    """Two sticks that are let go of, one after the other; or STOP that is pressed twice."""
    robot = ScatteredWire()
    rig = Rig(robot)
    rigs.append(rig)
    lift = TERMS._replace(stop=b"down")
    await rig.drive()
    rig.guard.arm("lift", lift)
    rig.guard.tick("lift", b"up")
    await rig.clock.advance(0.01)
    robot.is_stuck = True
    rig.guard.release("drive")
    await rig.clock.advance(0.01)
    rig.guard.release("lift")
    await settle()
    assert robot.written == [b"go 1", b"up", STOP, b"down"]
    assert (robot.stuck_bytes, robot.forgotten_bytes) == (len(STOP) + len(b"down"), 0)
    robot.is_stuck, robot.stuck_bytes = False, 0
    await rig.clock.advance(0.05)
    robot.is_stuck = True
    rig.guard.tick("drive", b"go 2")
    rig.guard.release("drive")
    await settle()
    assert robot.forgotten_bytes == len(b"go 2"), "motion that came since is"


async def test_first_stop_of_all_gives_up_what_is_on_its_way(rigs: list[Rig]) -> None:
    """No motion need have gone before it: a command may move a robot too."""
    robot = ScatteredWire()
    rigs.append(rig := Rig(robot))
    await rig.transport.open(1.0)
    robot.is_stuck = True
    await rig.transport.send(b"go home")
    rig.guard.stop({"drive": STOP})
    await settle()
    assert (robot.written, robot.forgotten_bytes) == ([b"go home", STOP], len(b"go home"))


async def test_motion_that_has_arrived_by_its_own_connection_stalls_nothing(
    rigs: list[Rig],
) -> None:
    robot = ScatteredWire()
    rigs.append(rig := Rig(robot))
    await rig.drive(TERMS._replace(lease_s=1.0))
    await rig.clock.advance(0.9)
    assert (robot.written, robot.aborts, robot.opens) == ([b"go 1"], 0, 1)


class Unconnected(ScatteredWire):
    """One that finds no connection for what comes after the first."""

    def offer(self, data: bytes) -> bool:
        return not self.written and super().offer(data)

    async def send(self, data: Payload) -> None:
        if self.opens == 1:
            await asyncio.Event().wait()
        await super().send(data)


async def test_stop_without_a_connection_waits_no_longer_than_the_motion_it_gave_up(
    rigs: list[Rig],
) -> None:
    """Nothing of it is unsent yet, so only the motion's age tells."""
    robot = Unconnected()
    rigs.append(rig := Rig(robot))
    robot.is_stuck = True
    await rig.drive(TERMS._replace(lease_s=1.0))
    await rig.clock.advance(0.15)
    rig.guard.release("drive")
    await rig.clock.advance(STALLED_S - 0.15 + 0.01)
    assert (robot.forgotten_bytes, robot.aborts, robot.opens) == (len(b"go 1"), 1, 2)
    assert robot.written == [b"go 1", STOP]


async def test_bytes_are_as_old_as_their_write_however_late_one_looks(rig: Rig) -> None:
    robot = rig.robot
    assert isinstance(robot, CountedWire)
    robot.is_stuck = True
    await rig.drive(TERMS._replace(lease_s=1.0))
    await rig.clock.hold_up(0.03)
    robot.stuck_bytes -= 1
    await rig.clock.advance(STALLED_S - 0.03 - 0.01)
    assert robot.aborts == 0
    await rig.clock.advance(0.02)
    assert robot.aborts == 1


class Messages(SlowWire):
    """One of messages, which tells how many bytes are unsent."""

    unsent_bytes = 0

    def unsent(self) -> int:
        return self.unsent_bytes


async def test_message_of_unknown_length_makes_what_is_unsent_no_younger(
    rigs: list[Rig],
) -> None:
    """All but one of the first message's bytes have left; that one has waited since."""
    robot = Messages()
    rigs.append(rig := Rig(robot))
    await rig.drive(TERMS._replace(lease_s=1.0))
    go = Envelope("publish", {"topic": "/v"}, {"x": 1})
    rig.tick(go)
    robot.unsent_bytes = 10
    await rig.clock.advance(0.1)
    rig.tick(go)
    await rig.clock.advance(0.05)
    robot.unsent_bytes = 1
    await rig.clock.advance(STALLED_S - 0.15 - 0.01)
    assert robot.opens == 1
    await rig.clock.advance(0.02)
    assert robot.opens == 2


async def driven_into_a_black_hole(rig: Rig) -> CountedWire:
    """Drive, then let the line take bytes that never arrive."""
    robot = rig.robot
    assert isinstance(robot, CountedWire)
    await rig.drive()
    await rig.clock.advance(0.05)
    robot.is_stuck = True
    return robot


async def test_stop_that_a_reset_of_the_line_discards_is_due_again(rig: Rig) -> None:
    """It was reported as written: the engine must know, should this guard die or be ended."""
    robot = await driven_into_a_black_hole(rig)
    robot.refusal = "nothing listens"
    rig.guard.release("drive")
    await settle()
    assert await rig.stops() == [("drive", "released")]
    assert not rig.guard.owes_stop("drive")
    await rig.clock.advance(0.3)
    assert robot.aborts == 1
    assert await rig.stops() == [("drive", "lost")]
    assert rig.guard.owes_stop("drive")
    assert any(isinstance(one, messages.RecoverStop) for one in rig.guard.briefing())


async def test_stop_that_was_due_again_is_reported_when_it_is_written(rig: Rig) -> None:
    await driven_into_a_black_hole(rig)
    rig.guard.release("drive")
    await rig.clock.advance(0.5)
    assert await rig.stops() == [("drive", "released"), ("drive", "lost"), ("drive", "revoked")]
    assert not rig.guard.owes_stop("drive")
