"""A fleet whose parts are killed at random for ten minutes: one driver, and no lost STOP.

Two pages at changing sites want to drive a robot; some take the controls by force. Servers, guards
and pages are killed with SIGKILL. STOP is pressed at any site, and some pages reset it. The robot's
log must show one driver at a time, and no motion between a confirmed STOP and its reset. An
interrupted run can be resumed.
"""

import json
import tempfile
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Final

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.engine import OPEN_MS, RESTART_MS
from bench.rig.fleet_soak import SoakPiece, SoakRig
from tests.e2e.ports import free_pair

__all__ = ["run"]

PIECE_S: Final = 30.0
PIECES, PIECES_IF_FULL = 2, 20


def run(*, full: bool) -> Sequence[Result]:
    """Run the pieces, and count their violations."""
    wanted = PIECES_IF_FULL if full else PIECES
    kept = Kept(f"fleet_soak-{wanted}")
    pieces = [SoakPiece.of(row) for row in kept.rows]
    if len(pieces) < wanted:
        with tempfile.TemporaryDirectory() as folder, SoakRig(Path(folder), free_pair()) as rig:
            while len(pieces) < wanted:
                pieces.append(rig.piece(len(pieces), PIECE_S))
                kept.add(pieces[-1]._asdict())
    kept.end()
    for one in pieces:
        if one.fault:
            print(json.dumps({"broken": "fleet_soak", **one._asdict()}), flush=True)
    names = ("kills", "stops", "resets", "drivers", "values")
    totals = {name: sum(getattr(one, name) for one in pieces) for name in names}
    faults = sum(bool(one.fault) for one in pieces)
    tell(
        {
            "figure": "fleet_soak",
            "lasted_s": round(sum(one.lasted_s for one in pieces)),
            **totals,
            "broken": faults,
            "stop_max_ms": max(one.stop_ms for one in pieces),
        }
    )
    limit_ms = RESTART_MS + OPEN_MS
    is_whole = all(totals.values())
    return [
        Result(
            name=f"pieces of a fleet's soak with a fault, of {len(pieces)} / limit",
            ratio=1.0 + faults if is_whole else inf,
            goal=1.0,
            baseline_ms=limit_ms,
            subject_ms=max(one.stop_ms for one in pieces),
            spread=1.0,
            rounds=len(pieces),
        )
    ]
