"""Unwanted stops of a robot on a link that loses packets.

Pages drive over a relay with a round-trip time of 100 ms and random loss in both directions. After
each stop, a page starts a new gesture. One run uses a single connection; the other run also uses
URC's second connection for lossy links. The benchmark needs root and /dev/net/tun; otherwise, it is
skipped with a message.
"""

import json
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from bench.figures import tell
from bench.harness import Result
from bench.rig.deaths import Rig
from bench.rig.programs import can_relay

__all__ = ["run"]

ROBOTS = 20
DELAY_MS = 50
LOOK_S = 0.25
CALM_S = 20.0
LATE_MS, LATE_WITHIN_NS = 50.0, 600_000_000
"""A stop is excused if the machine was delayed by more than `LATE_MS` within this time before
it."""
MOST = {0: None, 1: 0.1, 3: 4.0}
"""Largest allowed number of stops per minute, by packet loss in percent.

None means that there is no limit.
"""
LASTS_S, LASTS_IF_FULL_S = {0: 10, 1: 15, 3: 10}, {0: 60, 1: 180, 3: 60}
"""Duration of the run with all robots in parallel, in seconds, by packet loss in percent."""


def run(*, full: bool) -> Sequence[Result]:
    """Drive robots at each packet loss rate."""
    if not can_relay():
        print(json.dumps({"left_out": "motion_loss: needs root and /dev/net/tun"}))
        return []
    lasts_s = LASTS_IF_FULL_S if full else LASTS_S
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        Rig(Path(folder), robot_count=ROBOTS, has_relay=True) as rig,
    ):
        rig.bout("close")
        for loss, most in MOST.items():
            for lines in (1, 2):
                rig.weather(f"delay {DELAY_MS}", f"loss {loss}")
                minutes, stops, excused = _drive(rig, lasts_s[loss], has_spare=lines == 2)
                rig.weather("delay 0", "loss 0")
                _calm(rig)
                rate = stops / minutes
                figures = {"loss_percent": loss, "lines": lines, "minutes": round(minutes, 1)}
                counts = {"stops": stops, "excused": excused, "stops_a_minute": round(rate, 3)}
                tell({"figure": "motion_loss", **figures, **counts})
                if most is not None and lines == 2:
                    results.append(_result(loss, rate, most, stops))
    return results


def _calm(rig: Rig) -> None:
    """Wait until all robots have stopped, so that these stops do not count in the next run."""
    for index in rig.indexes:
        rig.robots.wait_until(partial(_is_still, rig, index), CALM_S, "a robot at rest")
    time.sleep(LOOK_S)


def _is_still(rig: Rig, index: int) -> bool:
    return rig.robots.heard[index][-1].text == "M 0"


def _drive(rig: Rig, seconds: float, *, has_spare: bool) -> tuple[float, int, int]:
    """Drive every robot; return the minutes of motion, the stops, and the excused stops.

    A stop is excused if the machine was delayed by more than `LATE_MS` just before the stop.
    """
    until_s = time.monotonic() + seconds
    pages = {index: rig.drive(index, has_spare=has_spare) for index in rig.indexes}
    began_ns = {index: time.monotonic_ns() for index in pages}
    moved_ns = stops = excused = 0
    while time.monotonic() < until_s:
        time.sleep(LOOK_S)
        for index, number in pages.items():
            heard = rig.robots.since(index, began_ns[index])
            if len(heard) > 1 and heard[-1].text == "M 0":
                at_ns = heard[-1].time_ns
                is_late = rig.late_ms(at_ns - LATE_WITHIN_NS, at_ns) > LATE_MS
                stops, excused = stops + (not is_late), excused + is_late
                moved_ns += heard[-1].time_ns - heard[0].time_ns
                rig.operators.kill(number)
                began_ns[index] = time.monotonic_ns()
                pages[index] = rig.drive(index, has_spare=has_spare)
    for index, number in pages.items():
        heard = rig.robots.since(index, began_ns[index])
        moved_ns += heard[-1].time_ns - heard[0].time_ns if heard else 0
        rig.operators.kill(number)
    return moved_ns / 60e9, stops, excused


def _result(loss: int, rate: float, most: float, stops: int) -> Result:
    return Result(
        name=f"motion: stops a minute at {loss} % loss and {2 * DELAY_MS} ms / limit",
        ratio=round(rate / most, 3),
        goal=1.0,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=1.0,
        rounds=stops,
    )
