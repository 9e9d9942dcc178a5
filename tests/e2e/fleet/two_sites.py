"""Two servers in processes of their own, for tests: a site with robots, a site with a screen."""

import asyncio
import os
import signal
import time
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import urllib3

import urc.client
from tests.e2e.command_line import run
from tests.e2e.keys import with_key
from tests.e2e.ports import free_pair, free_port
from tests.e2e.processes import UrcProcess
from urc.client.remote import RemoteRobot
from urc.problems import UrcError

__all__ = ["FAST", "ROBOT", "SLOW", "WAIT_S", "Site", "TwoSites", "reaches"]

ROBOT = "turtlebot4"
WAIT_S = 40.0
FAST, SLOW = 0.05, 0.02
"""Speeds in m/s: the robot drives; the robot stands."""


class Site:
    """A site: its data folder, and its server."""

    def __init__(self, data: Path, *robots: str) -> None:
        self.data = data
        self.robots = robots
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
        words = ("serve", *self.robots, "--simulate", "--fleet", "--port", str(self.port))
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

    def ask(self, path: str, body: object = None) -> tuple[int, dict[str, Any]]:
        """Return the status and the decoded body of a response; POST with a body, else GET."""
        headers = {"authorization": f"Bearer {self.key}"}
        method = "GET" if body is None else "POST"
        found = urllib3.request(
            method, f"http://127.0.0.1:{self.port}{path}", headers=headers, json=body
        )
        return found.status, found.json()

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the server."""
        assert self.process is not None
        os.kill(self.process.pid, number)


class TwoSites:
    """The site bern with the authority, and the site zug, which connects to it."""

    def __init__(
        self,
        folder: Path,
        way: int | None = None,
        *,
        bern: Sequence[str] = (ROBOT,),
        zug: Sequence[str] = ("puppet",),
    ) -> None:
        """Make both sites.

        Args:
            folder: an empty folder for their data.
            way: first port of a relay, by which zug reaches bern; None for the direct way.
            bern: robots of bern.
            zug: robots of zug.
        """
        self.bern = Site(folder / "bern", *bern)
        self.zug = Site(folder / "zug", *zug)
        self.port = free_pair()
        listen, address = f"127.0.0.1:{self.port}", f"127.0.0.1:{way or self.port}"
        self.bern.command("fleet", "init", "lab", "--site", "bern", "--listen", listen)
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

    async def far(self, robot: str = ROBOT) -> RemoteRobot:
        """Return a robot of bern as seen from zug, as soon as zug can reach it."""
        end_s = time.monotonic() + WAIT_S
        while True:
            opening = self.zug.open(f"{robot}@bern")
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


async def reaches(robot: RemoteRobot, *, least: float = -9.0, most: float = 9.0) -> float:
    """Return the time at which the robot's speed is within limits."""
    async with asyncio.timeout(WAIT_S):
        async for sample in robot.watch("speed"):
            if isinstance(sample.value, (int, float)) and least <= abs(sample.value) <= most:
                break
    return time.monotonic()
