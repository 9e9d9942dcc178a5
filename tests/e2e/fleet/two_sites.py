"""Two servers in processes of their own, for tests: a site with robots, a site with a screen."""

import asyncio
import json
import os
import re
import signal
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any

import urllib3

import urc.client
from tests.e2e.command_line import run
from tests.e2e.keys import with_key
from tests.e2e.ports import free_pair, free_port
from tests.e2e.processes import UrcProcess
from urc.client.remote import RemoteRobot
from urc.fleet.authority import FleetAuthority
from urc.fleet.files import AUTHORITY_FOLDER, FLEET_FOLDER
from urc.fleet.joining import join
from urc.fleet.membership import Membership
from urc.problems import UrcError

__all__ = ["FAST", "ROBOT", "SLOW", "WAIT_S", "Site", "TwoSites", "reaches", "until_said"]

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
        self.environment: dict[str, str] = {}
        """Further environment variables of the server and of all commands."""
        self.is_emulated = True
        """Whether the server emulates its robots."""

    def command(self, *words: str) -> str:
        """Return the output of a command with this site's data folder."""
        done = run(*words, "--data-dir", str(self.data), **self.environment)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def start(self) -> None:
        """Start the server, and wait for its address."""
        words = ["serve", *self.robots, "--fleet", "--port", str(self.port)]
        words += ["--data-dir", str(self.data), *(["--simulate"] if self.is_emulated else [])]
        self.process = UrcProcess(words, self.environment)
        address = self.process.wait_for(r"dashboard (http\S+)")[1]
        self.key = with_key(address).partition("key=")[2]

    def kill(self) -> None:
        """Kill the server, as a lost computer would end."""
        assert self.process is not None
        self.process.kill()

    def is_renewed(self) -> bool:
        """Return whether the site has replaced the certificate of its invitation."""
        return not json.loads(self.command("fleet", "status", "--format", "json"))["is_invitation"]

    def doctor(self) -> list[str]:
        """Return what `urc doctor` says about the fleet, without the rules and packages."""
        done = run("doctor", "--data-dir", str(self.data), **self.environment)
        assert done.returncode in (0, 1), done.stderr
        found = re.findall(r"^(ok|MISSING) +fleet {2,}(.*)$", done.stdout, re.MULTILINE)
        return [f"{mark} {text}" for mark, text in found]

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
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Make both sites.

        Args:
            folder: an empty folder for their data.
            way: first port of a relay, by which zug reaches bern; None for the direct way.
            bern: robots of bern.
            zug: robots of zug.
            environment: further environment variables of both sites.
        """
        self.bern = Site(folder / "bern", *bern)
        self.zug = Site(folder / "zug", *zug)
        for site in (self.bern, self.zug):
            site.environment = dict(environment)
        self.port = free_pair()
        self.address = f"127.0.0.1:{way or self.port}"
        """Address by which zug reaches bern."""
        listen = f"127.0.0.1:{self.port}"
        self.bern.command("fleet", "init", "lab", "--site", "bern", "--listen", listen)
        self.zug.data.mkdir(parents=True, exist_ok=True)
        code = self.bern.command("fleet", "invite", "zug", "--address", self.address)
        self.zug.command("fleet", "join", code)

    def member(self, folder: Path) -> Membership:
        """Return another site of the fleet, with the name of its folder and no server."""
        now = datetime.now(UTC)
        authority = FleetAuthority.load(self.bern.data / FLEET_FOLDER / AUTHORITY_FOLDER)
        invited = join(folder, authority.invite(folder.name, [self.address], now), now)
        chain = authority.renew(invited.renewal(), invited.certificate, now)
        return invited.renewed(chain, now)

    def start(self) -> None:
        """Start both servers."""
        self.bern.start()
        self.zug.start()

    def kill(self) -> None:
        """End both servers."""
        for site in (self.bern, self.zug):
            if site.process is not None:
                site.kill()

    def start_renewed(self) -> None:
        """Start both servers, and wait until zug has a certificate of its own."""
        self.start()
        end_s = time.monotonic() + WAIT_S
        while not self.zug.is_renewed():
            assert time.monotonic() < end_s
            time.sleep(0.1)

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


def until_said(site: Site, path: str, body: object, status: int) -> dict[str, Any]:
    """Repeat a request until its response has a status, and return the response."""
    end_s = time.monotonic() + WAIT_S
    while True:
        found, said = site.ask(path, body)
        if found == status:
            return said
        assert time.monotonic() < end_s, said
        time.sleep(0.1)
