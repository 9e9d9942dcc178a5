"""Time until driven robots stop after the server hangs or dies.

A signal freezes or kills the server, or a backtracking pattern blocks the server. The guards check
the leases, so the limit is the same as for the loss of an operator.
"""

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.rig.deaths import Trial
from bench.rig.engine import ENGINE_DEATHS, EngineRig

__all__ = ["repeated", "run", "said"]

ROBOTS = 20
EACH, EACH_IF_FULL = 40, 1000
BIN_MS = 10
MOST_BOUTS = 3
"""Maximum number of rounds of trials on a busy machine, as a multiple of the required number."""


def run(*, full: bool) -> Sequence[Result]:
    """Disturb the server; compare the slowest stop with the limit."""
    wanted = EACH_IF_FULL if full else EACH
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        EngineRig(Path(folder), robot_count=ROBOTS) as rig,
    ):
        rig.bout("close")  # starts the guards
        for death in ENGINE_DEATHS:
            trials = repeated(partial(rig.engine_bout, death), wanted, ROBOTS)
            results.append(said("motion_engine", death, trials, wanted, BIN_MS))
    return results


def repeated(bout: Callable[[], list[Trial]], wanted: int, robot_count: int) -> list[Trial]:
    """Repeat rounds until enough trials are valid, or the maximum number of rounds is reached."""
    trials: list[Trial] = []
    for _ in range(MOST_BOUTS * wanted // robot_count):
        trials += bout()
        if sum(not one.is_excused for one in trials) >= wanted:
            break
    return trials


def said(figure: str, death: str, trials: Sequence[Trial], wanted: int, bin_ms: float) -> Result:
    """Print the result of one kind of failure, and compare the slowest stop with the limit."""
    counted = [one for one in trials if not one.is_excused]
    figures = {
        "figure": figure,
        "death": death,
        "trials": len(counted),
        "broken": sum(not one.is_good for one in counted),
        "faults": sorted({one.fault for one in counted if one.fault}),
        "excused": len(trials) - len(counted),
        **distribution([one.stop_ms for one in counted], bin_ms),
    }
    tell(figures)
    is_whole = len(counted) >= wanted and not any(one.fault for one in counted)
    slowest = max((one.stop_ms for one in counted), default=inf) if is_whole else inf
    bound_ms = trials[0].bound_ms
    return Result(
        name=f"motion stop after {death}: slowest of {len(counted)} / {bound_ms:g} ms",
        ratio=round(slowest / bound_ms, 3),
        goal=1.0,
        baseline_ms=bound_ms,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(counted),
    )
