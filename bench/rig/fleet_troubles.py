"""Trials in which a part of a fleet is killed or frozen while a robot is driven from afar.

Three sites run in processes of their own: the router, the robot's site with its guard, and the
operator's site with a page. Each motion value is the send time of its tick, so the robot's log
contains the times. Menus at all three sites ask for the list of robots meanwhile.
"""

import os
import random
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from bench.rig.deaths import BOUND_MS, LOOK_NS, WITNESSES, robot_profile
from bench.rig.engine import OPEN_MS, RESTART_MS
from bench.rig.fleet import FleetSite, found_fleet
from bench.rig.fleet_lists import FleetList, ListWatch
from bench.rig.operator_process import Plan
from bench.rig.programs import Heard, Operators, Robots

__all__ = ["LIST_MS", "NODES", "TROUBLES", "FleetRig", "FleetTrial", "judged_stop"]

TROUBLES = ("kill", "freeze")
SITES = {"router": "hub", "robot's server": "mill", "operator's server": "office"}
"""Site of each node that is a server; the first one is the authority."""
ROBOTS_NODE = "robot's server"
MOVED = tuple(SITES).index(ROBOTS_NODE)
"""Index of the driven robot."""
NODES = (*SITES, "guard", "operator's page")
LIST_MS = 1000.0
"""Longest time from a kill until the surviving dashboards list the robots correctly, in ms."""
HEARTBEAT_MS = 500.0
"""Time without a heartbeat after which a server replaces a frozen guard, in milliseconds."""
CALM_S = 2.0
"""Time after the fleet is whole again during which nothing may move, in seconds."""
NOTICE_S = 4.0
"""Longest wait for the lists after a kill or a long freeze, in seconds."""
SHORT_S = (0.4, 0.9)
"""Length of every second freeze, in seconds: longer than the lease, but no site is given up."""
STOP_WITHIN_S = 5.0
WHOLE_S = 60.0
READY_S = 25.0
LIFE_S = 600.0

_Right = Callable[[FleetList], bool]


class FleetTrial(NamedTuple):
    """The result of a trial."""

    number: int
    """Seed of the trial."""
    trouble: str
    """``kill`` or ``freeze``."""
    node: str
    """The part of the fleet, of `NODES`."""
    lasted_s: float
    """Length of a freeze; 0 for a kill."""
    stop_ms: float
    """Time until the first byte of the stop, in milliseconds.

    It counts from the time at which the page sent the last effective tick; for a guard, from the
    trouble.
    """
    bound_ms: float
    """Longest allowed `stop_ms`."""
    list_ms: float | None
    """Time from the trouble until all surviving dashboards list the robots correctly, in ms.

    For a guard, it counts from the new connection in the list of the robot's own site. None for a
    freeze that is too short to be noticed.
    """
    back_ms: float
    """Time from the end of the trouble until all dashboards list all robots again, in ms."""
    fault: str
    """Violation, or ""."""
    late_ms: float
    """Delay of the stop caused by the machine, in milliseconds."""
    list_late_ms: float
    """Delay of the list caused by the machine, in milliseconds."""
    has_moved: bool = True
    """Whether the robot was moving at the time of the trouble; if False, the trial is invalid."""

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the trial with the fields of a stored row."""
        return cls(**row)

    @property
    def over_list_ms(self) -> float:
        """By how much the list was late; only a kill has a limit."""
        return (self.list_ms or 0.0) - LIST_MS if self.trouble == "kill" else 0.0

    @property
    def is_good(self) -> bool:
        """Whether stop and list were in time, and nothing moved by itself."""
        return not self.fault and self.stop_ms <= self.bound_ms and self.over_list_ms <= 0

    @property
    def is_excused(self) -> bool:
        """Whether the machine's delay makes the trial invalid."""
        if self.fault:
            return False
        if not self.has_moved:
            return True
        is_stop_excused = self.stop_ms - self.bound_ms <= self.late_ms
        is_list_excused = self.over_list_ms <= self.list_late_ms
        return not self.is_good and is_stop_excused and is_list_excused


class FleetRig:
    """Three sites, a robot that is driven, and menus; all programs run on loopback."""

    def __init__(self, folder: Path, port: int) -> None:
        """Start everything.

        Args:
            folder: empty folder for documents and data.
            port: the router's port; the next port must be free too.
        """
        self._programs = ExitStack()
        self._numbers = 0
        try:
            self._start(folder, port)
        except BaseException:
            self._programs.close()
            raise

    def _start(self, folder: Path, port: int) -> None:
        enter = self._programs.enter_context
        self.robots = enter(Robots(["tcp:127.0.0.1:0"] * len(SITES)))
        self.sites = {
            node: FleetSite(
                name,
                folder / name,
                [robot_profile(index, "127.0.0.1", self.robots.ports[index], is_speed=False)],
            )
            for index, (node, name) in enumerate(SITES.items())
        }
        router, *guests = self.sites.values()
        found_fleet(router, guests, f"127.0.0.1:{port}")
        self._lists: dict[str, ListWatch] = {}
        for node, site in self.sites.items():
            self._programs.callback(site.close)
            self._serve(node)
        self.operators = enter(Operators())
        self._witnesses = [enter(Robots([])) for _ in range(WITNESSES)]
        self._programs.callback(self._unlist)
        self._watcher: Robots | None = None
        self._programs.callback(self._unwatch)
        self._watch()

    def _serve(self, node: str) -> None:
        if node in self._lists:
            self._lists.pop(node).close()
        self._lists[node] = ListWatch(self.sites[node].start())

    def _watch(self) -> None:
        """Measure how long the processes on a tick's path wait for a processor."""
        self._unwatch()
        pids = [self.operators.pid, *(one.server.pid for one in self.sites.values())]
        self._watcher = Robots([f"pid:{pid}" for pid in pids])

    def _unlist(self) -> None:
        for one in self._lists.values():
            one.close()

    def _unwatch(self) -> None:
        if self._watcher is not None:
            self._watcher.close()

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

    # -- one trial

    def trial(self, number: int, trouble: str) -> FleetTrial:
        """Drive the robot, kill or freeze a random node, and mend it; `number` is the seed."""
        dice = random.Random(number)  # noqa: S311 - the same trial for the same number
        node, is_short = dice.choice(NODES), trouble == "freeze" and dice.random() < 0.5
        self.await_whole()
        began_ns = time.monotonic_ns()
        page = self._drive(began_ns)
        time.sleep(0.1 + dice.random() * 0.4)
        process = self._process(node, page)
        struck_ns = time.monotonic_ns()
        os.kill(process, signal.SIGKILL if trouble == "kill" else signal.SIGSTOP)
        self._await_stop(struck_ns)
        late_ms = self._late_ms(struck_ns, time.monotonic_ns())
        if is_short:
            short_s = dice.uniform(*SHORT_S)
            time.sleep(max(0.0, short_s - (time.monotonic_ns() - struck_ns) / 1e9))
            list_ms = None
        else:
            since_ns = struck_ns
            if node == "guard":  # until then, the robot is lost in fact
                own_ms = self._await_lists(struck_ns, self._own(), STOP_WITHIN_S)
                since_ns += round(1e6 * min(own_ms, 1000 * STOP_WITHIN_S))
            list_ms = self._await_lists(since_ns, self._expected(trouble, node))
        noticed_ns = time.monotonic_ns()
        list_late_ms = self._late_ms(struck_ns, noticed_ns)
        healed_ns = self._mend(trouble, node, process)
        back_ms = self._await_lists(healed_ns, self._whole(), WHOLE_S)
        time.sleep(CALM_S)
        self.operators.kill(page)
        heard = self.robots.since(MOVED, began_ns)
        stop_ms, fault, has_moved = judged_stop(heard, struck_ns, is_guard=node == "guard")
        if back_ms == float("inf"):
            fault = fault or f"the lists were wrong {WHOLE_S:g} s after the end of the trouble"
        lasted_s = (healed_ns - struck_ns) / 1e9 if trouble == "freeze" else 0.0
        return FleetTrial(
            number, trouble, node, round(lasted_s, 2), stop_ms, _bound_ms(trouble, node), list_ms,
            back_ms, fault, late_ms, list_late_ms, has_moved,
        )  # fmt: skip

    def await_whole(self) -> None:
        """Wait until all dashboards list all robots; fail at the time limit."""
        if self._await_lists(time.monotonic_ns(), self._whole(), WHOLE_S) == float("inf"):
            last = {node: one.lists[-1].states for node, one in self._lists.items() if one.lists}
            raise AssertionError(f"the fleet is not whole within {WHOLE_S:g} s: {last}")

    def _drive(self, began_ns: int) -> int:
        """Make a page of the operator's site drive the robot; return the page's number."""
        self._numbers += 1
        server = self.sites["operator's server"].server
        plan = Plan(
            self._numbers, server.host, server.port, f"robot-{MOVED}@{SITES[ROBOTS_NODE]}",
            "outside", 0.0, life_s=LIFE_S, key=server.key,
        )  # fmt: skip
        self.operators.start(plan._asdict())
        self.operators.await_told("dying", self._numbers)  # it has driven, and continues

        def moves() -> bool:
            return any(one.text != "M 0" for one in self.robots.since(MOVED, began_ns))

        self.robots.wait_until(moves, READY_S, "motion of the robot")
        return self._numbers

    def _process(self, node: str, page: int) -> int:
        if node == "operator's page":
            return int(self.operators.await_told("pid", page))
        if node == "guard":
            (guard,) = self.sites[ROBOTS_NODE].server.guards
            return guard
        return self.sites[node].server.pid

    def _mend(self, trouble: str, node: str, process: int) -> int:
        """Resume the node or start its server again; return the time before."""
        healed_ns = time.monotonic_ns()
        if trouble == "freeze":
            with suppress(ProcessLookupError):  # a frozen guard was replaced
                os.kill(process, signal.SIGCONT)
        elif node in self.sites:
            self._serve(node)
            self._watch()
        return healed_ns

    def _await_stop(self, struck_ns: int) -> None:
        """Wait for a stop; its absence is judged later."""
        robots = self.robots

        def is_told() -> bool:
            return any(one.text == "M 0" for one in robots.since(MOVED, struck_ns))

        with suppress(AssertionError):
            robots.wait_until(is_told, STOP_WITHIN_S, "the stop")

    def _late_ms(self, from_ns: int, until_ns: int) -> float:
        """Return the delay caused by the machine between two times, in milliseconds."""
        time.sleep(max(0.0, (until_ns + LOOK_NS - time.monotonic_ns()) / 1e9))
        others = max(one.latest_ms(from_ns, until_ns) for one in self._witnesses)
        assert self._watcher is not None
        waited_ms = self._watcher.waited_ms(from_ns, until_ns + LOOK_NS)
        return self.robots.latest_ms(from_ns, until_ns) + max(others, waited_ms)

    # -- the lists

    def _whole(self) -> Mapping[str, _Right]:
        return {node: _shows(node, frozenset()) for node in SITES}

    def _own(self) -> Mapping[str, _Right]:
        """Return what the robot's own dashboard shows when the robot is connected again."""
        return {ROBOTS_NODE: _shows(ROBOTS_NODE, frozenset())}

    def _expected(self, trouble: str, node: str) -> Mapping[str, _Right]:
        """Return what the surviving dashboards must show after a trouble."""
        if node not in SITES:
            is_driven = trouble == "freeze" or node == "guard"
            return {one: _shows(one, frozenset(), is_driven=is_driven) for one in SITES}
        survivors = [one for one in SITES if one != node]
        cut = frozenset(SITES) if node == "router" else frozenset((node,))
        return {one: _shows(one, cut) for one in survivors}

    def _await_lists(
        self, since_ns: int, right: Mapping[str, _Right], limit_s: float = NOTICE_S
    ) -> float:
        """Return the time until all lists are right, in milliseconds; infinite at the limit."""
        end_s = time.monotonic() + limit_s
        while True:
            found = [self._lists[node].right_ns(since_ns, one) for node, one in right.items()]
            times = [one for one in found if one is not None]
            if len(times) == len(found):
                return (max(times) - since_ns) / 1e6
            if time.monotonic() > end_s:
                return float("inf")
            time.sleep(0.02)


def _shows(dashboard: str, cut: frozenset[str], *, is_driven: bool = True) -> _Right:
    """Return a function that checks whether exactly the robots of the `cut` sites are lost.

    Without `is_driven`, the driven robot has no operator either.
    """
    names = {
        node: f"robot-{index}" + ("" if node == dashboard else f"@{name}")
        for index, (node, name) in enumerate(SITES.items())
    }

    def is_right(found: FleetList) -> bool:
        if not is_driven and found.holders.get(names[ROBOTS_NODE]):
            return False
        return all(
            names[node] in found.states
            and (found.states[names[node]] == "lost") == (node in cut and node != dashboard)
            for node in SITES
        )

    return is_right


def _bound_ms(trouble: str, node: str) -> float:
    if node != "guard":
        return BOUND_MS
    return RESTART_MS + OPEN_MS + (HEARTBEAT_MS if trouble == "freeze" else 0.0)


def judged_stop(heard: list[Heard], struck_ns: int, *, is_guard: bool) -> tuple[float, str, bool]:
    """Return the time until the stop in ms, a violation or "", and whether the robot had moved.

    Args:
        heard: lines of the robot since the page began to drive.
        struck_ns: monotonic time of the trouble.
        is_guard: whether the time counts from the trouble instead of the last tick.
    """
    before = [one for one in heard if one.time_ns < struck_ns]
    has_moved = bool(before) and before[-1].text != "M 0"
    after = [place for place, one in enumerate(heard) if one.time_ns >= struck_ns]
    stops = [place for place in after if heard[place].text == "M 0"]
    if not stops:
        return float("inf"), "no stop came" if has_moved else "", has_moved
    stop = stops[0]
    moved = [one for one in heard[:stop] if one.text != "M 0"]
    sent = [int(one.text[2:]) for one in heard if one.text != "M 0"]
    fault = "" if sent == sorted(sent) else "an older value arrived after a newer value"
    if any(one.text != "M 0" for one in heard[stop:]):
        fault = "the robot moved again after the stop"
    from_ns = struck_ns if is_guard else int(moved[-1].text[2:]) * 1000 if moved else struck_ns
    return (heard[stop].time_ns - from_ns) / 1e6, fault, has_moved
