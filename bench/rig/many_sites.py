"""A fleet of many sites in network namespaces of their own, with delay and loss between them.

A site has a server and robots that send signals all the time. One site is the router. Dashboards
are sites with a robot that sends nothing. All packets between them pass through one relay.
"""

import json
import string
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from bench.processes import carried_bytes, cpu_s, own_mb
from bench.rig.deaths import robot_profile
from bench.rig.fleet import FleetSite, found_fleet
from bench.rig.programs import HERE, Program, Relay

__all__ = ["FleetSize", "ManySites", "Use"]

ROUTER = "10.77.0.1:7447"
DEVICE = "tun0"
START_S = 120.0
MENU_S = 1.0
STARTS = 3
"""Number of servers that start at the same time."""
DEAD_PORT = 9
"""Port of a robot that does not exist; its page is never opened."""

_PROFILE = """\
urc: 1
kind: robot
name: r{number}
title: Robot {number}
transports:
  wire:
    {{ type: tcp, host: 127.0.0.1, port: {port}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
signals: {signals}
messages: {{ all: {{ json: {fields} }} }}
"""


class FleetSize(NamedTuple):
    """The size of a fleet and the load of its robots."""

    sites: int
    """Number of sites with robots, besides the router and the dashboards."""
    robots: int
    """Number of robots at each site."""
    dashboards: int
    signals: int
    rate_hz: float
    """Frames of each robot in a second; each frame contains all signals."""
    delay_ms: float
    loss_percent: float


class Use(NamedTuple):
    """Use of resources by a server, over a span of time."""

    core: float
    """Processor time divided by the time that has passed."""
    mb: float
    """Memory at the end of the span, with a proportional share of shared memory."""
    sent: float
    """Bytes that its namespace has sent, per second."""
    received: float
    """Bytes that its namespace has received, per second."""


class ManySites:
    """The running fleet. It needs root."""

    def __init__(self, folder: Path, size: FleetSize) -> None:
        """Start everything; `folder` is empty."""
        self.size = size
        self._programs = ExitStack()
        try:
            self._start(folder)
        except BaseException:
            self._programs.close()
            raise

    def _start(self, folder: Path) -> None:
        size, enter = self.size, self._programs.enter_context
        sides = string.ascii_lowercase[: 1 + size.dashboards + size.sites]
        self.relay = enter(Relay(sides))
        idle = [robot_profile(0, "127.0.0.1", DEAD_PORT)]
        first = 1 + size.dashboards
        self.router = FleetSite("router", folder / "router", idle, inside=self._inside("a"))
        self.dashboards = [
            FleetSite(f"dashboard-{side}", folder / side, idle, inside=self._inside(side))
            for side in sides[1:first]
        ]
        self.generators: list[Program] = []
        self.sites = [self._site(folder / side, side) for side in sides[first:]]
        found_fleet(self.router, [*self.dashboards, *self.sites], ROUTER)
        everybody = (self.router, *self.dashboards, *self.sites)
        for one in everybody:
            self._programs.callback(one.close)
        with ThreadPoolExecutor(STARTS) as threads:
            list(threads.map(FleetSite.start, everybody))
        self.relay.do(f"delay {size.delay_ms}", f"loss {size.loss_percent}")
        self._await_all()

    def _inside(self, side: str) -> tuple[str, ...]:
        return self.relay.inside(side)

    def _site(self, folder: Path, side: str) -> FleetSite:
        size = self.size
        script = str(HERE.parent / "peers" / "fleet.py")
        command = [sys.executable, "-P", script, str(size.signals), str(size.rate_hz)]
        generator = self._programs.enter_context(Program(command, inside=self._inside(side)))
        self.generators.append(generator)
        port = int(generator.wait_for("ready", START_S)[1])
        documents = [_document(number, port, size.signals) for number in range(size.robots)]
        return FleetSite(
            f"site-{side}", folder, documents, "--monitor-alarms", inside=self._inside(side)
        )

    def _await_all(self) -> None:
        """Wait until each dashboard lists all robots of the sites, and none of them as lost."""
        size = self.size
        # The robots of the router and of other dashboards are never lost either: they are idle.
        wanted = f"list {size.sites * size.robots + 1 + size.dashboards} 0"
        for dashboard in self.dashboards:
            with self.menu(dashboard) as menu:
                menu.wait_until(lambda: wanted in menu.lines, START_S, wanted)

    def __enter__(self) -> Self:
        """Return self; all programs end when the `with` block ends."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End everything."""
        self._programs.close()

    def menu(self, dashboard: FleetSite) -> Program:
        """Open the menu of a dashboard; close the program to close it."""
        server = dashboard.server
        command = [sys.executable, "-PSE", str(HERE / "menu_process.py"), str(server.port)]
        key = ("env", f"URC_BENCH_KEY={server.key}")
        return Program([*command, str(MENU_S)], inside=(*dashboard.inside, *key))

    def pages(self, dashboard: FleetSite, site: FleetSite) -> Program:
        """Open a page for each robot of a site at a dashboard."""
        server = dashboard.server
        path = f"/ws?robot=r{{}}@{site.name}"
        command = [sys.executable, "-m", "bench.viewers", str(server.port), path]
        key = ("env", f"URC_BENCH_KEY={server.key}")
        program = Program([*command, str(self.size.robots)], inside=(*dashboard.inside, *key))
        program.wait_for("ready", START_S)
        return program

    def used(self, seconds: float) -> dict[str, Use]:
        """Return what each server uses in the next `seconds`, by its site's name."""
        servers = {one.name: one.server.pid for one in (self.router, *self.dashboards, *self.sites)}
        others = {"relay": self.relay.pid}
        others |= {f"robots {index}": one.pid for index, one in enumerate(self.generators)}
        processes = servers | others
        before, began_s = _counts(processes), time.monotonic()
        time.sleep(seconds)
        after, passed_s = _counts(processes), time.monotonic() - began_s
        return {
            name: Use(
                (after[name][0] - before[name][0]) / passed_s,
                own_mb(pid),
                (after[name][2] - before[name][2]) / passed_s,
                (after[name][1] - before[name][1]) / passed_s,
            )
            for name, pid in processes.items()
        }


def _counts(processes: dict[str, int]) -> dict[str, tuple[float, int, int]]:
    times = cpu_s(processes.values())
    return {
        name: (times.get(pid, 0.0), *carried_bytes(pid, DEVICE)) for name, pid in processes.items()
    }


def _document(number: int, port: int, signals: int) -> str:
    names: Sequence[str] = [f"s{each}" for each in range(signals)]
    kinds = {name: {"type": "number", "min": 0, "max": 100} for name in names}
    # An alarm that no value reaches keeps the robot connected without pages.
    kinds["s0"] = {**kinds["s0"], "limits": {"high": 99.95}}
    fields = {name: name for name in names}
    return _PROFILE.format(
        number=number, port=port, signals=json.dumps(kinds), fields=json.dumps(fields)
    )
