"""Effect of slow pages on the other pages, if two of twenty pages read nothing.

A third page reads only a quarter of its data. The baseline is a server with an unbounded queue for
each page. In the baseline, the slow page's data ages as its queue grows.
"""

import asyncio
import json
import os
import statistics
import sys
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from bench.harness import Result
from bench.watching import serving
from urc.model.values import Sample, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, Robot, build_app

__all__ = ["run"]

CHANNELS, RATE_HZ = 600, 50
HEALTHY, STOPPED = 17, 2
SLOW_SHARE = 0.25
FRAME_BYTES = 7000
"""Approximate size of a frame with all channels, in bytes."""
LOOK_S, LOOK_IF_FULL_S = 15.0, 30.0
WARM_S = 3.0
MISSED_GOAL, GROWTH_MB, AGE_GOAL = 0.01, 2.0, 0.06
READY_S = 20.0


class Look(NamedTuple):
    """Measurements of one run."""

    ticks: int
    healthy: int
    """Number of frames received by the healthy page that received the fewest."""
    age_ms: float
    """Age of the slow page's data in the last quarter of the run, in milliseconds."""
    growth_mb: float
    """Growth of the server's memory since its start, in MB."""


class Naive:
    """The baseline server, with an unbounded queue for each page."""

    def __init__(self) -> None:
        self.queues: set[asyncio.Queue[str]] = set()
        self.app: ASGIApp = Starlette(routes=[WebSocketRoute("/ws", self.page)])

    async def page(self, line: WebSocket) -> None:
        """Send the values in the page's queue."""
        queue: asyncio.Queue[str] = asyncio.Queue()
        await line.accept()
        self.queues.add(queue)
        try:
            while text := await queue.get():
                await line.send_text(text)
        except (WebSocketDisconnect, RuntimeError):
            return  # the page has closed or was cut off
        finally:
            self.queues.discard(queue)

    def tick(self, number: int) -> None:
        """Queue all values for every page."""
        values = {
            "t": "v",
            "n": round(time.monotonic() * 1000),
            "i": [*range(CHANNELS)],
            "v": [number + 0.25] * CHANNELS,
            "a": [0] * CHANNELS,
        }
        text = json.dumps(values, separators=(",", ":"))
        for queue in self.queues:
            queue.put_nowait(text)

    def end(self) -> None:
        """Disconnect all pages."""
        for queue in self.queues:
            queue.put_nowait("")


def run(*, full: bool) -> Sequence[Result]:
    """Compare the age of the slow page's data with the age in the baseline."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    ours = asyncio.run(_urc(seconds))
    naive = Naive()
    base = asyncio.run(_look(naive.app, "/ws", naive.tick, seconds, naive.end))
    told = {"URC": ours._asdict(), "unbounded queue": base._asdict()}
    print(json.dumps({"fanout_stall": told}), flush=True)
    missed = max(0.0, 1 - ours.healthy / ours.ticks)
    found = [
        _result("frames that a healthy page missed", missed, MISSED_GOAL, ours.ticks, ours.healthy),
        _result(
            "age of the slow page's data / age with an unbounded queue",
            ours.age_ms / base.age_ms,
            AGE_GOAL,
            base.age_ms,
            ours.age_ms,
        ),
    ]
    if STATM.is_file():
        growth = ours.growth_mb / GROWTH_MB
        found.insert(1, _result(f"growth / {GROWTH_MB:g} MB", growth, 1.0, 0, 0))
    return found


def _result(name: str, ratio: float, goal: float, base: float, subject: float) -> Result:
    title = f"{HEALTHY + STOPPED + 1} pages, 3 of them too slow: {name}"
    return Result(title, round(ratio, 3), goal, round(base, 1), round(subject, 1), 1.0, 1)


async def _urc(seconds: float) -> Look:
    signals = {f"s{place}": Signal(f"s{place}") for place in range(CHANNELS)}
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[]))
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)}, DashboardOptions(access=ACCESS)
    )

    def tick(number: int) -> None:
        now_s = robot.clock.now()
        robot.hub.publish([Sample(name, number + 0.25, now_s) for name in signals])

    return await _look(app, "/ws?robot=puppet", tick, seconds)


async def _look(
    app: ASGIApp,
    path: str,
    tick: Callable[[int], None],
    seconds: float,
    end: Callable[[], None] = lambda: None,
) -> Look:
    rate = str(int(FRAME_BYTES * RATE_HZ * SLOW_SHARE))
    async with serving(app) as port:
        command = (sys.executable, "-m", "bench.stalled", str(port), path)
        pages = await asyncio.create_subprocess_exec(
            *command,
            *(str(HEALTHY), str(STOPPED), rate),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            limit=1 << 24,
        )
        assert pages.stdin is not None
        assert pages.stdout is not None
        try:
            said = await asyncio.wait_for(pages.stdout.readline(), READY_S)
            if said.strip() != b"ready":
                raise SystemExit("bench: the pages did not connect")
            await asyncio.sleep(0.2)  # the first state of every page
            ticks, growth_mb = await _play(tick, seconds)
            pages.stdin.close()
            told = json.loads(await _in_time(pages.stdout.readline()))
        finally:
            if pages.returncode is None:
                pages.kill()
            await pages.wait()
            end()
    ages = [age for _, age in told["slow"]]
    if not ages:
        raise SystemExit("bench: the slow page read nothing")
    return Look(ticks, min(told["healthy"]), statistics.median(ages[-len(ages) // 4 :]), growth_mb)


async def _in_time(reading: Awaitable[bytes]) -> bytes:
    return await asyncio.wait_for(reading, READY_S)


async def _play(tick: Callable[[int], None], seconds: float) -> tuple[int, float]:
    """Send values; return the number of ticks and the growth of the server's memory."""
    began_s = time.monotonic()
    number, before = 0, 0.0
    while (passed_s := time.monotonic() - began_s) < seconds:
        tick(number)
        number += 1
        if not before and passed_s >= WARM_S:
            before = _memory_mb()
        await asyncio.sleep(max(0.0, began_s + number / RATE_HZ - time.monotonic()))
    await asyncio.sleep(0.2)  # the last frame
    return number, _memory_mb() - before


STATM = Path("/proc/self/statm")


def _memory_mb() -> float:
    with suppress(OSError):
        return int(STATM.read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return 0.0
