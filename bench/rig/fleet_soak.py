"""Pages at several sites want to drive one robot, while everything is killed at random.

The rig is that of `bench.rig.fleet_troubles`. Servers, guards and pages are killed with SIGKILL,
and replaced after a while. STOP is pressed at any site, and some pages reset it. Each motion value
is the send time of its tick, and its last digit tells which page has sent it.
"""

import os
import random
import signal
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import urllib3

from bench.rig.fleet_troubles import (
    CALM_S,
    LIFE_S,
    MOVED,
    ROBOTS_NODE,
    SITES,
    FleetRig,
)
from bench.rig.operator_process import Plan
from bench.rig.programs import Heard

__all__ = ["Latch", "SoakPiece", "SoakRig", "judged_soak"]

PAGES: Final = 2
"""Number of pages that want to drive at the same time."""
MARKS: Final = 16
PAUSE_S: Final = (0.2, 1.5)
"""Time between two deeds, in seconds."""
DEAD_S: Final = (0.2, 3.0)
"""Time until a killed server is started again, in seconds."""
GUARD_S: Final = 1.0
"""Time in which nothing else is killed after a guard, in seconds. The new guard stops the robot."""
STOP_ANSWER_S: Final = 3.0
RESETS: Final = 0.85
"""Share of the pages that reset STOP; the others wait until another page has reset it."""
KILLED_AFTER_STOP: Final = 0.3
"""Share of the STOPs after which the robot's server is killed at once."""
DEEDS: Final = {"server": 30, "guard": 15, "page": 20, "stop": 20, "nothing": 10}
"""Weights of the deeds."""


class Latch(NamedTuple):
    """A STOP that a site has confirmed."""

    pressed_ns: int
    """Monotonic time of the request."""
    told_ns: int
    """Monotonic time of the confirmation."""


class SoakPiece(NamedTuple):
    """The result of one piece of the run."""

    seed: int
    lasted_s: float
    kills: int
    stops: int
    """Number of STOPs that were confirmed."""
    resets: int
    drivers: int
    """Number of times that another page moved the robot than before."""
    values: int
    """Number of motion values at the robot."""
    stop_ms: float
    """Longest time from the send time of a motion's last value until its stop, in ms."""
    fault: str
    """Violation, or ""."""

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the piece with the fields of a stored row."""
        return cls(**row)


class SoakRig(FleetRig):
    """The rig, with pages that come and go at all sites."""

    def __init__(self, folder: Path, port: int) -> None:
        """Start everything; see `FleetRig`."""
        self._pages: dict[int, str] = {}
        """Node of each page's server, by the page's number."""
        self._dead: dict[str, float] = {}
        """Monotonic time at which each killed server is started again, by node."""
        self._latches: list[Latch] = []
        self._kills = 0
        self._http = urllib3.PoolManager(retries=False, timeout=STOP_ANSWER_S)
        super().__init__(folder, port)

    def piece(self, seed: int, lasts_s: float) -> SoakPiece:
        """Kill at random for `lasts_s` seconds; then mend everything, and judge the robot's log."""
        dice = random.Random(seed)  # noqa: S311 - the same deeds for the same number
        self.await_whole()
        self._latches, self._kills = [], 0
        began_ns, first = time.monotonic_ns(), len(self.operators.lines)
        while time.monotonic_ns() - began_ns < lasts_s * 1e9:
            self._invite_pages(dice)
            (deed,) = dice.choices(list(DEEDS), list(DEEDS.values()))
            self._do(deed, dice)
            time.sleep(dice.uniform(*PAUSE_S))
            self._mend_servers(time.monotonic())
        lasted_s = (time.monotonic_ns() - began_ns) / 1e9
        for number in list(self._pages):
            self._end_page(number)
        self._mend_servers(float("inf"))
        time.sleep(CALM_S)
        heard = self.robots.since(MOVED, began_ns)
        lines = (line.split() for line in self.operators.lines[first:])
        resets = [int(words[2]) for words in lines if words[:1] == ["reset"]]
        fault, drivers, stop_ms = judged_soak(heard, self._latches, resets)
        values = sum(one.text != "M 0" for one in heard)
        return SoakPiece(
            seed, round(lasted_s, 1), self._kills, len(self._latches), len(resets), drivers, values,
            stop_ms, fault,
        )  # fmt: skip

    def _invite_pages(self, dice: random.Random) -> None:
        """Start pages until there are enough; those that have ended do not count."""
        for number in list(self._pages):
            if ("failed", number) in self.operators.news:
                self._end_page(number)
        while len(self._pages) < PAGES and (
            nodes := [one for one in SITES if one not in self._dead]
        ):
            node = dice.choice(nodes)
            server = self.sites[node].server
            self._numbers += 1
            plan = Plan(
                self._numbers, server.host, server.port, _name_at(node), "outside", 0.0,
                life_s=LIFE_S, key=server.key, verb=dice.choice(("take", "take", "force")),
                resets=dice.random() < RESETS, mark=self._numbers % MARKS,
            )  # fmt: skip
            self.operators.start(plan._asdict())
            self._pages[self._numbers] = node

    def _living(self) -> list[str]:
        """Return the nodes whose servers run."""
        return [one for one in SITES if one not in self._dead]

    def _end_page(self, number: int) -> None:
        self.operators.kill(number)
        del self._pages[number]

    def _do(self, deed: str, dice: random.Random) -> None:
        living = self._living()
        if deed == "server" and living:
            self._kill_server(dice.choice(living), time.monotonic() + dice.uniform(*DEAD_S))
        elif deed == "guard" and ROBOTS_NODE in living:
            for guard in self.sites[ROBOTS_NODE].server.guards:
                with suppress(ProcessLookupError):
                    os.kill(guard, signal.SIGKILL)
                self._kills += 1
            time.sleep(GUARD_S)
        elif deed == "page" and self._pages:
            self._end_page(dice.choice(list(self._pages)))
            self._kills += 1
        elif deed == "stop" and living:
            self._press(dice.choice(living))
            if ROBOTS_NODE in living and dice.random() < KILLED_AFTER_STOP:
                self._kill_server(ROBOTS_NODE, time.monotonic() + dice.uniform(*DEAD_S))

    def _kill_server(self, node: str, until_s: float) -> None:
        os.kill(self.sites[node].server.pid, signal.SIGKILL)
        self._kills += 1
        self._dead[node] = until_s
        for number, of in list(self._pages.items()):
            if of == node:
                self._end_page(number)

    def _mend_servers(self, now_s: float) -> None:
        for node, due_s in list(self._dead.items()):
            if due_s <= now_s:
                self._serve(node)
                del self._dead[node]

    def _press(self, node: str) -> None:
        """Press STOP at a site; note it if it is confirmed."""
        server = self.sites[node].server
        pressed_ns = time.monotonic_ns()
        with suppress(urllib3.exceptions.HTTPError):
            reply = self._http.request(
                "POST",
                f"http://{server.host}:{server.port}/api/v1/stop",
                json={"robots": [_name_at(node)]},
                headers={"authorization": f"Bearer {server.key}"},
            )
            told_ns = time.monotonic_ns()
            found = reply.json().get("robots", []) if reply.status == 200 else []
            if any(one["result"] in ("confirmed", "latched") for one in found):
                self._latches.append(Latch(pressed_ns, told_ns))


def _name_at(node: str) -> str:
    """Return the robot's name on the dashboard of a site."""
    name = f"robot-{MOVED}"
    return name if node == ROBOTS_NODE else f"{name}@{SITES[ROBOTS_NODE]}"


def judged_soak(
    heard: Sequence[Heard], latches: Sequence[Latch], resets: Sequence[int]
) -> tuple[str, int, float]:
    """Return a violation or "", the number of changes of the driver, and the slowest stop in ms.

    Args:
        heard: lines of the robot.
        latches: confirmed STOPs.
        resets: monotonic times of the resets, in ns; each is valid for the earlier STOPs only.
    """
    fault, drivers, stop_ms = "", 0, 0.0
    driver: int | None = None
    sent: int | None = None  # last value since the last stop
    for one in heard:
        if one.text == "M 0":
            if sent is not None:
                stop_ms = max(stop_ms, one.time_ns / 1e6 - sent / 1e3)
            sent = None
            continue
        value = int(one.text[2:])
        if sent is not None and value % MARKS != sent % MARKS:
            fault = fault or "two pages moved the robot without a stop between them"
        if sent is not None and value < sent:
            fault = fault or "an older value arrived after a newer value"
        if _is_latched(one.time_ns, latches, resets):
            fault = fault or "the robot moved while STOP was latched"
        drivers += driver != value % MARKS
        driver, sent = value % MARKS, value
    if sent is not None:
        fault = fault or "the last motion has no stop"
    return fault, drivers, round(stop_ms, 1)


def _is_latched(time_ns: int, latches: Sequence[Latch], resets: Sequence[int]) -> bool:
    told = [one for one in latches if one.told_ns < time_ns]
    if not told:
        return False
    pressed_ns = told[-1].pressed_ns
    return not any(pressed_ns < reset_ns < time_ns for reset_ns in resets)
