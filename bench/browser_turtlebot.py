"""A browser's processor time: the gallery's TurtleBot page compared with two plain pages.

The emulated robot sends its camera images, map, laser scans and battery state over rosbridge. One
plain page shows only the same images, at the same size. The other plain page is hand-written with
roslib and has the same widgets in the same places. The processor time includes the renderer and the
GPU process. The three pages are measured in turn, in one Chromium without a graphics processor.
"""

import asyncio
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from playwright.async_api import Browser, Page

from bench.browser_page import opened, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.processes import cpu_s, spent_s
from bench.rig.programs import Program, Server, peer

__all__ = ["run"]

Costs = dict[str, Any]
"""Processor time as a share of one core, and images shown per second, for each page."""
GOAL = 1.2
SETTLE_S = 4.0
LOOK_S, LOOK_IF_FULL_S = 10.0, 20.0
ROUNDS, ROUNDS_IF_FULL = 3, 9
ROOT = Path(__file__).resolve().parents[1]
PROFILE = ROOT / "robots/turtlebot4.yaml"
TOPIC = "/oakd/rgb/preview/image_raw/compressed"
THROTTLE_MS = "100"
"""Shortest odometry interval, as in the robot's profile; camera and laser send less often."""
OURS, PICTURE, ROS = "URC", "picture alone", "roslib"
MEASURED = ("renderer", "GPU")
"""Types of the measured processes, as Chromium names them."""
SLOTS = {"map": "map", "laser": "laser", "stick": "stick", "camera": "camera", "battery": "value"}
"""Name of the roslib page's cell, keyed by the corresponding slot of URC's page."""
LIVE = """
(count) => document.querySelectorAll(".urc-grid [data-state=live]").length >= count
"""
SHOWS = 5
"""Number of widgets that show values; the others only send commands."""
BOXES = """
() => Object.fromEntries([...document.querySelectorAll(".urc-grid [data-config]")].map((cell) => {
  const { x, y, width, height } = cell.getBoundingClientRect();
  return [JSON.parse(cell.dataset.config).slot, [x, y, width, height]];
}))
"""
PLACE = """
() => {
  const box = document.querySelector(".camera-picture").getBoundingClientRect();
  const frame = document.querySelector(".camera-face").getBoundingClientRect();
  return [box.x - frame.x, box.y - frame.y, box.width, box.height];
}
"""
COUNT = """
window.benchImages = 0;
const decode = window.createImageBitmap;
window.createImageBitmap = (...given) => {
  window.benchImages += 1;
  return decode(...given);
};
"""


def run(*, full: bool) -> Sequence[Result]:
    """Compare the pages' processor times; store the result of each round."""
    look_s, rounds = (LOOK_IF_FULL_S, ROUNDS_IF_FULL) if full else (LOOK_S, ROUNDS)
    kept = Kept("browser_turtlebot-full" if full else "browser_turtlebot")
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        simulate = [sys.executable, "-m", "urc.cli.main", "simulate", str(PROFILE)]
        robot = stack.enter_context(Program([*simulate, "--set", "port=0"]))
        port = int(robot.wait_for("listening", 40.0)[-1].rpartition(":")[2])
        pages = stack.enter_context(peer("rosbridge.py"))
        options = ("--set", "host=127.0.0.1", "--set", f"port={port}")
        server = stack.enter_context(Server([PROFILE], Path(folder, "data"), *options))
        ours = f"http://127.0.0.1:{server.port}/robots/turtlebot4/?key={server.key}"
        while len(kept.rows) < rounds:
            row = asyncio.run(_round(ours, f"http://127.0.0.1:{pages}", port, look_s))
            kept.add(row)
    return _results([dict(row) for row in kept.end()])


async def _round(ours: str, pages: str, robot: int, look_s: float) -> Costs:
    """Return the processor time and the image rate of each of the three pages."""
    async with running_browser(is_whole=True) as browser:
        async with opened(browser, ours, script=COUNT) as one:
            await one.page.wait_for_function(LIVE, arg=SHOWS)
            boxes = await one.page.evaluate(BOXES)
            image = await one.page.evaluate(PLACE)
            costs = {OURS: await _cost(browser, one.page, look_s)}
        asked = {"robot": f"127.0.0.1:{robot}", "topic": TOPIC, "camera": TOPIC}
        frames = {"frame": json.dumps(boxes["camera"]), "image": json.dumps(image)}
        cells = {cell: boxes[slot] for slot, cell in SLOTS.items()}
        queries = {
            PICTURE: ("picture", asked | frames),
            ROS: ("roslib", asked | {"boxes": json.dumps(cells), "throttle": THROTTLE_MS}),
        }
        for name, (path, query) in queries.items():
            async with opened(browser, f"{pages}/{path}?{urlencode(query)}") as one:
                await one.page.wait_for_function("() => window.benchImages > 0")
                costs[name] = await _cost(browser, one.page, look_s)
    return costs


async def _cost(browser: Browser, page: Page, look_s: float) -> tuple[float, float]:
    """Return the processor time as a share of one core, and the images shown per second."""
    await asyncio.sleep(SETTLE_S)
    line = await browser.new_browser_cdp_session()
    answer = await line.send("SystemInfo.getProcessInfo")
    await line.detach()
    processes = [one["id"] for one in answer["processInfo"] if one["type"] in MEASURED]
    images, before, began_s = await _images(page), cpu_s(processes), time.monotonic()
    await asyncio.sleep(look_s)
    after, passed_s = cpu_s(processes), time.monotonic() - began_s
    return spent_s(before, after) / passed_s, (await _images(page) - images) / passed_s


async def _images(page: Page) -> int:
    return int(await page.evaluate("() => window.benchImages"))


def _results(rows: Sequence[Costs]) -> list[Result]:
    for name in (OURS, PICTURE, ROS):
        columns = zip(*(row[name] for row in rows), strict=True)
        core, images_hz = map(statistics.median, columns)
        figures = {"core": round(core, 3), "images_hz": round(images_hz, 1)}
        tell({"figure": "browser_turtlebot", "page": name, **figures})
    return [_result(rows, name) for name in (PICTURE, ROS)]


def _result(rows: Sequence[Costs], other: str) -> Result:
    theirs, ours = ([row[name][0] for row in rows] for name in (other, OURS))
    ratios = [after / base for base, after in zip(theirs, ours, strict=True)]
    middle = statistics.median(theirs)
    return Result(
        name=f"TurtleBot page, processor time of the browser: {OURS} / {other}",
        ratio=round(statistics.median(ratios), 3),
        goal=GOAL,
        baseline_ms=round(middle * 1000, 1),
        subject_ms=round(statistics.median(ours) * 1000, 1),
        spread=round(max(theirs) / middle, 2),
        rounds=len(rows),
    )
