"""Time until driven robots stop after the server hangs or dies.

The server is frozen or killed by a signal, or blocked by a backtracking pattern. The guards check
the leases, so the limit is the same as for a lost operator.
"""

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from bench.harness import Result
from bench.kept import Kept
from bench.rig.engine import ENGINE_DEATHS, EngineRig
from bench.trials import repeated, said

__all__ = ["run"]

ROBOTS = 20
EACH, EACH_IF_FULL = 40, 1000
BIN_MS = 10


def run(*, full: bool) -> Sequence[Result]:
    """Disturb the server; compare the slowest stop with the limit."""
    wanted = EACH_IF_FULL if full else EACH
    kept = Kept(f"motion_engine-{wanted}")
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        EngineRig(Path(folder), robot_count=ROBOTS) as rig,
    ):
        rig.bout("close")  # starts the guards
        for death in ENGINE_DEATHS:
            trials = repeated(death, partial(rig.engine_bout, death), wanted, ROBOTS, kept)
            results.append(said("motion_engine", death, trials, wanted, BIN_MS))
    kept.end()
    return results
