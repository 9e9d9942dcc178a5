"""Time from the loss of an operator to the stop at the robot, for each kind of loss.

Pages, `urc serve` with its guards, and robots that timestamp received data are real processes. Each
time is measured from the last effective tick to the first byte of the stop. With root, a relay
between network namespaces adds two failures of the link. Without root, these failures are skipped
with a message.
"""

import json
import tempfile
from collections.abc import Sequence
from math import inf
from pathlib import Path

from bench.figures import distribution, tell
from bench.harness import Result
from bench.rig.deaths import BOUND_MS, DEATHS, LINK_DEATHS, Rig, Trial
from bench.rig.programs import can_relay

__all__ = ["run"]

EACH, EACH_IF_FULL = 100, 1000
ROBOTS = 20
BIN_MS = 10
MOST_BOUTS = 3
"""Maximum number of rounds of trials on a busy machine, as a multiple of the required number."""


def run(*, full: bool) -> Sequence[Result]:
    """Let pages vanish in every way; compare the slowest stop with the limit."""
    wanted = EACH_IF_FULL if full else EACH
    results: list[Result] = []
    has_relay = can_relay()
    with (
        tempfile.TemporaryDirectory() as folder,
        Rig(Path(folder), robot_count=ROBOTS, has_relay=has_relay) as rig,
    ):
        rig.bout("close")  # starts the guards
        for death in DEATHS:
            if death in LINK_DEATHS and not has_relay:
                print(json.dumps({"left_out": f"motion_stop {death}: needs root and /dev/net/tun"}))
                continue
            trials = _trials(rig, death, wanted)
            said = [one for one in trials if not one.is_excused]
            tell(_figures(death, said, len(trials) - len(said)))
            results.append(_result(death, said, wanted))
    return results


def _trials(rig: Rig, death: str, wanted: int) -> list[Trial]:
    trials: list[Trial] = []
    for _ in range(-(-MOST_BOUTS * wanted // ROBOTS)):
        trials += rig.bout(death)
        if sum(not one.is_excused for one in trials) >= wanted:
            break
    return trials


def _figures(death: str, trials: Sequence[Trial], excused: int) -> dict[str, object]:
    return {
        "figure": "motion_stop",
        "death": death,
        "trials": len(trials),
        "broken": sum(not one.is_good for one in trials),
        "faults": sorted({one.fault for one in trials if one.fault}),
        "excused": excused,
        **distribution([one.stop_ms for one in trials], BIN_MS),
    }


def _result(death: str, trials: Sequence[Trial], wanted: int) -> Result:
    """Return the slowest stop divided by the limit, or infinity after any other violation."""
    is_whole = len(trials) >= wanted and not any(one.fault for one in trials)
    slowest = max((one.stop_ms for one in trials), default=inf) if is_whole else inf
    return Result(
        name=f"motion stop after {death}: slowest of {len(trials)} / lease + 50 ms",
        ratio=round(slowest / BOUND_MS, 3),
        goal=1.0,
        baseline_ms=BOUND_MS,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(trials),
    )
