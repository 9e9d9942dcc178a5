"""Two servers in processes of their own, with nothing in common but the network: Zenoh over TLS."""

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import pytest
import urllib3

import urc.client
from tests.e2e.command_line import run
from tests.e2e.dashboards import until
from tests.e2e.keys import with_key
from tests.e2e.ports import free_pair, free_port
from tests.e2e.processes import UrcProcess
from urc.client.remote import RemoteRobot
from urc.problems import UrcError

pytestmark = pytest.mark.anyio

ROBOT = "turtlebot4"
WAIT_S = 40.0
FAST, SLOW = 0.05, 0.02
"""Speeds in m/s: the robot drives; the robot stands."""


class Site:
    """A site: its data folder, and its server."""

    def __init__(self, data: Path, robot: str) -> None:
        self.data = data
        self.robot = robot
        self.port = free_port()
        self.process: UrcProcess | None = None
        self.key = ""

    def command(self, *words: str) -> str:
        """Return the output of a command with this site's data folder."""
        done = run(*words, "--data-dir", str(self.data))
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def start(self) -> None:
        """Start the server, and wait for its address."""
        words = ("serve", self.robot, "--simulate", "--fleet", "--port", str(self.port))
        self.process = UrcProcess((*words, "--data-dir", str(self.data)), {})
        address = self.process.wait_for(r"dashboard (http\S+)")[1]
        self.key = with_key(address).partition("key=")[2]

    def kill(self) -> None:
        """Kill the server, as a lost computer would end."""
        assert self.process is not None
        self.process.kill()

    def open(self, robot: str) -> AbstractAsyncContextManager[RemoteRobot]:
        """Return a program's connection to a robot, through this server."""
        return urc.client.open(
            f"http://127.0.0.1:{self.port}", robot, token=self.key, timeout=WAIT_S
        )

    def ask(self, path: str) -> tuple[int, dict[str, str]]:
        """Return the status and the decoded body of a response."""
        headers = {"authorization": f"Bearer {self.key}"}
        found = urllib3.request("GET", f"http://127.0.0.1:{self.port}{path}", headers=headers)
        return found.status, found.json()


class TwoSites:
    """The site bern with the authority and a TurtleBot, and the site zug with a screen."""

    def __init__(self, folder: Path) -> None:
        self.bern = Site(folder / "bern", ROBOT)
        self.zug = Site(folder / "zug", "puppet")
        address = f"127.0.0.1:{free_pair()}"
        self.bern.command("fleet", "init", "lab", "--site", "bern", "--listen", address)
        self.zug.data.mkdir(parents=True)
        code = self.bern.command("fleet", "invite", "zug", "--address", address)
        self.zug.command("fleet", "join", code)

    def start(self) -> None:
        """Start both servers."""
        self.bern.start()
        self.zug.start()

    def kill(self) -> None:
        """End both servers."""
        for site in (self.bern, self.zug):
            if site.process is not None:
                site.kill()

    async def far(self) -> RemoteRobot:
        """Return the robot as seen from zug, as soon as zug can reach it."""
        end_s = time.monotonic() + WAIT_S
        while True:
            opening = self.zug.open(f"{ROBOT}@bern")
            try:
                robot = await opening.__aenter__()
            except UrcError:
                assert time.monotonic() < end_s
                await asyncio.sleep(0.2)
            else:
                self._opened = opening
                return robot

    async def leave(self) -> None:
        """Close the robot of `far`."""
        await self._opened.__aexit__(None, None, None)


@pytest.fixture
async def sites(tmp_path: Path) -> AsyncIterator[TwoSites]:
    """Run both servers."""
    made = await asyncio.to_thread(TwoSites, tmp_path)
    try:
        await asyncio.to_thread(made.start)
        yield made
    finally:
        await asyncio.to_thread(made.kill)


async def reaches(robot: RemoteRobot, *, least: float = -9.0, most: float = 9.0) -> float:
    """Return the time at which the robot's speed is within limits."""
    async with asyncio.timeout(WAIT_S):
        async for sample in robot.watch("speed"):
            if isinstance(sample.value, (int, float)) and least <= abs(sample.value) <= most:
                break
    return time.monotonic()


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
