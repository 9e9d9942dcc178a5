"""Test frame counters that held motion over UDP shares with polls, a keepalive and another control.

Gestures of 5 to 60 s run in parallel. The receiving socket checks that counters increase without
gaps, and that the last frame is a stop. An interrupted run of the benchmark can be continued.
"""

import asyncio
import json
import random
from collections.abc import Mapping, Sequence

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.counters import gestures

__all__ = ["run"]

GESTURES, GESTURES_IF_FULL = 6, 100
ROBOTS, ROBOTS_IF_FULL = 3, 12
SHORTEST_S, LONGEST_S, LONGEST_IF_FULL_S = 5.0, 10.0, 60.0


def run(*, full: bool) -> Sequence[Result]:
    """Run gestures until the required number of valid gestures is reached."""
    wanted, robot_count = (GESTURES_IF_FULL, ROBOTS_IF_FULL) if full else (GESTURES, ROBOTS)
    longest_s = LONGEST_IF_FULL_S if full else LONGEST_S
    dice = random.Random(5)  # noqa: S311 - the same gestures in every run
    times = [round(dice.uniform(SHORTEST_S, longest_s), 1) for _ in range(wanted)]
    kept = Kept(f"motion_counters-{wanted}")
    for row in kept.rows:
        times.remove(float(str(row["lasted_s"])))
    asyncio.run(
        gestures(
            times,
            robot_count=robot_count,
            seed=len(kept.rows),
            told=lambda one: kept.add(one._asdict()),
        )
    )
    return _told(kept.end())


def _told(rows: Sequence[Mapping[str, object]]) -> Sequence[Result]:
    bad = [row for row in rows if row["fault"]]
    for row in bad:
        print(json.dumps({"broken": "motion_counters", **row}), flush=True)
    lasted = [float(str(row["lasted_s"])) for row in rows]
    frames = sum(int(str(row["frames"])) for row in rows)
    motions = sum(int(str(row["motions"])) for row in rows)
    tell(
        {
            "figure": "motion_counters",
            "gestures": len(rows),
            "shortest_s": min(lasted),
            "longest_s": max(lasted),
            "frames": frames,
            "of_motion": motions,
            "broken": len(bad),
        }
    )
    return [
        Result(
            name=f"motion with counters: gestures of {len(rows)} with a gap or without a stop",
            ratio=float(len(bad)),
            goal=0.0,
            baseline_ms=0.0,
            subject_ms=0.0,
            spread=1.0,
            rounds=len(rows),
        )
    ]
