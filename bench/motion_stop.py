"""Time from the loss of an operator until the robot receives the stop, for each kind of loss.

Pages, `urc serve` with its guards, and robots that timestamp received data are real processes. Each
time is measured from the last effective tick to the first byte of the stop. With root access, a
relay between network namespaces adds two kinds of link failure. Without root access, these two
kinds are skipped with a message.
"""

import json
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from bench.harness import Result
from bench.kept import Kept
from bench.rig.deaths import DEATHS, LINK_DEATHS, Rig
from bench.rig.programs import can_relay
from bench.trials import repeated, said

__all__ = ["run"]

EACH, EACH_IF_FULL = 100, 1000
ROBOTS = 20
BIN_MS = 10


def run(*, full: bool) -> Sequence[Result]:
    """Make pages vanish in every way; compare the slowest stop with the limit."""
    wanted = EACH_IF_FULL if full else EACH
    kept = Kept(f"motion_stop-{wanted}")
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
            trials = repeated(death, partial(rig.bout, death), wanted, ROBOTS, kept)
            results.append(said("motion_stop", death, trials, wanted, BIN_MS))
    kept.end()
    return results
