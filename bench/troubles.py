"""Data that a driven robot received after its real server was frozen or killed.

Signals either freeze the server for 5 s, or kill it. A new server starts 1 s after a kill.
Several robots are driven in parallel, each with its own server, session and guard. An interrupted
run can be resumed.
"""

import asyncio
import json
from collections.abc import Mapping, Sequence
from math import inf

from bench.figures import distribution, tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.freeze import HEARD_MS, Freeze, freeze

__all__ = ["trouble"]

TRIALS, TRIALS_IF_FULL = 2, 200
ROBOTS = 2
BIN_MS = 10


def trouble(via: str, *, full: bool) -> Sequence[Result]:
    """Freeze and kill servers until enough trials of each kind are valid.

    Args:
        via: kind of server, as for `freeze`.
        full: whether to make as many trials as the goal requires.
    """
    wanted = TRIALS_IF_FULL if full else TRIALS
    return [_measured(via, "freeze", wanted), _measured(via, "kill", wanted)]


def _measured(via: str, trouble: str, wanted: int) -> Result:
    kept = Kept(f"motion_{via}-{trouble}-{wanted}")
    while (left := wanted - len(_counted(kept.rows))) > 0:
        if len(kept.rows) >= 2 * wanted:
            break  # the machine is too busy
        at_once = min(ROBOTS, left)
        asyncio.run(
            freeze(
                -(-left // at_once),
                robot_count=at_once,
                lasts_s=5.0 if trouble == "freeze" else 1.0,
                seed=len(kept.rows),
                via=via,
                is_killed=trouble == "kill",
                told=lambda one: kept.add({**one._asdict(), "excused": one.is_excused}),
            )
        )
    return _told(via, trouble, kept.end(), wanted)


def _counted(rows: Sequence[Mapping[str, object]]) -> list[Freeze]:
    return [
        Freeze(**{name: row[name] for name in Freeze._fields})  # type: ignore[arg-type]
        for row in rows
        if not row["excused"]
    ]


def _told(via: str, trouble: str, rows: Sequence[Mapping[str, object]], wanted: int) -> Result:
    said = _counted(rows)
    bad = [one for one in said if not one.is_good]
    stop = max((one.stop_ms for one in said), default=inf)
    newest = max((one.newest_ms for one in said), default=inf)
    limit = said[0].limit_ms if said else inf
    tell(
        {
            "figure": f"motion_{via}_{trouble}",
            "trials": len(said),
            "broken": len(bad),
            "excused": len(rows) - len(said),
            "newest_motion_ms": round(newest),
            **distribution([one.stop_ms for one in said], BIN_MS),
        }
    )
    for one in bad:
        print(json.dumps({"broken": f"motion_{via}_{trouble}", **one._asdict()}), flush=True)
    worst = max(newest / HEARD_MS, stop / limit) if len(said) >= wanted and not bad else inf
    return Result(
        name=f"motion_{via}: {len(said)} trials of “{trouble}” on the server: worst / limit",
        ratio=round(worst, 3),
        goal=1.0,
        baseline_ms=limit,
        subject_ms=round(stop, 1),
        spread=1.0,
        rounds=len(said),
    )
