"""Data that a driven robot receives after its program or server is frozen or killed.

Signals either freeze the program for 5 s, or kill it. A new program starts 1 s after a kill.
Several robots are driven in parallel, each with its own program, session and guard. An interrupted
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

__all__ = ["measured", "trouble"]

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
    results = []
    for kind in ("freeze", "kill"):
        title = f"motion_{via}: {{}} trials of “{kind}” on the server"
        figure = f"motion_{via}_{kind}"
        results.append(measured(figure, title, wanted, via=via, is_killed=kind == "kill"))
    return results


def measured(
    figure: str,
    title: str,
    wanted: int,
    *,
    via: str = "rosbridge",
    is_killed: bool = False,
    robot_count: int = ROBOTS,
) -> Result:
    """Freeze or kill programs until enough trials are valid, and compare the data with the limits.

    Args:
        figure: name of the figure.
        title: title of the result, with a placeholder for the number of valid trials.
        wanted: number of valid trials.
        via: kind of program, as for `freeze`.
        is_killed: whether to kill the program instead of freezing it.
        robot_count: number of robots that are driven in parallel.
    """
    kept = Kept(f"{figure}-{wanted}")
    while (left := wanted - len(_counted(kept.rows))) > 0:
        if len(kept.rows) >= 2 * wanted:
            break  # the machine is too busy
        at_once = min(robot_count, left)
        asyncio.run(
            freeze(
                -(-left // at_once),
                robot_count=at_once,
                lasts_s=1.0 if is_killed else 5.0,
                seed=len(kept.rows),
                via=via,
                is_killed=is_killed,
                told=lambda one: kept.add({**one._asdict(), "excused": one.is_excused}),
            )
        )
    return _told(figure, title, kept.end(), wanted)


def _counted(rows: Sequence[Mapping[str, object]]) -> list[Freeze]:
    return [
        Freeze(**{name: row[name] for name in Freeze._fields})  # type: ignore[arg-type]
        for row in rows
        if not row["excused"]
    ]


def _told(figure: str, title: str, rows: Sequence[Mapping[str, object]], wanted: int) -> Result:
    said = _counted(rows)
    bad = [one for one in said if not one.is_good]
    stop = max((one.stop_ms for one in said), default=inf)
    newest = max((one.newest_ms for one in said), default=inf)
    limit = said[0].limit_ms if said else inf
    tell(
        {
            "figure": figure,
            "trials": len(said),
            "broken": len(bad),
            "excused": len(rows) - len(said),
            "newest_motion_ms": round(newest),
            **distribution([one.stop_ms for one in said], BIN_MS),
        }
    )
    for one in bad:
        print(json.dumps({"broken": figure, **one._asdict()}), flush=True)
    worst = max(newest / HEARD_MS, stop / limit) if len(said) >= wanted and not bad else inf
    return Result(
        name=f"{title.format(len(said))}: worst / limit",
        ratio=round(worst, 3),
        goal=1.0,
        baseline_ms=limit,
        subject_ms=round(stop, 1),
        spread=1.0,
        rounds=len(said),
    )
