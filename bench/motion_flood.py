"""How a page that sends a thousand ticks a second affects a page that drives another robot.

In short windows, the benchmark measures the latency from the driving page's socket to its robot.
The windows alternate between a normal page, a page that floods another server, and a page that
floods the same server. Every flood uses processor time of the machine, both in the flooding page
and in its server. The goal therefore compares the two floods. The result with the normal page is
printed, but has no goal.
"""

import statistics
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.motion_path import PROFILE, TimedPage, ticks_of
from bench.rig.deaths import robot_profile
from bench.rig.operator_process import Plan
from bench.rig.programs import Operators, Robots, Server

__all__ = ["run"]

GOAL = 1.1
TICKS, TICKS_IF_FULL = 150, 300
ROUNDS, ROUNDS_IF_FULL = 5, 25
BIN_MS = 0.1
LIFE_S = 60.0
WAYS = {"quiet": "outside", "flood elsewhere": "flood", "flood": "flood"}


def run(*, full: bool) -> Sequence[Result]:
    """Measure the normal page and the two floods in turn."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    taken: dict[str, list[list[float]]] = {way: [] for way in WAYS}
    with (
        tempfile.TemporaryDirectory() as folder,
        Robots(["tcp:127.0.0.1:0"] * 3) as robots,
        Operators() as operators,
    ):
        place = Path(folder)
        ours, theirs = _profiles(place, robots.ports)
        with Server(ours, place / "data") as server, Server(theirs, place / "data-2") as elsewhere:
            page = TimedPage(Plan(1, "127.0.0.1", server.port, "path", "", 0, key=server.key))
            page.take_controls()
            for number in range(len(WAYS) * (rounds + 1)):
                way = tuple(WAYS)[number % len(WAYS)]
                is_else = way == "flood elsewhere"
                near = elsewhere if is_else else server
                robot = "robot-2" if is_else else "robot-1"
                other = Plan(
                    number, "127.0.0.1", near.port, robot, WAYS[way], 0, life_s=LIFE_S, key=near.key
                )
                operators.start(other._asdict())
                operators.await_told("dying", number)
                page.wait(time.monotonic_ns() + 200_000_000)
                times = ticks_of(page, robots, ticks)
                operators.kill(number)
                if number >= len(WAYS):  # the first round does not count
                    taken[way].append(times)
            page.socket.close()
    for way, windows in taken.items():
        times = [one for window in windows for one in window]
        figures = distribution(times, BIN_MS)
        tell({"figure": "motion_flood", "another_page": way, "ticks": len(times), **figures})
    return [_result(taken, rounds)]


def _profiles(folder: Path, ports: Sequence[int]) -> tuple[list[Path], list[Path]]:
    """Write the documents of the measured server and the other server."""
    path, *others = folder / "path.yaml", folder / "robot-1.yaml", folder / "robot-2.yaml"
    path.write_text(PROFILE.format(port=ports[0]), "utf-8")
    for number, file in enumerate(others, 1):
        file.write_text(robot_profile(number, "127.0.0.1", ports[number]), "utf-8")
    return [path, others[0]], [others[1]]


def _result(taken: dict[str, list[list[float]]], rounds: int) -> Result:
    quiet, elsewhere, flood = ([_p99(window) for window in taken[way]] for way in WAYS)
    ratios = [after / before for before, after in zip(elsewhere, flood, strict=True)]
    middle = statistics.median(one for window in taken["quiet"] for one in window)
    return Result(
        name="motion path p99 with a page that floods its server / another server",
        ratio=round(statistics.median(ratios), 3),
        goal=GOAL,
        baseline_ms=round(statistics.median(elsewhere), 3),
        subject_ms=round(statistics.median(flood), 3),
        spread=round(statistics.median(quiet) / middle, 2),
        rounds=rounds,
    )


def _p99(times: Sequence[float]) -> float:
    return sorted(times)[round(len(times) * 0.99) - 1]
