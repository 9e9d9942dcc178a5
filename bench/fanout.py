"""Processor time for sending 200 values to 50 pages: URC compared with a plain loop of sends.

The measured processor time of the server includes reading the robot's data and encoding the values.
The pages and the robot run in other processes. The loop sends the same number of bytes to the same
number of pages, but does not handle values or WebSockets.
"""

import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from itertools import repeat

from bench.harness import Goal, Result, compare
from bench.watching import cost_s, speaking
from urc._event_loop import run as run_loop
from urc.model.values import Sample, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, Robot, build_app

__all__ = ["run"]

CHANNELS = 200
RATE_HZ = 50
TICKS, TICKS_IF_FULL = 50, 150
ROUNDS, ROUNDS_IF_FULL = 5, 9
CLIENTS = 50
GOAL = 2.5
FAN_S = 60

# This is the cheapest way to make a reading; other benchmarks measure the drivers.
_sample = partial(tuple.__new__, Sample)


def run(*, full: bool) -> Sequence[Result]:
    """Compare the processor time of URC's server with that of the plain loop."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    _, size = run_loop(_urc(CLIENTS, ticks))
    result = compare(
        Goal(f"fan-out to {CLIENTS} pages / a plain loop of sends", GOAL),
        lambda: _loop(CLIENTS, size, ticks),
        lambda: run_loop(_urc(CLIENTS, ticks))[0],
        rounds=rounds,
    )
    return [result]


async def _urc(clients: int, ticks: int) -> tuple[float, int]:
    """Return URC's processor time and the number of bytes per page and tick."""
    signals = {f"s{place}": Signal(f"s{place}") for place in range(CHANNELS)}
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[]))
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)}, DashboardOptions(access=ACCESS)
    )

    def tell(tick: int) -> None:
        now_s = robot.clock.now()
        readings = zip(signals, repeat(tick + 0.25), repeat(now_s), repeat(""))
        robot.hub.publish(tuple(map(_sample, readings)))

    async with speaking(ticks, RATE_HZ) as line:
        path = "/ws?robot=puppet"
        spent_s, sent_counters = await cost_s(app, path, clients, [], lambda: line.heard(tell))
    if min(messages for messages, _ in sent_counters) < ticks * 0.9:
        raise SystemExit("bench: the machine was too busy to send every frame")
    return spent_s, sent_counters[0][1] // ticks


def _loop(clients: int, size: int, ticks: int) -> float:
    """Run the plain loop; return its processor time."""
    words = [sys.executable, "-m", "bench.fan_plain"]
    words += map(str, (clients, size, ticks, RATE_HZ))
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as loop:
        assert loop.stdout is not None
        port = loop.stdout.readline().strip()
        command = [sys.executable, "-m", "bench.viewers", port, "/ws", str(clients)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as viewers:
            try:
                spent_s = float(loop.stdout.readline())
            finally:
                viewers.communicate(b"", timeout=FAN_S)
    return spent_s
