"""A slow and a cut network between two sites: the speed, STOP, its reset and the controls."""

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.fleet.page_line import PageLine
from tests.e2e.fleet.partition import Partition
from tests.e2e.fleet.two_sites import FAST, ROBOT, SLOW, WAIT_S, TwoSites, reaches
from tests.e2e.ports import free_pair
from urc.client.remote import RemoteRobot
from urc.problems import UrcError

pytestmark = pytest.mark.anyio

FAR = f"{ROBOT}@bern"
GESTURES = 5
"""Gestures that a pause on a busy machine may end."""
GESTURE_S = 5.0
"""Time for a gesture to move the robot."""
WANTED = 0.2
"""Speed that a page requests, in m/s."""
NOTICED_S = 2.5
"""Longest time until a STOP into a cut network is told as failed."""
GONE_S = 3.0
"""Time in which both sites notice a cut network."""


class CutSites(TwoSites):
    """Two sites with a network that can be cut."""

    def __init__(self, folder: Path) -> None:
        way = free_pair()
        super().__init__(folder, way)
        self.network = Partition({way: self.port, way + 1: self.port + 1})

    async def part(self) -> None:
        """Cut the network, and wait until zug knows it."""
        self.network.cut()

        await self._until_status(502)

    async def meet(self) -> None:
        """Heal the network, and wait until zug reaches the robot."""
        self.network.heal()

        await self._until_status(200)

    async def _until_status(self, wanted: int) -> None:
        async with asyncio.timeout(WAIT_S):
            while True:
                path = f"/api/v1/robots/{FAR}/controls"
                status, _ = await asyncio.to_thread(self.zug.ask, path)
                if status == wanted:
                    return
                await asyncio.sleep(0.1)


@pytest.fixture
async def sites(tmp_path: Path) -> AsyncIterator[CutSites]:
    """Run both servers, and wait until they see each other."""
    made = await asyncio.to_thread(CutSites, tmp_path)
    try:
        await made.network.open()
        await asyncio.to_thread(made.start)
        await made.meet()
        yield made
    finally:
        await asyncio.to_thread(made.kill)
        await made.network.close()


def at(sites: CutSites, place: str) -> PageLine:
    """Return a page's socket to the robot: beside it, or at the other site."""
    return PageLine(sites.bern, ROBOT) if place == "beside" else PageLine(sites.zug, FAR)


async def drives(page: PageLine, robot: RemoteRobot) -> asyncio.Task[None]:
    """Take the controls as a page does, and hold a stick until the robot moves.

    A pause on a busy machine ends a gesture; a new one then begins.
    """
    for _ in range(GESTURES):
        await page.say("release", command="drive")
        if page.is_mine:
            await page.drive("leave")
            await page.until(lambda _: not page.is_mine)
        await page.drive("take")
        await page.until(lambda _: page.is_mine)
        holding = asyncio.create_task(page.hold(WANTED))
        try:
            async with asyncio.timeout(GESTURE_S):
                await reaches(robot, least=FAST)
        except TimeoutError:
            holding.cancel()
        else:
            return holding
    raise AssertionError(f"{GESTURES} gestures moved nothing: {page.refusals[-3:]}")


async def stands(robot: RemoteRobot) -> None:
    """Check that the robot stands for a second."""
    await reaches(robot, most=SLOW)
    for _ in range(10):
        await asyncio.sleep(0.1)
        sample = robot.latest("speed")
        assert sample is not None
        assert abs(float(str(sample.value))) <= SLOW


async def test_a_network_that_is_too_slow_moves_nothing(sites: CutSites) -> None:
    """STOP still arrives."""
    sites.network.delay_s = 0.4
    async with sites.bern.open(ROBOT) as robot, at(sites, "far") as far:
        await robot.wait_for("speed", timeout=30)
        await far.drive("take")
        await far.until(lambda _: far.is_mine)
        holding = asyncio.create_task(far.hold(WANTED))
        await far.until_refused("Link too slow: your input arrived")
        await stands(robot)
        await far.say("stop")
        await far.until(lambda lease: bool(lease["latched"]))
        holding.cancel()


async def test_a_stop_from_afar_is_reset_beside_the_robot_during_a_partition(
    sites: CutSites,
) -> None:
    """The latch outlives the cut; whoever may drive at the robot's site resets it, for good."""
    async with (
        sites.bern.open(ROBOT) as robot,
        at(sites, "beside") as near,
        at(sites, "far") as far,
    ):
        await robot.wait_for("speed", timeout=30)
        await far.say("stop")
        await near.until(lambda lease: "(zug)" in lease["latched"])
        await sites.part()
        await near.drive("take")
        await near.until_refused("Stopped by")
        await near.drive("reset", stops=near.lease["stops"])
        await near.until(lambda lease: not lease["latched"])
        holding = await drives(near, robot)
        await sites.meet()
        async with at(sites, "far") as again:
            assert again.lease["latched"] == ""
            assert again.lease["holder"]["id"] == near.lease["you"]
            holding.cancel()
            await near.drive("leave")
            await stands(robot)


async def test_a_stop_in_a_partition_is_told_as_failed_and_does_not_come_later(
    sites: CutSites,
) -> None:
    """The page repeats it as long as it is open, so neither zug nor the network does.

    The first STOP goes into a network of which nobody knows yet that it is cut.
    """
    path = f"/api/v1/robots/{FAR}/stop"
    async with at(sites, "beside") as near:
        sites.network.cut()
        for most_s in (NOTICED_S, 0.5):
            began = time.monotonic()
            status, said = await asyncio.to_thread(sites.zug.ask, path, {})
            late_s = time.monotonic() - began
            assert status == 502, said
            assert late_s < most_s
        await sites.meet()
        await asyncio.sleep(1)
        assert near.lease["latched"] == ""


@pytest.mark.parametrize("way", ["cut", "frozen"])
async def test_a_reset_that_was_on_its_way_has_no_effect(sites: CutSites, way: str) -> None:
    """A person at the robot may rely on the latch: no old message takes it back."""
    assert sites.zug.process is not None
    async with at(sites, "beside") as near, at(sites, "far") as far:
        await near.say("stop")
        await far.until(lambda lease: bool(lease["latched"]))
        if way == "cut":
            sites.network.cut()
        else:
            os.kill(sites.zug.process.pid, signal.SIGSTOP)
        await far.drive("reset", stops=far.lease["stops"])
        await asyncio.sleep(GONE_S)
        if way == "cut":
            await sites.meet()
        else:
            os.kill(sites.zug.process.pid, signal.SIGCONT)
        await far.until(lambda _: far.is_over)
        await asyncio.sleep(1)
        assert near.lease["latched"]
        async with at(sites, "far") as again:  # a page that knows the state may reset
            await again.drive("reset", stops=again.lease["stops"])
            await near.until(lambda lease: not lease["latched"])


async def test_a_reset_from_afar_undoes_no_stop_that_it_does_not_name(sites: CutSites) -> None:
    """Neither an older number nor none resets it."""
    async with at(sites, "beside") as near, at(sites, "far") as far:
        await near.say("stop")
        await far.until(lambda lease: bool(lease["latched"]))
        await far.drive("reset", stops=far.lease["stops"] - 1)
        await far.until_refused("STOP was pressed again")
        await far.drive("reset")
        await far.until_refused("must contain the number of STOPs")
        asked = {"verb": "reset"}
        path = f"/api/v1/robots/{FAR}/lease"
        status, said = await asyncio.to_thread(sites.zug.ask, path, asked)
        assert (status, "number of STOPs" in said["message"]) == (409, True), said
        assert near.lease["latched"]


@pytest.mark.parametrize(("first", "second"), [("beside", "far"), ("far", "beside")])
async def test_the_controls_are_handed_over_between_sites(
    sites: CutSites, first: str, second: str
) -> None:
    """By an answer and by silence; the robot stops in between, and old ticks move nothing."""
    async with sites.bern.open(ROBOT) as robot, at(sites, first) as one, at(sites, second) as other:
        await robot.wait_for("speed", timeout=30)
        holding = await drives(one, robot)
        await other.drive("take")
        await other.until_refused("has the controls")
        await other.drive("ask", for_s=30)
        await one.until(lambda lease: lease["asker"] is not None)
        await one.drive("yes")
        await other.until(lambda _: other.is_mine)
        await stands(robot)  # the first page still sends ticks
        epoch = other.lease["epoch"]
        holding.cancel()
        await one.say("release", command="drive")
        holding = await drives(other, robot)
        await one.drive("ask", for_s=3)
        await one.until(lambda _: one.is_mine)  # without an answer
        await stands(robot)
        holding.cancel()
        assert one.lease["epoch"] > epoch


async def test_the_controls_of_a_page_that_is_cut_off_are_free(sites: CutSites) -> None:
    """The robot stops by its lease, and a page beside it takes the controls without asking."""
    async with (
        sites.bern.open(ROBOT) as robot,
        at(sites, "beside") as near,
        at(sites, "far") as far,
    ):
        await robot.wait_for("speed", timeout=30)
        holding = await drives(far, robot)
        sites.network.cut()
        await reaches(robot, most=SLOW)
        await near.until(lambda lease: lease["holder"] is None)
        beside = await drives(near, robot)
        await near.until(lambda lease: lease["asker"] is None)
        await sites.meet()
        await far.until(lambda _: far.is_over)
        beside.cancel()
        await near.drive("leave")
        await stands(robot)
        async with at(sites, "far") as again:
            assert again.lease["holder"] is None
        holding.cancel()
        with suppress(asyncio.CancelledError, UrcError):
            await holding


async def test_a_request_for_the_controls_ends_with_the_network(sites: CutSites) -> None:
    """The page that drives beside the robot is not stopped for a page that is cut off."""
    async with (
        sites.bern.open(ROBOT) as robot,
        at(sites, "beside") as near,
        at(sites, "far") as far,
    ):
        await robot.wait_for("speed", timeout=30)
        holding = await drives(near, robot)
        await far.drive("ask", for_s=60)
        await near.until(lambda lease: lease["asker"] is not None)
        sites.network.cut()
        await near.until(lambda lease: lease["asker"] is None)
        assert near.is_mine
        holding.cancel()
