"""What one page that ticks a thousand times a second does to another that drives another robot.

The other's way from its socket to its robot, in turns: while the first one drives as pages do, and
while it floods the server.
"""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.motion_path import PROFILE, TimedPage, ticks_of
from urc.testing.rig import Operators, Robots, Server
from urc.testing.rig_deaths import lane_profile
from urc.testing.rig_operator import Plan

__all__ = ["run"]

GOAL = 1.1
TICKS, TICKS_IF_FULL = 200, 500
ROUNDS, ROUNDS_IF_FULL = 3, 9
BIN_MS = 0.1
LIFE_S = 60.0
WAYS = {"quiet": "outside", "flood": "flood"}


def run(*, full: bool) -> Sequence[Result]:
    """Measure both in turns."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    taken: dict[str, list[float]] = {way: [] for way in WAYS}
    with (
        tempfile.TemporaryDirectory() as folder,
        Robots(["tcp:127.0.0.1:0"] * 2) as robots,
        Operators() as operators,
    ):
        files = [Path(folder, "path.yaml"), Path(folder, "lane-1.yaml")]
        files[0].write_text(PROFILE.format(port=robots.ports[0]), "utf-8")
        files[1].write_text(lane_profile(1, "127.0.0.1", robots.ports[1]), "utf-8")
        with Server(files, Path(folder, "data")) as server:
            page = TimedPage(Plan(1, "127.0.0.1", server.port, "path", "", 0))
            page.take_controls()
            for number in range(2 * (rounds + 1)):
                way = tuple(WAYS)[number % 2]
                other = Plan(
                    number, "127.0.0.1", server.port, "lane-1", WAYS[way], 0, life_s=LIFE_S
                )
                operators.start(other._asdict())
                operators.await_told("dying", number)
                page.wait(time.monotonic_ns() + 200_000_000)
                times = ticks_of(page, robots, ticks)
                operators.kill(number)
                if number > 1:  # the first round of each does not count
                    taken[way] += times
            page.socket.close()
    for way, times in taken.items():
        figures = distribution(times, BIN_MS)
        tell({"figure": "motion_flood", "another_page": way, "ticks": len(times), **figures})
    return [_result(taken, rounds)]


def _result(taken: dict[str, list[float]], rounds: int) -> Result:
    quiet, flood = (sorted(taken[way])[round(len(taken[way]) * 0.99) - 1] for way in WAYS)
    middle = sorted(taken["quiet"])[len(taken["quiet"]) // 2]
    return Result(
        name="motion path p99 beside a page that floods / beside one that drives",
        ratio=round(flood / quiet, 3),
        goal=GOAL,
        baseline_ms=round(quiet, 3),
        subject_ms=round(flood, 3),
        spread=round(quiet / middle, 2),
        rounds=rounds,
    )
