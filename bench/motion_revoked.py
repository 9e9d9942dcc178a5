"""Time from the revocation of a right until the holder's robot receives the stop.

People, devices and programs drive real robots in the rig through a real ``urc serve``. Another
process revokes their rights in the data folder, while their pages continue to send ticks.
"""

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from bench.harness import Result
from bench.kept import Kept
from bench.rig.revocations import REVOCATIONS, RevocationRig
from bench.trials import repeated, said

__all__ = ["run"]

EACH, EACH_IF_FULL = 40, 250
ROBOTS = 20
BIN_MS = 20


def run(*, full: bool) -> Sequence[Result]:
    """Revoke rights of every kind; compare the slowest stop with the limit."""
    wanted = EACH_IF_FULL if full else EACH
    kept = Kept(f"motion_revoked-{wanted}")
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        RevocationRig(Path(folder), robot_count=ROBOTS) as rig,
    ):
        rig.bout("person")  # starts the guards
        for kind in REVOCATIONS:
            trials = repeated(kind, partial(rig.bout, kind), wanted, ROBOTS, kept)
            results.append(said("motion_revoked", f"revoked {kind}", trials, wanted, BIN_MS))
    kept.end()
    return results
