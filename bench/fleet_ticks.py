"""Delay that two hops of a fleet add to a tick, compared with Zenoh alone.

One page drives a robot at the dashboard of the robot's own site. Another page drives it at the
dashboard of another site, over a third site that is the router. The difference is the added delay.
In the same run, a message of the same size passes two hops of Zenoh without URC, over plain TCP.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median

from bench.figures import tell
from bench.harness import Result
from bench.motion_path import PROFILE, TimedPage, ticks_of
from bench.rig.fleet import FleetSite, found_fleet
from bench.rig.operator_process import Plan
from bench.rig.programs import HERE, Program, Robots, Server, peer
from tests.e2e.ports import free_pair

__all__ = ["driven", "run"]

TICKS, TICKS_IF_FULL = 150, 300
ROUNDS, ROUNDS_IF_FULL = 3, 9
ADDED_MS = 10.0
"""Largest added delay, 95th percentile, in milliseconds."""
TIMES_BARE = 2.0
"""Largest ratio of the added delay to the delay of Zenoh alone, 95th percentile."""
QUANTILES = (0.5, 0.95)
START_S = 60.0
NEAR, FAR, BARE, ECHO = "own site", "another site", "Zenoh alone", "Zenoh alone, there and back"

_Round = Callable[[], dict[str, list[float]]]


def run(*, full: bool) -> Sequence[Result]:
    """Measure the three ways in turn."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    taken: dict[str, list[list[float]]] = {NEAR: [], FAR: [], BARE: [], ECHO: []}
    with ExitStack() as stack:
        ways = [stack.enter_context(_fleet(ticks)), stack.enter_context(_bare(ticks))]
        for number in range(rounds + 1):
            for way in ways:
                for name, times in way().items():
                    if number:  # the first round warms up
                        taken[name].append(sorted(times))
    added = {
        share: [
            _quantile(far, share) - _quantile(near, share)
            for far, near in zip(taken[FAR], taken[NEAR], strict=True)
        ]
        for share in QUANTILES
    }
    for name, of_rounds in taken.items():
        tell(
            _figures(
                name, [median(_quantile(one, share) for one in of_rounds) for share in QUANTILES]
            )
        )
    tell(_figures("added by two hops", [median(added[share]) for share in QUANTILES]))
    bare = [_quantile(one, 0.95) for one in taken[BARE]]
    ratios = [after / before for after, before in zip(added[0.95], bare, strict=True)]
    return [
        _result("p95 / 10 ms", median(added[0.95]) / ADDED_MS, 1.0, [ADDED_MS], added[0.95]),
        _result("p95 / Zenoh alone", median(ratios), TIMES_BARE, bare, added[0.95]),
    ]


@contextmanager
def _fleet(ticks: int) -> Iterator[_Round]:
    """Run three sites and a robot."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"] * 3))
        router, own, other = (
            FleetSite(name, Path(folder, name), [PROFILE.format(port=port)])
            for name, port in zip(("hub", "mill", "office"), robots.ports, strict=True)
        )
        robots.heard[0] = robots.heard[1]  # `ticks_of` reads the first robot
        found_fleet(router, (own, other), f"127.0.0.1:{free_pair()}")
        for site in (router, own, other):
            stack.callback(site.close)
            site.start()

        def one_round() -> dict[str, list[float]]:
            return {
                NEAR: driven(own.server, "path", robots, ticks),
                FAR: driven(other.server, "path@mill", robots, ticks),
            }

        yield one_round


def driven(server: Server, robot: str, robots: Robots, ticks: int) -> list[float]:
    """Return the time of each tick from a new page to the robot, in milliseconds."""
    end_s = time.monotonic() + START_S
    while True:  # the sites may not have found each other
        try:
            page = TimedPage(Plan(1, server.host, server.port, robot, "", 0, key=server.key))
            break
        except ConnectionError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.2)
    try:
        page.take_controls()
        page.wait(time.monotonic_ns() + 100_000_000)
        return ticks_of(page, robots, ticks)
    finally:
        page.socket.close()


@contextmanager
def _bare(ticks: int) -> Iterator[_Round]:
    """Run a router, an echo and a sender without URC."""
    with ExitStack() as stack:
        port = stack.enter_context(peer("zenoh_echo.py", "router"))
        stack.enter_context(peer("zenoh_echo.py", "echo", port))
        script = str(HERE.parent / "peers" / "zenoh_echo.py")
        sender = stack.enter_context(Program([sys.executable, "-P", script, "send", str(port)]))
        sender.wait_for("ready")

        def one_round() -> dict[str, list[float]]:
            count = len(sender.lines)
            sender.order(str(ticks))
            sender.wait_until(lambda: len(sender.lines) > count, START_S, "the times")
            times = json.loads(sender.lines[count])
            return {BARE: [one for one, _ in times], ECHO: [both for _, both in times]}

        yield one_round


def _quantile(ordered: Sequence[float], share: float) -> float:
    return ordered[round((len(ordered) - 1) * share)]


def _figures(way: str, times_ms: Sequence[float]) -> dict[str, object]:
    p50_ms, p95_ms = times_ms
    return {
        "figure": "fleet_ticks",
        "way": way,
        "p50_ms": round(p50_ms, 2),
        "p95_ms": round(p95_ms, 2),
    }


def _result(
    name: str, ratio: float, goal: float, bases: Sequence[float], subjects: Sequence[float]
) -> Result:
    return Result(
        name=f"delay of ticks added by two hops of a fleet: {name}",
        ratio=round(ratio, 3),
        goal=goal,
        baseline_ms=round(median(bases), 2),
        subject_ms=round(median(subjects), 2),
        spread=round(max(bases) / median(bases), 2),
        rounds=len(subjects),
    )
