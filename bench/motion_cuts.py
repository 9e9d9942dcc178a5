"""Motion after the link to a driven robot is cut, on every kind of transport.

Real programs run on both sides of a relay between two network namespaces: `urc serve` with its
guards, and robots, brokers and login servers. The links of different robots are cut at different
moments. The cut lengths are evenly distributed on a logarithmic scale. In every second cut, the
control is released during the cut. Without root and /dev/net/tun, the benchmark is skipped with a
message.
"""

import json
import random
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from math import inf
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.rig.cuts import Cut, CutRig
from bench.rig.kinds import KINDS, bounds_of
from bench.rig.programs import can_relay

__all__ = ["run"]

EACH, EACH_IF_FULL = 8, 200
ROBOTS, ROBOTS_IF_FULL = 2, 6
"""Number of robots on each kind of transport, all in parallel."""
SHORTEST_S = 0.2
LONGEST_S, LONGEST_IF_FULL_S = 3.0, 60.0
BIN_MS = 10


def run(*, full: bool) -> Sequence[Result]:
    """Cut the links; compare each transport's worst result with its limits."""
    if not can_relay():
        print(json.dumps({"left_out": "motion_cuts: needs root and /dev/net/tun"}))
        return []
    each, robot_count = (EACH_IF_FULL, ROBOTS_IF_FULL) if full else (EACH, ROBOTS)
    longest_s = LONGEST_IF_FULL_S if full else LONGEST_S
    kinds = KINDS * robot_count
    dice = random.Random(3)  # noqa: S311 - the same cuts in every run
    plans = {kind: _spread(each, longest_s, dice) for kind in KINDS}
    with (
        tempfile.TemporaryDirectory() as folder,
        CutRig(Path(folder), kinds) as rig,
        ThreadPoolExecutor(len(kinds)) as threads,
    ):
        rig.cut(SHORTEST_S)  # starts the guards
        done = [threads.submit(_cut_one, rig, index, plans[kinds[index]]) for index in rig.indexes]
        cuts = [cut for one in done for cut in one.result()]
    return [_told(kind, [one for one in cuts if one.kind == kind], each) for kind in KINDS]


def _spread(count: int, longest_s: float, dice: random.Random) -> list[tuple[float, float]]:
    """Return random cuts: the length in seconds, and the share of the cut before the release."""
    ratio = longest_s / SHORTEST_S
    times = [SHORTEST_S * ratio ** (place / (count - 1)) for place in range(count)]
    dice.shuffle(times)
    return [(seconds, 0.1 + dice.random() * 0.8) for seconds in times]


def _cut_one(rig: CutRig, index: int, plan: list[tuple[float, float]]) -> list[Cut]:
    """Run cuts from the shared plan until it is empty; repeat invalid cuts."""
    cuts: list[Cut] = []
    while True:
        try:
            seconds, share = plan.pop()
        except IndexError:
            return cuts
        cuts.append(rig.cut_one(index, seconds, share))
        if cuts[-1].is_excused and sum(one.is_excused for one in cuts) < len(cuts) / 2:
            plan.append((seconds, share))


def _told(kind: str, cuts: Sequence[Cut], wanted: int) -> Result:
    said = [one for one in cuts if not one.is_excused]
    bad = [one for one in said if not one.is_good]
    stops_ms = [one.stop_ms for one in said if one.is_stop_needed]
    figures = {
        "figure": "motion_cuts",
        "line": kind,
        "cuts": len(said),
        "longest_cut_s": round(max((one.lasted_s for one in said), default=0), 1),
        "broken": len(bad),
        "faults": sorted({one.fault for one in bad if one.fault}),
        "excused": len(cuts) - len(said),
        "oldest_motion_ms": round(max((one.oldest_ms for one in said), default=0.0)),
        **distribution(stops_ms, BIN_MS),
    }
    tell(figures)
    for one in bad:
        print(json.dumps({"broken": kind, **one._asdict()}), flush=True)
    bounds = bounds_of(kind)
    oldest = max((one.oldest_ms for one in said), default=inf) / bounds.oldest_ms
    slowest = max(stops_ms, default=0.0) / bounds.stop_ms
    is_whole = len(said) >= wanted and not any(one.fault for one in said)
    worst = max(oldest, slowest) if is_whole else inf
    return Result(
        name=f"motion after cuts of {kind}: worst of {len(said)} / limit",
        ratio=round(worst, 3),
        goal=1.0,
        baseline_ms=bounds.stop_ms,
        subject_ms=round(max(stops_ms, default=0.0), 1),
        spread=1.0,
        rounds=len(said),
    )
