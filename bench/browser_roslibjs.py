"""A browser's processor time: URC's page compared with a roslibjs page for the same topics.

Both pages show a map with a trail, an attitude, a stick, a camera and a value, in areas of equal
size. Both pages get data from the same rosbridge server: URC's page through a real ``urc serve``,
the roslibjs page directly. The processor time includes all processes of Chromium. The two pages are
measured in turn, once per round.
"""

import asyncio
import json
import statistics
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.parse import quote

from playwright.async_api import Browser, CDPSession, Page

from bench.browser_page import opened, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.processes import spent_s
from bench.rig.programs import Server, peer

__all__ = ["run"]

Row = dict[str, Any]
"""Processor time as a share of one core, and images shown per second, for each page."""
GOAL = 1.2
SETTLE_S = 4.0
LOOK_S, LOOK_IF_FULL_S = 5.0, 15.0
ROUNDS, ROUNDS_IF_FULL = 3, 9
PROFILE = """\
urc: 1
kind: robot
name: bench
transports:
  ros: {{ type: ros, host: 127.0.0.1, port: {port}, version: 1 }}
signals:
  x: {{ unit: m }}
  y: {{ unit: m }}
  "facing_{{k}}": {{ each: {{ k: [x, y, z, w] }} }}
  yaw: {{ unit: rad, value: "[facing_x, facing_y, facing_z, facing_w] | yaw", axes: FLU }}
  "imu_{{k}}": {{ each: {{ k: [x, y, z, w] }} }}
  roll: {{ unit: rad, value: "[imu_x, imu_y, imu_z, imu_w] | roll", axes: FLU }}
  pitch: {{ unit: rad, value: "[imu_x, imu_y, imu_z, imu_w] | pitch", axes: FLU }}
  voltage: {{ unit: V, precision: 1 }}
  picture: {{ type: image }}
messages:
  odometry:
    subscribe: {{ topic: /odom, type: nav_msgs/Odometry }}
    json:
      x: pose.pose.position.x
      y: pose.pose.position.y
      facing_x: pose.pose.orientation.x
      facing_y: pose.pose.orientation.y
      facing_z: pose.pose.orientation.z
      facing_w: pose.pose.orientation.w
  imu:
    subscribe: {{ topic: /imu, type: sensor_msgs/Imu }}
    json:
      imu_x: orientation.x
      imu_y: orientation.y
      imu_z: orientation.z
      imu_w: orientation.w
  camera:
    subscribe: {{ topic: /camera/compressed, type: sensor_msgs/CompressedImage }}
    json: {{ picture: data }}
  battery:
    subscribe: {{ topic: /battery_state, type: sensor_msgs/BatteryState }}
    json: {{ voltage: voltage }}
commands:
  drive:
    args: {{ speed: {{ min: -1, max: 1, default: 0 }}, turn: {{ min: -1, max: 1, default: 0 }} }}
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: {{ linear: {{ x: "{{{{ speed }}}}" }}, angular: {{ z: "{{{{ turn }}}}" }} }}
    hold: {{ repeat: 100ms, release: {{ speed: 0, turn: 0 }}, watchdog: none }}
widgets:
  map: {{ use: map, bind: {{ x: x, y: y, yaw: yaw }} }}
  attitude: {{ use: attitude, bind: {{ roll: roll, pitch: pitch }} }}
  stick: {{ use: joystick, bind: {{ moved: {{ command: drive, args: {{ x: speed, y: turn }} }} }} }}
  camera: {{ use: camera, bind: {{ image: picture }} }}
  value: {{ use: value, bind: {{ value: voltage }} }}
interfaces:
  default:
    grid: |
      map map camera camera
      map map camera camera
      attitude value stick stick
"""
BOXES = """
() => Object.fromEntries([...document.querySelectorAll(".urc-grid [data-config]")].map((cell) => {
  const { x, y, width, height } = cell.getBoundingClientRect();
  return [JSON.parse(cell.dataset.config).slot, [x, y, width, height]];
}))
"""
LIVE = """
(count) => document.querySelectorAll(".urc-grid [data-state=live]").length >= count
"""
SHOWS = 4
"""Number of widgets that show values; the stick only sends values."""
COUNT = """
window.benchImages = 0;
const decode = window.createImageBitmap;
window.createImageBitmap = (...given) => {
  window.benchImages += 1;
  return decode(...given);
};
"""
OURS, THEIRS = "URC", "roslibjs"


def run(*, full: bool) -> Sequence[Result]:
    """Compare the two pages' processor times; store the result of each round."""
    look_s, rounds = (LOOK_IF_FULL_S, ROUNDS_IF_FULL) if full else (LOOK_S, ROUNDS)
    kept = Kept("browser_roslibjs-full" if full else "browser_roslibjs")
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        port = stack.enter_context(peer("rosbridge.py"))
        file = Path(folder, "bench.yaml")
        file.write_text(PROFILE.format(port=port), "utf-8")
        server = stack.enter_context(Server([file], Path(folder, "data")))
        ours = f"http://127.0.0.1:{server.port}/robots/bench/?key={server.key}"
        theirs = f"http://127.0.0.1:{port}/roslib?boxes="
        while len(kept.rows) < rounds:
            kept.add(asyncio.run(_round(ours, theirs, look_s)))
    return [_result([dict(row) for row in kept.end()])]


async def _round(ours: str, theirs: str, look_s: float) -> Row:
    """Return both costs."""
    async with running_browser(is_whole=True) as browser:
        async with opened(browser, ours, script=COUNT) as one:
            await one.page.wait_for_function(LIVE, arg=SHOWS)
            boxes = await one.page.evaluate(BOXES)
            first = await _cost(browser, one.page, look_s)
        async with opened(browser, theirs + quote(json.dumps(boxes))) as one:
            await one.page.wait_for_function("() => window.benchImages > 0")
            return {OURS: first, THEIRS: await _cost(browser, one.page, look_s)}


async def _cost(browser: Browser, page: Page, look_s: float) -> tuple[float, float]:
    """Return Chromium's processor time as a share of one core, and the images shown per second."""
    await asyncio.sleep(SETTLE_S)
    line = await browser.new_browser_cdp_session()
    images, before, began_s = await _images(page), await _cpu_s(line), time.monotonic()
    await asyncio.sleep(look_s)
    after, passed_s = await _cpu_s(line), time.monotonic() - began_s
    images = await _images(page) - images
    await line.detach()
    return spent_s(before, after) / passed_s, images / passed_s


async def _images(page: Page) -> int:
    return int(await page.evaluate("() => window.benchImages"))


async def _cpu_s(line: CDPSession) -> dict[int, float]:
    """Return the processor time of each browser process."""
    answer = await line.send("SystemInfo.getProcessInfo")
    return {each["id"]: float(each["cpuTime"]) for each in answer["processInfo"]}


def _result(rows: Sequence[Row]) -> Result:
    for name in (OURS, THEIRS):
        columns = zip(*(row[name] for row in rows), strict=True)
        core, images_hz = map(statistics.median, columns)
        figures = {"core": round(core, 3), "images_hz": round(images_hz, 1)}
        tell({"figure": "browser_roslibjs", "page": name, **figures})
    theirs, ours = ([row[name][0] for row in rows] for name in (THEIRS, OURS))
    ratios = [after / base for base, after in zip(theirs, ours, strict=True)]
    middle = statistics.median(theirs)
    return Result(
        name=f"a page with five ROS topics, processor time of the browser: {OURS} / {THEIRS}",
        ratio=round(statistics.median(ratios), 3),
        goal=GOAL,
        baseline_ms=round(middle * 1000, 1),
        subject_ms=round(statistics.median(ours) * 1000, 1),
        spread=round(max(theirs) / middle, 2),
        rounds=len(rows),
    )
