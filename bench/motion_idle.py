"""Data that reaches stopped robots, measured on all kinds of transport in parallel.

Each robot is driven once and released. The robot's page stays in control and continues to receive
heartbeats. After the stop and its repetitions, no byte may arrive, because zero-speed commands
would disturb another controller of the robot. Real programs communicate over a relay between two
network namespaces. Without root and /dev/net/tun, the benchmark is skipped with a message.
"""

import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from bench.figures import tell
from bench.harness import Result
from bench.rig.cuts import CutRig
from bench.rig.kinds import KINDS
from bench.rig.programs import can_relay
from urc.motion.hold_to_run import STOP_FOR_S

__all__ = ["run"]

LASTS_S, LASTS_IF_FULL_S = 20.0, 600.0
SETTLED_S = STOP_FOR_S + 0.5
"""Longest time from the first stop to its last repetition, even over a broker, in seconds."""
SPARE_S = 120.0


def run(*, full: bool) -> Sequence[Result]:
    """Count the frames that arrive after the stop and its repetitions."""
    if not can_relay():
        print(json.dumps({"left_out": "motion_idle: needs root and /dev/net/tun"}))
        return []
    lasts_s = LASTS_IF_FULL_S if full else LASTS_S
    with tempfile.TemporaryDirectory() as folder, CutRig(Path(folder), KINDS) as rig:
        for index in rig.indexes:
            rig.drive_once(index, lasts_s + SPARE_S)
        time.sleep(SETTLED_S)
        from_ns = time.monotonic_ns()
        time.sleep(lasts_s)
        return [_told(rig, index, from_ns) for index in rig.indexes]


def _told(rig: CutRig, index: int, from_ns: int) -> Result:
    kind, texts = rig.kinds[index], [one.text for one in rig.robots.since(index, from_ns)]
    seconds = (time.monotonic_ns() - from_ns) / 1e9
    figures = {"line": kind, "seconds": round(seconds), "motions": _motions(texts)}
    tell({"figure": "motion_idle", **figures, "stops": len(texts) - _motions(texts)})
    return Result(
        name=f"motion: frames to a robot at rest over {kind} in {seconds:.0f} s",
        ratio=float(len(texts)),
        goal=0.0,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=1.0,
        rounds=1,
    )


def _motions(texts: Sequence[str]) -> int:
    return sum(text != "M 0" for text in texts)
