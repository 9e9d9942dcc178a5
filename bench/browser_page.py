"""Measurements of a page in a real Chromium: value ages, frames and processor time.

All ages are measured with the machine's monotonic clock. Robots send this clock's time
(``peers/robot.py``), and the browser reports the page's start time on the same clock.
"""

import asyncio
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from playwright.async_api import Browser, CDPSession, Page

from bench.harness import Result
from bench.rig.programs import Server
from tests.e2e.browser import running_browser

__all__ = [
    "HERE",
    "Cost",
    "Opened",
    "at_share",
    "cost_of",
    "kept",
    "opened",
    "running_browser",
    "served",
]

HERE = Path(__file__).resolve().parent
LEAST_FPS = 50
SIZE = (1920, 1200)
LOAD_MS = 30_000
WARM_S = 1.0
TRANSPORT = """\
urc: 1
kind: robot
name: bench
transports:
  wire:
    {{ type: tcp, host: 127.0.0.1, port: {port}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
"""
# A page that is opened twice already has a counter; a second counter would count each frame again.
COUNT = """
() => {
  if (window.benchFrames !== undefined) return;
  window.benchFrames = 0;
  const frame = () => { window.benchFrames += 1; requestAnimationFrame(frame); };
  requestAnimationFrame(frame);
}
"""


@dataclass(frozen=True, slots=True)
class Opened:
    """An open page, with a debugging connection to its browser."""

    page: Page
    line: CDPSession
    origin_ms: float
    """Start time of the page on the monotonic clock, in milliseconds."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Frame rate and processor time of a page."""

    fps: float
    frame_ms: float
    """Processor time of the main thread per frame, in milliseconds."""


@contextmanager
def served(robot_port: int, document: str, work: Path) -> Iterator[str]:
    """Run a real ``urc serve`` for a robot; yield the address of its page.

    Args:
        robot_port: the robot's port.
        document: the profile's text, without its name and transport.
        work: working folder of the server.
    """
    file = work / "bench.yaml"
    file.write_text(TRANSPORT.format(port=robot_port) + document, "utf-8")
    with Server([file], work / "data") as server:
        yield f"http://127.0.0.1:{server.port}/robots/bench/?key={server.key}"


@asynccontextmanager
async def opened(browser: Browser, address: str, *, script: str = "") -> AsyncIterator[Opened]:
    """Open a page in a new context; `script` runs before the page's scripts."""
    context = await browser.new_context(
        locale="en-GB", viewport={"width": SIZE[0], "height": SIZE[1]}
    )
    try:
        if script:
            await context.add_init_script(script)
        url, _, key = address.partition("?key=")
        if key:
            await context.request.get(address)  # submits the key
        page = await context.new_page()
        page.set_default_timeout(LOAD_MS)
        await page.goto(url)
        line = await context.new_cdp_session(page)
        await line.send("Performance.enable", {"timeDomain": "threadTicks"})
        found = await _metrics(line)
        yield Opened(page, line, found["NavigationStart"] * 1000)
    finally:
        await context.close()


async def cost_of(one: Opened, seconds: float, *, slowed: int = 1) -> Cost:
    """Measure the frame rate and processor time of a running page.

    The processor time hardly depends on the load that other programs cause.

    Args:
        one: a page that already shows values.
        seconds: duration of the measurement.
        slowed: factor by which the browser slows the page's processor.
    """
    page, line = one.page, one.line
    await page.evaluate(COUNT)
    await line.send("Emulation.setCPUThrottlingRate", {"rate": slowed})
    await asyncio.sleep(WARM_S)
    before = await _look(one)
    await asyncio.sleep(seconds)
    after = await _look(one)
    await line.send("Emulation.setCPUThrottlingRate", {"rate": 1})
    frames = max(1.0, after["frames"] - before["frames"])
    spent_ms = (after["TaskDuration"] - before["TaskDuration"]) * 1000
    passed_s = (after["now"] - before["now"]) / 1000
    return Cost(frames / passed_s, spent_ms / frames)


async def _look(one: Opened) -> dict[str, float]:
    found = await _metrics(one.line)
    frames, now = await one.page.evaluate("() => [window.benchFrames, performance.now()]")
    return {**found, "frames": frames, "now": now}


async def _metrics(line: CDPSession) -> dict[str, float]:
    answer = await line.send("Performance.getMetrics")
    return {each["name"]: float(each["value"]) for each in answer["metrics"]}


def kept(name: str, costs: Sequence[Cost], *, of: Mapping[str, str] | None = None) -> Result:
    """Return the median time between frames, divided by the longest allowed time."""
    periods = sorted(1000 / cost.fps for cost in costs)
    most = 1000 / LEAST_FPS
    middle = periods[len(periods) // 2]
    return Result(
        name=f"{name}: time between frames / 1/{LEAST_FPS} s",
        ratio=round(middle / most, 3),
        goal=1.0,
        baseline_ms=round(most, 2),
        subject_ms=round(middle, 2),
        spread=round(periods[-1] / middle, 2),
        rounds=len(periods),
        versions=of or {},
    )


def at_share(ordered: Sequence[float], share: float) -> float:
    """Return the value below which the given share of the sorted values lies."""
    return round(ordered[min(len(ordered) - 1, int(len(ordered) * share))], 3)
