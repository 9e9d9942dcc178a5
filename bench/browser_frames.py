"""Frame rate of every shipped robot's page in WebKit without a graphics processor.

Without a graphics processor, Mesa composes the page in software, so layers and large repaints lower
the frame rate. Before each robot's page, an empty page is measured; its frame rate shows how busy
the machine is. A page that misses the goal is measured again, because another program may have
slowed the page.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.figures import tell
from bench.harness import Result
from tests.e2e.browsers.demo import ROBOTS, Demo, demo_in
from tests.e2e.browsers.webkit import webkit_window
from tests.e2e.browsers.window import Window

__all__ = ["run"]

LEAST_FPS = 30
SIZE = (1180, 820)
WITH_PICTURES = ("absolem", "turtlebot4")
ROUNDS = 3
SETTLE_S = 2.0
EMPTY_MS = 1000
PAGE_MS = 3000
RATE = """new Promise((done) => {
  let frames = 0;
  const from = performance.now();
  const frame = () => {
    frames += 1;
    const passed = performance.now() - from;
    if (passed < FOR_MS) requestAnimationFrame(frame);
    else done((1000 * frames) / passed);
  };
  requestAnimationFrame(frame);
})"""


@dataclass(frozen=True, slots=True)
class Rates:
    """Frames per second of an empty page, then of a robot's page."""

    empty: float
    page: float


def run(*, full: bool) -> Sequence[Result]:
    """Measure the pages of all robots; without `full`, only pages with large pictures."""
    robots = ROBOTS if full else WITH_PICTURES
    with (
        webkit_window() as window,
        tempfile.TemporaryDirectory(prefix="urc-bench-") as folder,
        demo_in(window, Path(folder)) as demo,
    ):
        window.resize(*SIZE)
        return [_told(window.version, robot, _rates(demo, robot)) for robot in robots]


def _rates(demo: Demo, robot: str) -> list[Rates]:
    found: list[Rates] = []
    while len(found) < ROUNDS:
        demo.open_empty()
        empty = _rate(demo.window, EMPTY_MS)
        demo.open(robot)
        time.sleep(SETTLE_S)
        found.append(Rates(empty, _rate(demo.window, PAGE_MS)))
        if found[-1].page >= LEAST_FPS:
            break
    return found


def _rate(window: Window, for_ms: int) -> float:
    return float(window.evaluate(RATE.replace("FOR_MS", str(for_ms))))


def _told(version: str, robot: str, rates: Sequence[Rates]) -> Result:
    best = max(rates, key=lambda one: one.page)
    figures = {
        "robot": robot,
        "page_hz": round(best.page, 1),
        "empty page_hz": round(best.empty, 1),
    }
    tell({"figure": "browser_frames", **figures, "to empty": round(best.page / best.empty, 2)})
    most_ms = 1000 / LEAST_FPS
    return Result(
        name=f"WebKit, {robot}: time between frames / {LEAST_FPS} a second",
        ratio=round(LEAST_FPS / best.page, 3),
        goal=1.0,
        baseline_ms=round(most_ms, 2),
        subject_ms=round(1000 / best.page, 2),
        spread=round(best.page / min(one.page for one in rates), 2),
        rounds=len(rates),
        versions={"WebKitGTK": version},
    )
