"""Two servers in processes of their own, with nothing in common but the network: Zenoh over TLS."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.e2e.dashboards import until
from tests.e2e.fleet.two_sites import FAST, ROBOT, SLOW, WAIT_S, TwoSites, reaches
from tests.e2e.processes import UrcProcess
from urc.client.remote import RemoteRobot
from urc.problems import UrcError

pytestmark = pytest.mark.anyio


@pytest.fixture
async def sites(tmp_path: Path) -> AsyncIterator[TwoSites]:
    """Run both servers."""
    made = await asyncio.to_thread(TwoSites, tmp_path)
    try:
        await asyncio.to_thread(made.start)
        yield made
    finally:
        await asyncio.to_thread(made.kill)


async def hold(robot: RemoteRobot, seconds: float) -> None:
    """Hold the robot's stick, as soon as the robot sends its speed."""
    await robot.wait_for("speed", timeout=WAIT_S)
    async with robot.drive("drive") as stick:
        await stick.hold(seconds, speed=0.2)


async def test_a_robot_is_driven_from_another_site(sites: TwoSites) -> None:
    """It moves while the stick is held, stands after the release, and STOP latches."""
    robot = await sites.far()
    try:
        driving = asyncio.create_task(hold(robot, 2.0))
        await reaches(robot, least=FAST)
        await driving
        await reaches(robot, most=SLOW)
        assert await robot.stop()
        async with sites.bern.open(ROBOT) as beside:
            await until(lambda: "(zug)" in beside.latched_by)
    finally:
        await sites.leave()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
async def test_a_lost_screen_stops_the_robot(sites: TwoSites, number: signal.Signals) -> None:
    """A killed and a frozen server end the motion by the lease of the robot's own site."""
    robot = await sites.far()
    async with sites.bern.open(ROBOT) as beside:
        driving = asyncio.create_task(hold(robot, 30.0))
        await reaches(beside, least=FAST)
        assert sites.zug.process is not None
        signal_process(sites.zug.process, number)
        await reaches(beside, most=SLOW)
        if number == signal.SIGSTOP:
            signal_process(sites.zug.process, signal.SIGCONT)
            await asyncio.sleep(2.0)
            sample = beside.latest("speed")
            assert sample is not None
            assert abs(float(str(sample.value))) <= SLOW
        driving.cancel()
        with pytest.raises((UrcError, asyncio.CancelledError)):
            await driving


async def test_a_revoked_site_is_refused_at_once(sites: TwoSites) -> None:
    """Its connections end, and it learns the reason in one line."""
    robot = await sites.far()
    async with sites.bern.open(ROBOT) as beside:
        driving = asyncio.create_task(hold(robot, 30.0))
        await reaches(beside, least=FAST)
        await asyncio.to_thread(sites.bern.command, "fleet", "revoke", "zug")
        with pytest.raises(UrcError):
            await driving
        await reaches(beside, most=SLOW)
    status, said = await asyncio.to_thread(sites.zug.ask, f"/api/v1/robots/{ROBOT}@bern")
    assert (status, said.get("message", said)) == (
        502,
        "the site bern refuses the connection: the certificate of site zug is revoked",
    )


def signal_process(process: UrcProcess, number: signal.Signals) -> None:
    """Send a signal to a server."""
    os.kill(process.pid, number)
