"""Two hundred values to many pages: URC beside a bare loop in C, and beside a message a value.

What counts is the processor time of the server for the same news, the making of the readings and
their encoding included; the pages are another process, and so is the robot that wakes the server.
The loop in C writes as many bytes to as many pages, and knows no value and no WebSocket.
"""

import asyncio
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from itertools import repeat
from pathlib import Path

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket

from bench.harness import Goal, Result, compare
from bench.watching import cost_s, speaking
from urc._loop import run as run_loop
from urc.model.values import Sample, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS
from urc.web.app import Robot, build_app

__all__ = ["run"]

CHANNELS = 200
RATE_HZ = 50
TICKS, TICKS_IF_FULL = 50, 150
ROUNDS, ROUNDS_IF_FULL = 5, 9
MANY, FEW = 50, 10
LOOP_GOAL, SINGLE_GOAL = 2.5, 0.05
FAN_S = 60

# As cheap as a reading can be: what drivers spend on them, other benchmarks say.
_sample = partial(tuple.__new__, Sample)


def run(*, full: bool) -> Sequence[Result]:
    """Compare at 50 pages with the loop, at 10 with single messages."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    single = compare(
        Goal(f"fan-out to {FEW} pages / a message a value", SINGLE_GOAL),
        lambda: run_loop(_single(FEW, ticks // 5)),
        lambda: run_loop(_urc(FEW, ticks // 5))[0],
        rounds=rounds,
    )
    compiler = shutil.which("cc")
    if compiler is None:
        return [single]
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        fan = Path(folder) / "fan"
        source = Path(__file__).parent / "fan.c"
        subprocess.run([compiler, "-O2", "-o", str(fan), str(source)], check=True, timeout=FAN_S)
        _, size = run_loop(_urc(MANY, ticks))
        loop = compare(
            Goal(f"fan-out to {MANY} pages / a bare loop in C", LOOP_GOAL),
            lambda: _loop(fan, MANY, size, ticks),
            lambda: run_loop(_urc(MANY, ticks))[0],
            rounds=rounds,
        )
    return [loop, single]


async def _urc(clients: int, ticks: int) -> tuple[float, int]:
    """Return the processor time, and how many bytes a page got a tick."""
    signals = {f"s{place}": Signal(f"s{place}") for place in range(CHANNELS)}
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[]))
    app = build_app({"puppet": Robot(robot.profile, {}, robot.open)}, access=ACCESS)

    def tell(tick: int) -> None:
        now_s = robot.clock.now()
        readings = zip(signals, repeat(tick + 0.25), repeat(now_s), repeat(""))
        robot.hub.put(tuple(map(_sample, readings)))

    async with speaking(ticks, RATE_HZ) as line:
        path = "/ws?robot=puppet"
        spent_s, tally = await cost_s(app, path, clients, [], lambda: line.heard(tell))
    if min(messages for messages, _ in tally) < ticks * 0.9:
        raise SystemExit("bench: the machine was too busy for every frame")
    return spent_s, tally[0][1] // ticks


async def _single(clients: int, ticks: int) -> float:
    """Send every value to every page by itself."""
    pages: set[WebSocket] = set()
    over = asyncio.Event()

    async def page(line: WebSocket) -> None:
        await line.accept()
        pages.add(line)
        await over.wait()

    async def play() -> None:
        for tick in range(ticks):
            for place in range(CHANNELS):
                text = json.dumps({"signal": f"s{place}", "value": tick + 0.25})
                for line in pages:
                    await line.send_text(text)
            await asyncio.sleep(1 / RATE_HZ)
        over.set()

    app = Starlette(routes=[WebSocketRoute("/ws", page)])
    return (await cost_s(app, "/ws", clients, [], play))[0]


def _loop(fan: Path, clients: int, size: int, ticks: int) -> float:
    """Run the loop in C; return its processor time."""
    words = [str(fan), str(clients), str(size), str(ticks), str(RATE_HZ)]
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
