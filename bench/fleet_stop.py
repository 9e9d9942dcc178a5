"""STOP ALL at fifty robots of ten sites, pressed at a dashboard of another site.

Ten sites with five robots each, a router and a dashboard share one computer. The robots' program
notes the time of each stop. In the second half of the rounds, one site is frozen. Its robots must
have no link within a second, and all others must be confirmed meanwhile.
"""

import os
import signal
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, Final

import urllib3

from bench.figures import tell
from bench.harness import Result
from bench.rig.fleet import FleetSite, found_fleet
from bench.rig.programs import Robots
from tests.e2e.ports import free_pair

__all__ = ["run"]

SITES, EACH = 10, 5
COUNT: Final = SITES * EACH
ROUNDS, ROUNDS_IF_FULL = 4, 40
STOP_MS = 300.0
"""Longest time until the last robot is stopped and confirmed, in milliseconds."""
TOLD_MS = 1000.0
"""Longest time until the reply names the robots of a frozen site, in milliseconds."""
STARTS = 3
READY_S = 120.0
PAUSE_S = 1.0

_PROFILE = """\
urc: 1
kind: robot
name: robot-{number}
title: Robot {number}
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: {port}
    framing: {{ type: delimiter, tx: LF, rx: LF }}
    stale_after: 600s
signals:
  speed: {{ type: number, limits: {{ high: 9 }} }}
messages:
  said: {{ regex: '^v (?P<speed>[0-9.]+)$' }}
commands:
  go:
    send: "M {{{{ t }}}}"
    args: {{ t: {{ type: integer, min: 0 }} }}
    hold: {{ repeat: 50ms, lease: 250ms, release: {{ t: 0 }}, watchdog: none }}
"""


class _Fleet:
    """The running fleet."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"] * (COUNT + 2)))
        texts = [
            _PROFILE.format(number=number, port=port)
            for number, port in enumerate(self.robots.ports)
        ]
        self.router = FleetSite("router", folder / "router", texts[COUNT : COUNT + 1])
        self.screen = FleetSite("screen", folder / "screen", texts[COUNT + 1 :])
        self.sites = [
            FleetSite(
                f"site-{index}",
                folder / f"site-{index}",
                texts[EACH * index : EACH * (index + 1)],
                "--monitor-alarms",
            )
            for index in range(SITES)
        ]
        everybody = (self.router, self.screen, *self.sites)
        found_fleet(self.router, everybody[1:], f"127.0.0.1:{free_pair()}")
        for one in everybody:
            stack.callback(one.close)
        with ThreadPoolExecutor(STARTS) as threads:
            list(threads.map(FleetSite.start, everybody))
        self._http = urllib3.PoolManager()
        self._await_robots()

    def ask(self, method: str, path: str, body: object = None) -> dict[str, Any]:
        """Return the decoded reply of the dashboard."""
        server = self.screen.server
        reply = self._http.request(
            method,
            f"http://{server.host}:{server.port}{path}",
            json=body,
            headers={"authorization": f"Bearer {server.key}"},
        )
        found: dict[str, Any] = reply.json()
        if reply.status != 200:
            raise AssertionError(f"{path}: {found}")
        return found

    def _await_robots(self) -> None:
        """Wait until the dashboard lists all robots, and each of them is connected."""
        end_s = time.monotonic() + READY_S
        while time.monotonic() < end_s:
            listed = self.ask("GET", "/api/v1/robots")["robots"]
            far = [one for one in listed if "@site-" in one["name"]]
            if len(far) == COUNT and all(map(any, self.robots.visits[:COUNT])):
                return
            time.sleep(0.5)
        raise AssertionError(f"not all of {COUNT} robots are connected")

    def press(self) -> tuple[dict[str, str], float, list[float]]:
        """Press STOP ALL.

        Return the result of each robot of the ten sites. The second value is the time of the reply,
        and the third value the time of each robot's stop, in ms.
        """
        began_ns = time.monotonic_ns()
        reply = self.ask("POST", "/api/v1/stop", {"all": True})
        told_ms = (time.monotonic_ns() - began_ns) / 1e6
        time.sleep(PAUSE_S)  # for the reports of the robots' program
        results = {one["name"]: one["result"] for one in reply["robots"] if "@site-" in one["name"]}
        stops = []
        for robot in range(COUNT):
            heard = [one for one in self.robots.since(robot, began_ns) if one.text == "M 0"]
            if heard:
                stops.append((heard[0].time_ns - began_ns) / 1e6)
        return results, told_ms, stops


def run(*, full: bool) -> Sequence[Result]:
    """Press STOP ALL with all sites, and with one frozen site."""
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder, ExitStack() as stack:
        fleet = _Fleet(Path(folder), stack)
        fleet.press()  # warms up
        whole = [fleet.press() for _ in range(rounds)]
        frozen = fleet.sites[-1]
        process = frozen.server.pid
        os.kill(process, signal.SIGSTOP)
        try:
            partly = [fleet.press() for _ in range(rounds)]
        finally:
            os.kill(process, signal.SIGCONT)
    for results, _, stops in whole:
        if set(results.values()) != {"confirmed"} or len(results) != len(stops) != COUNT:
            raise AssertionError(f"{len(stops)} of {COUNT} robots stopped: {results}")
    for results, _, stops in partly:
        lost = {name for name, result in results.items() if result == "no-link"}
        if {name.partition("@")[2] for name in lost} != {frozen.name} or len(lost) != EACH:
            raise AssertionError(f"no link: {sorted(lost)}, {len(stops)} robots stopped")
    told = [told_ms for _, told_ms, _ in whole]
    late = [told_ms for _, told_ms, _ in partly]
    last = [max(stops) for _, _, stops in whole]
    for name, times in (
        ("last robot has received STOP", last),
        ("all confirmed", told),
        ("NO LINK of a frozen site told, all others confirmed", late),
    ):
        tell(
            {
                "figure": "fleet_stop",
                "time": name,
                "presses": len(times),
                "p50_ms": round(median(times), 1),
                "worst_ms": round(max(times), 1),
            }
        )
    return [_result("confirmed", told, STOP_MS), _result("NO LINK told", late, TOLD_MS)]


def _result(name: str, times_ms: Sequence[float], goal_ms: float) -> Result:
    return Result(
        name=f"STOP ALL at {COUNT} robots: {name}",
        ratio=round(max(times_ms) / goal_ms, 3),
        goal=1.0,
        baseline_ms=goal_ms,
        subject_ms=round(max(times_ms), 1),
        spread=1.0,
        rounds=len(times_ms),
    )
