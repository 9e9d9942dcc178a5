"""Data that a driven robot's program receives after it was frozen for 5 s.

SIGSTOP and SIGCONT freeze and resume a substitute for rosbridge, while the kernel continues to
accept data for it. Several robots are driven in parallel, each with its own program, session and
guard. An interrupted run can continue.
"""

import asyncio
import json
from collections.abc import Mapping, Sequence
from math import inf

from bench.figures import distribution, tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.freeze import HEARD_MS, STOP_MS, Freeze, freeze

__all__ = ["run"]

TRIALS, TRIALS_IF_FULL = 4, 100
ROBOTS, ROBOTS_IF_FULL = 2, 10
BIN_MS = 10


def run(*, full: bool) -> Sequence[Result]:
    """Freeze programs until enough trials are valid."""
    wanted, robot_count = (TRIALS_IF_FULL, ROBOTS_IF_FULL) if full else (TRIALS, ROBOTS)
    kept = Kept(f"motion_freeze-{wanted}")
    while (left := wanted - len(_counted(kept.rows))) > 0:
        if len(kept.rows) >= 2 * wanted:
            break  # the machine is too busy
        at_once = min(robot_count, left)
        rounds = -(-left // at_once)
        asyncio.run(
            freeze(
                rounds,
                robot_count=at_once,
                seed=len(kept.rows),
                told=lambda one: kept.add({**one._asdict(), "excused": one.is_excused}),
            )
        )
    return _told(kept.end(), wanted)


def _counted(rows: Sequence[Mapping[str, object]]) -> list[Freeze]:
    return [
        Freeze(**{name: row[name] for name in Freeze._fields})  # type: ignore[arg-type]
        for row in rows
        if not row["excused"]
    ]


def _told(rows: Sequence[Mapping[str, object]], wanted: int) -> Sequence[Result]:
    said = _counted(rows)
    bad = [one for one in said if not one.is_good]
    newest = max((one.newest_ms for one in said), default=inf)
    stop = max((one.stop_ms for one in said), default=inf)
    tell(
        {
            "figure": "motion_freeze",
            "trials": len(said),
            "broken": len(bad),
            "excused": len(rows) - len(said),
            "newest_motion_ms": round(newest),
            **distribution([one.stop_ms for one in said], BIN_MS),
        }
    )
    for one in bad:
        print(json.dumps({"broken": "motion_freeze", **one._asdict()}), flush=True)
    worst = max(newest / HEARD_MS, stop / STOP_MS) if len(said) >= wanted and not bad else inf
    return [
        Result(
            name=f"motion after {len(said)} freezes of the robot's program: worst / limit",
            ratio=round(worst, 3),
            goal=1.0,
            baseline_ms=STOP_MS,
            subject_ms=round(stop, 1),
            spread=1.0,
            rounds=len(said),
        )
    ]
