"""How soon robots stop when the server hangs or dies while they are driven, or a guard is killed.

Stopped by a signal, killed, and held up by a pattern that backtracks: the guards have the leases,
so the bound is the same as for an operator who vanishes. A guard that is killed is replaced within
half a second, and the new one stops its robot before it says anything else.
"""

import tempfile
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from urc.testing.rig_deaths import Trial
from urc.testing.rig_engine import ENGINE_DEATHS, EngineRig

__all__ = ["run"]

LANES, GUARDED_LANES = 20, 4
EACH, EACH_IF_FULL = 40, 1000
KILLED, KILLED_IF_FULL = 20, 200
BIN_MS, GUARD_BIN_MS = 10, 50
MOST_BOUTS = 3
"""Times as many bouts as would do, when the machine is too busy to say anything."""


def run(*, full: bool) -> Sequence[Result]:
    """Strike the server, then guards; the slowest stop is held to the bound."""
    wanted = EACH_IF_FULL if full else EACH
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder, EngineRig(Path(folder), lanes=LANES) as rig:
        rig.bout("close")  # starts the guards
        for death in ENGINE_DEATHS:
            trials = _trials(lambda death=death: rig.engine_bout(death), wanted, LANES)  # type: ignore[misc]
            results.append(_told(death, trials, wanted, BIN_MS))
    wanted = KILLED_IF_FULL if full else KILLED
    with (
        tempfile.TemporaryDirectory() as folder,
        EngineRig(Path(folder), lanes=GUARDED_LANES) as rig,
    ):
        rig.bout("close")
        trials = _trials(rig.guard_bout, wanted, GUARDED_LANES)
        results.append(_told("guard-killed", trials, wanted, GUARD_BIN_MS))
    return results


def _trials(bout: Callable[[], list[Trial]], wanted: int, lanes: int) -> list[Trial]:
    trials: list[Trial] = []
    for _ in range(MOST_BOUTS * wanted // lanes):
        trials += bout()
        if sum(not one.is_excused for one in trials) >= wanted:
            break
    return trials


def _told(death: str, trials: Sequence[Trial], wanted: int, bin_ms: float) -> Result:
    said = [one for one in trials if not one.is_excused]
    figures = {
        "figure": "motion_engine",
        "death": death,
        "trials": len(said),
        "broken": sum(not one.is_good for one in said),
        "faults": sorted({one.fault for one in said if one.fault}),
        "excused": len(trials) - len(said),
        **distribution([one.stop_ms for one in said], bin_ms),
    }
    tell(figures)
    is_whole = len(said) >= wanted and not any(one.fault for one in said)
    slowest = max((one.stop_ms for one in said), default=inf) if is_whole else inf
    bound_ms = trials[0].bound_ms
    return Result(
        name=f"motion stop after {death}: slowest of {len(said)} / {bound_ms:g} ms",
        ratio=round(slowest / bound_ms, 3),
        goal=1.0,
        baseline_ms=bound_ms,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(said),
    )
