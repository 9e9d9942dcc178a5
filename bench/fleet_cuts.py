"""Motion, and the lists of robots, after a part of a fleet is killed or frozen.

A page drives a robot of another site over real Zenoh with TLS. The page is a client of the public
socket, like `bench.rig.operator_process`. A random node is killed or frozen: the router, the
robot's server, the guard, the operator's server or the page. Each stop is timed at the robot, from
the time at which the page sent the last effective tick.
"""

import json
import tempfile
from collections.abc import Sequence
from math import inf
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.fleet_troubles import LIST_MS, NODES, TROUBLES, FleetRig, FleetTrial
from tests.e2e.ports import free_pair

__all__ = ["run"]

EACH, EACH_IF_FULL = 20, 300
MOST_TRIALS = 2
"""Maximum number of trials on a busy machine, as a multiple of the required number."""
BIN_MS = 10


def run(*, full: bool) -> Sequence[Result]:
    """Kill and freeze nodes until enough trials are valid; compare the worst with the limits."""
    wanted = EACH_IF_FULL if full else EACH
    kept = Kept(f"fleet_cuts-{wanted}")
    trials = [FleetTrial.of(row) for row in kept.rows]
    if trouble := _next(trials, wanted):
        with tempfile.TemporaryDirectory() as folder, FleetRig(Path(folder), free_pair()) as rig:
            while trouble:
                trials.append(rig.trial(len(trials), trouble))
                kept.add(trials[-1]._asdict())
                trouble = _next(trials, wanted)
    kept.end()
    for one in trials:
        if not one.is_good and not one.is_excused:
            print(json.dumps({"broken": "fleet_cuts", **one._asdict()}), flush=True)
    for trouble in TROUBLES:
        for node in NODES:
            _tell([one for one in trials if (one.trouble, one.node) == (trouble, node)])
    return [result for trouble in TROUBLES for result in _results(trouble, trials, wanted)]


def _next(trials: Sequence[FleetTrial], wanted: int) -> str:
    """Return the trouble with the fewest valid trials, or "" if there are enough of each."""
    if len(trials) >= MOST_TRIALS * wanted * len(TROUBLES):
        return ""
    counts = {
        trouble: sum(one.trouble == trouble and not one.is_excused for one in trials)
        for trouble in TROUBLES
    }
    fewest = min(TROUBLES, key=lambda trouble: counts[trouble])
    return fewest if counts[fewest] < wanted else ""


def _tell(trials: Sequence[FleetTrial]) -> None:
    """Print the result for one trouble of one node."""
    counted = [one for one in trials if not one.is_excused]
    if not counted:
        return
    stops = distribution([one.stop_ms for one in counted], BIN_MS)
    stops.pop("histogram_ms", None)
    lists = [one.list_ms for one in counted if one.list_ms is not None]
    tell(
        {
            "figure": "fleet_cuts",
            "trouble": counted[0].trouble,
            "node": counted[0].node,
            "trials": len(counted),
            "broken": sum(not one.is_good for one in counted),
            "faults": sorted({one.fault for one in counted if one.fault}),
            "excused": len(trials) - len(counted),
            "limit_ms": round(counted[0].bound_ms),
            **stops,
            "list_max_ms": round(max(lists), 0) if lists else "",
            "back_max_ms": round(max(one.back_ms for one in counted), 0),
        }
    )


def _results(trouble: str, trials: Sequence[FleetTrial], wanted: int) -> list[Result]:
    counted = [one for one in trials if one.trouble == trouble and not one.is_excused]
    is_whole = len(counted) >= wanted and not any(one.fault for one in counted)
    stop = max((one.stop_ms / one.bound_ms for one in counted), default=inf)
    found = [_result(f"stop after a {trouble} in a fleet: slowest", stop, counted, is_whole)]
    if trouble == "kill":
        over = max((one.over_list_ms / LIST_MS + 1 for one in counted), default=inf)
        found.append(_result(f"list of robots after a {trouble}: slowest", over, counted, is_whole))
    return found


def _result(name: str, worst: float, counted: Sequence[FleetTrial], is_whole: bool) -> Result:
    return Result(
        name=f"{name} of {len(counted)} / limit",
        ratio=round(worst, 3) if is_whole else inf,
        goal=1.0,
        baseline_ms=counted[0].bound_ms if counted else inf,
        subject_ms=round(max((one.stop_ms for one in counted), default=inf), 1),
        spread=1.0,
        rounds=len(counted),
    )
