"""Processor time that the server and its guards use for each driven robot.

Rounds with idle and with driven robots alternate; the difference is the processor time that driving
uses. Pages are open in all rounds. While a finger rests on a control, the page repeats the held
values 20 times a second. While a finger moves, the page sends new values in every frame of its
display.
"""

import statistics
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.motion_path import TimedPage
from bench.processes import cpu_s, spent_s
from bench.rig.operator_process import Plan
from bench.rig.programs import Robots, Server

__all__ = ["run"]

GOAL = 0.02
"""Largest allowed share of a processor per driven robot."""
ROBOTS = 6
FINGERS = {"at rest": 20, "moving": 60}
"""Ticks per second for each state of the finger, as in ``static/control/input.js``."""
LOOK_S, LOOK_IF_FULL_S = 4.0, 10.0
ROUNDS, ROUNDS_IF_FULL = 3, 9
SETTLE_S = 0.5
LEAST_LINES_HZ = 10
PROFILE = """\
urc: 1
kind: robot
name: cost{number}
title: Cost {number}
transports:
  wire:
    {{ type: tcp, host: 127.0.0.1, port: {port}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
commands:
  go:
    send: "M {{{{ value }}}}"
    args: {{ value: {{ type: integer, min: 0 }} }}
    hold: {{ repeat: 50ms, release: {{ value: 0 }}, watchdog: none }}
"""


def run(*, full: bool) -> Sequence[Result]:
    """Measure a resting and a moving finger; store the result of each round."""
    look_s, rounds = (LOOK_IF_FULL_S, ROUNDS_IF_FULL) if full else (LOOK_S, ROUNDS)
    kept = Kept("motion_cost-full" if full else "motion_cost")
    for _ in range(rounds - len(kept.rows)):
        kept.add({finger: _round(rate_hz, look_s) for finger, rate_hz in FINGERS.items()})
    rows = kept.end()
    return [_result(finger, [row[finger] for row in rows]) for finger in FINGERS]  # type: ignore[misc]


def _round(rate_hz: int, look_s: float) -> tuple[float, float]:
    """Return the server's and the guards' processor time per robot and second."""
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"] * ROBOTS))
        files = [Path(folder, f"cost{number}.yaml") for number in range(ROBOTS)]
        for number, file in enumerate(files):
            file.write_text(PROFILE.format(number=number, port=robots.ports[number]), "utf-8")
        server = stack.enter_context(Server(files, Path(folder, "data")))
        pages = [
            TimedPage(Plan(1, "127.0.0.1", server.port, file.stem, "", 0, key=server.key))
            for file in files
        ]
        for page in pages:
            stack.callback(page.socket.close)
            page.take_controls()
        idle = _spent(server, pages, 0, look_s)
        before = sum(map(len, robots.heard))
        driven = _spent(server, pages, rate_hz, look_s)
        came = sum(map(len, robots.heard)) - before
        if came < LEAST_LINES_HZ * look_s * ROBOTS:
            said = [page.refusal for page in pages]
            raise SystemExit(
                f"bench: {came} lines reached the robots; output of the server: {said}"
            )
    return tuple((late - early) / look_s / ROBOTS for early, late in zip(idle, driven, strict=True))  # type: ignore[return-value]


def _spent(
    server: Server, pages: Sequence[TimedPage], rate_hz: int, look_s: float
) -> tuple[float, float]:
    """Return the server's and the guards' processor time, with or without ticks from all pages."""
    _drive(pages, rate_hz, SETTLE_S)
    before = cpu_s([server.pid]), cpu_s(server.guards)
    _drive(pages, rate_hz, look_s)
    after = cpu_s([server.pid]), cpu_s(server.guards)
    return spent_s(before[0], after[0]), spent_s(before[1], after[1])


def _drive(pages: Sequence[TimedPage], rate_hz: int, seconds: float) -> None:
    """Send `rate_hz` staggered ticks a second from each page; if `rate_hz` is 0, only receive."""
    step_ns = int(1e9 / (rate_hz or FINGERS["at rest"]) / len(pages))
    next_ns = time.monotonic_ns()
    end_ns = next_ns + int(seconds * 1e9)
    number = 0
    while next_ns < end_ns:
        page = pages[number % len(pages)]
        page.wait(next_ns)
        if rate_hz:
            page.tick_number(number if rate_hz > FINGERS["at rest"] else 1)
        else:
            page.hear()
        number += 1
        next_ns += step_ns


def _result(finger: str, rows: Sequence[tuple[float, float]]) -> Result:
    shares = [server + guard for server, guard in rows]
    server, guard = (statistics.median(column) for column in zip(*rows, strict=True))
    tell(
        {
            "figure": "motion_cost",
            "finger": finger,
            "ticks_hz": FINGERS[finger],
            "server_core": round(server, 4),
            "guard_core": round(guard, 4),
        }
    )
    middle = statistics.median(shares)
    return Result(
        name=f"a driven robot, finger {finger}: processor time / {GOAL:.0%} of a processor",
        ratio=round(middle / GOAL, 3),
        goal=1.0,
        baseline_ms=GOAL * 1000,
        subject_ms=round(middle * 1000, 2),
        spread=round(max(shares) / middle, 2),
        rounds=len(shares),
    )
