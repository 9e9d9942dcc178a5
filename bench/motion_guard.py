"""Time until a driven robot stops after its guard is killed.

A new guard replaces the killed guard within half a second. The first frame that the new guard sends
is the stop.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from bench.harness import Result
from bench.kept import Kept
from bench.rig.engine import EngineRig
from bench.trials import repeated, said

__all__ = ["run"]

ROBOTS = 4
KILLED, KILLED_IF_FULL = 20, 200
BIN_MS = 50


def run(*, full: bool) -> Sequence[Result]:
    """Kill guards; compare the slowest stop with the limit."""
    wanted = KILLED_IF_FULL if full else KILLED
    kept = Kept(f"motion_guard-{wanted}")
    with (
        tempfile.TemporaryDirectory() as folder,
        EngineRig(Path(folder), robot_count=ROBOTS) as rig,
    ):
        rig.bout("close")
        trials = repeated("guard-killed", rig.guard_bout, wanted, ROBOTS, kept)
    kept.end()
    return [said("motion_guard", "guard-killed", trials, wanted, BIN_MS)]
