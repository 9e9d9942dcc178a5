"""Time from the revocation of a right to the stop at the robot that its holder drives.

People, devices and programs drive real robots of the rig through a real ``urc serve``. Another
process ends their rights in the data folder, while their pages continue to send ticks.
"""

import tempfile
from collections.abc import Sequence
from math import inf
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.rig.deaths import Trial
from bench.rig.revocations import REVOCATIONS, REVOKED_BOUND_MS, RevocationRig

__all__ = ["run"]

EACH, EACH_IF_FULL = 40, 250
ROBOTS = 20
BIN_MS = 20
MOST_BOUTS = 3
"""Maximum number of rounds of trials on a busy machine, as a multiple of the required number."""


def run(*, full: bool) -> Sequence[Result]:
    """Revoke rights of every kind; compare the slowest stop with the limit."""
    wanted = EACH_IF_FULL if full else EACH
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        RevocationRig(Path(folder), robot_count=ROBOTS) as rig,
    ):
        rig.bout("person")  # starts the guards
        for kind in REVOCATIONS:
            trials: list[Trial] = []
            for _ in range(-(-MOST_BOUTS * wanted // ROBOTS)):
                trials += rig.bout(kind)
                if sum(not one.is_excused for one in trials) >= wanted:
                    break
            said = [one for one in trials if not one.is_excused]
            tell(
                {
                    "figure": "motion_revoked",
                    "revoked": kind,
                    "trials": len(said),
                    "broken": sum(not one.is_good for one in said),
                    "faults": sorted({one.fault for one in said if one.fault}),
                    "excused": len(trials) - len(said),
                    **distribution([one.stop_ms for one in said], BIN_MS),
                }
            )
            results.append(_result(kind, said, wanted))
    return results


def _result(kind: str, trials: Sequence[Trial], wanted: int) -> Result:
    """Return the slowest stop divided by the limit, or infinity after any other violation."""
    is_whole = len(trials) >= wanted and not any(one.fault for one in trials)
    slowest = max((one.stop_ms for one in trials), default=inf) if is_whole else inf
    return Result(
        name=f"motion stop after a revoked {kind}: slowest of {len(trials)} / 300 ms",
        ratio=round(slowest / REVOKED_BOUND_MS, 3),
        goal=1.0,
        baseline_ms=REVOKED_BOUND_MS,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(trials),
    )
