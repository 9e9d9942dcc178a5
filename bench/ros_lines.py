"""Processor time of URC, and bytes, for the same ROS 2 robot over each line.

The robot publishes odometry, IMU data, a laser scan and two cameras (`bench.peers.ros_streams`). A
page in Chromium shows all of them at full rate, or all except the cameras. The lines are measured
in turn. The processor time is that of ``urc serve`` with its guard; the robot's does not count.

On each line, a minimal program without engine and page (`bench.peers.ros_reader`) receives the same
messages. Its processor time shows which part of URC's time belongs to the line and its library. A
server without a line (`bench.rig.memory_process`) gets the same messages from memory. Its processor
time is the part that all lines share. The sum of both is about the least that a line can need.
"""

import asyncio
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playwright.async_api import Page

from bench.browser_page import at_share, opened, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.processes import cpu_s, spent_s
from bench.rig.programs import Program, Server

__all__ = ["run"]

Costs = dict[str, dict[str, float]]
"""Figures of each line in one round, keyed by line."""
SETTLE_S = 6.0
LOOK_S, LOOK_IF_FULL_S = 6.0, 15.0
ROUNDS, ROUNDS_IF_FULL = 1, 5
PERIOD_MS = 20.0
"""Goal of the page: the 95th percentile of the time between frames."""
JSON, CBOR, FOXGLOVE, ZENOH = "rosbridge", "rosbridge with CBOR", "foxglove", "zenoh"
LINES = {JSON: "rosbridge", CBOR: "rosbridge", FOXGLOVE: "foxglove", ZENOH: "zenoh"}
MINIMAL = {f"{line}, minimal program": line for line in (JSON, FOXGLOVE, ZENOH)}
MEMORY = "memory"
"""The server without a line."""
VALUES, PICTURES = ("odom", "imu", "scan"), ("front", "rear")
"""Topics that the page shows without and with the cameras."""
READY_S = 40.0
CAMERA_HZ = 15
BYTES_WITH_CAMERAS, BYTES_WITHOUT, BYTES_OF_CBOR = 0.78, 0.5, 1.2
"""Goals for bytes, as ratios to rosbridge with JSON, and to rosbridge with CBOR."""
CPU = {FOXGLOVE: 1.1, ZENOH: 1.3}
"""Goals for processor time, as ratios to rosbridge with JSON. Decoding is a small part: the engine
and the page's feed, which all lines share, need most of the time. Zenoh has threads of its own."""

PROFILE = """\
urc: 1
kind: robot
name: bench
title: Bench
transports:
  ros: {{ type: ros, via: {via}, host: 127.0.0.1, port: {port}, version: 2, stale_after: 3s }}
signals:
  x: {{ unit: m }}
  y: {{ unit: m }}
  "facing_{{k}}": {{ each: {{ k: [x, y, z, w] }} }}
  yaw: {{ unit: rad, axes: FLU, value: "[facing_x, facing_y, facing_z, facing_w] | yaw" }}
  "imu_{{k}}": {{ each: {{ k: [x, y, z, w] }} }}
  lean: {{ unit: rad, axes: FLU, value: "[imu_x, imu_y, imu_z, imu_w] | roll" }}
  nose: {{ unit: rad, axes: FLU, value: "[imu_x, imu_y, imu_z, imu_w] | pitch" }}
  ranges: {{ type: array, unit: m }}
  first: {{ unit: rad }}
  step: {{ unit: rad }}
  front: {{ type: image }}
  rear: {{ type: image }}
messages:
  odometry:
    subscribe: {{ topic: /odom, type: nav_msgs/Odometry{more} }}
    json:
      x: pose.pose.position.x
      y: pose.pose.position.y
      facing_x: pose.pose.orientation.x
      facing_y: pose.pose.orientation.y
      facing_z: pose.pose.orientation.z
      facing_w: pose.pose.orientation.w
  imu:
    subscribe: {{ topic: /imu, type: sensor_msgs/Imu{more} }}
    json:
      imu_x: orientation.x
      imu_y: orientation.y
      imu_z: orientation.z
      imu_w: orientation.w
  scan:
    subscribe: {{ topic: /scan, type: sensor_msgs/LaserScan{more} }}
    json: {{ ranges: ranges, first: angle_min, step: angle_increment }}
  front:
    subscribe: {{ topic: /front, type: sensor_msgs/CompressedImage{more} }}
    json: {{ front: data }}
  rear:
    subscribe: {{ topic: /rear, type: sensor_msgs/CompressedImage{more} }}
    json: {{ rear: data }}
widgets:
  map: {{ use: map, bind: {{ x: x, y: y, yaw: yaw }} }}
  attitude: {{ use: attitude, bind: {{ roll: lean, pitch: nose }} }}
  scan: {{ use: scan, bind: {{ ranges: ranges, angle_min: first, angle_increment: step }} }}
{cameras}
interfaces:
  default:
    layouts:
      landscape: |
{rows}
"""
CAMERAS = """\
  front: { use: camera, bind: { image: front } }
  rear: { use: camera, bind: { image: rear } }
"""
COUNT = """
window.benchImages = 0;
window.benchPeriods = [];
const decode = window.createImageBitmap;
window.createImageBitmap = (...given) => {
  window.benchImages += 1;
  return decode(...given);
};
let last = performance.now();
const frame = (now) => {
  window.benchPeriods.push(now - last);
  last = now;
  requestAnimationFrame(frame);
};
requestAnimationFrame(frame);
"""
LIVE = """
(count) => document.querySelectorAll(".urc-grid [data-state=live]").length >= count
"""


def run(*, full: bool) -> Sequence[Result]:
    """Compare the lines; store the result of each round."""
    look_s, rounds = (LOOK_IF_FULL_S, ROUNDS_IF_FULL) if full else (LOOK_S, ROUNDS)
    kept = Kept("ros_lines-full" if full else "ros_lines")
    while len(kept.rows) < rounds:
        with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
            kept.add(asyncio.run(_round(Path(folder), look_s)))
    rows = [dict(row) for row in kept.end()]
    return [*_figures(rows, "cameras"), *_figures(rows, "values")]


async def _round(folder: Path, look_s: float) -> dict[str, Costs]:
    """Return the figures of each line, with cameras and with values only."""
    costs: dict[str, Costs] = {"cameras": {}, "values": {}}
    for line, via in LINES.items():
        for what, of_lines in costs.items():
            with Program([sys.executable, "-m", "bench.peers.ros_streams", via]) as robot:
                port = int(robot.wait_for("ready", READY_S)[1])
                file = _document(folder / f"{line}-{what}".replace(" ", "-"), line, port, what)
                with Server([file], file.parent / "data") as server:
                    of_lines[line] = await _cost(robot, server, what, look_s)
    for what, of_lines in costs.items():
        file = _document(folder / f"memory-{what}", JSON, 1, what)
        with Server([file], file.parent / "data", module="bench.rig.memory_process") as server:
            of_lines[MEMORY] = await _cost(None, server, what, look_s)
    for name, line in MINIMAL.items():
        for what, of_lines in costs.items():
            of_lines[name] = await _least(line, what, look_s)
    return costs


def _document(work: Path, line: str, port: int, what: str) -> Path:
    """Write the profile for a line into a new folder; return its path."""
    work.mkdir()
    file = work / "bench.yaml"
    file.write_text(_profile(line, port, with_cameras=what == "cameras"), "utf-8")
    return file


async def _least(line: str, what: str, look_s: float) -> dict[str, float]:
    """Return the figures of the minimal program on one line."""
    topics = VALUES + (PICTURES if what == "cameras" else ())
    with Program([sys.executable, "-m", "bench.peers.ros_streams", line]) as robot:
        port = robot.wait_for("ready", READY_S)[1]
        with Program([sys.executable, "-m", "bench.peers.ros_reader", line, port, *topics]) as one:
            one.wait_for("ready", READY_S)
            await asyncio.sleep(SETTLE_S)
            before, bytes_before, began_s = cpu_s([one.pid]), _bytes(robot), time.monotonic()
            await asyncio.sleep(look_s)
            after, bytes_after = cpu_s([one.pid]), _bytes(robot)
            passed_s = time.monotonic() - began_s
    return {
        "core": spent_s(before, after) / passed_s,
        "bytes": (bytes_after - bytes_before) / passed_s,
    }


def _profile(line: str, port: int, *, with_cameras: bool) -> str:
    rows = ["map attitude scan", *(["front front rear"] if with_cameras else [])]
    return PROFILE.format(
        via=LINES[line],
        port=port,
        more=", compression: cbor" if line == CBOR else "",
        cameras=CAMERAS if with_cameras else "",
        rows="\n".join(f"        {row}" for row in rows),
    )


async def _cost(
    robot: Program | None, server: Server, what: str, look_s: float
) -> dict[str, float]:
    """Return the figures of one line while a page looks."""
    address = f"http://127.0.0.1:{server.port}/robots/bench/?key={server.key}"
    async with (
        running_browser(is_whole=True) as browser,
        opened(browser, address, script=COUNT) as one,
    ):
        await one.page.wait_for_function(LIVE, arg=5 if what == "cameras" else 3)
        await asyncio.sleep(SETTLE_S)
        processes = [server.pid, *server.guards]
        await one.page.evaluate("() => { window.benchPeriods.length = 0; }")
        images, before, bytes_before = await _images(one.page), cpu_s(processes), _bytes(robot)
        began_s = time.monotonic()
        await asyncio.sleep(look_s)
        after, bytes_after, passed_s = cpu_s(processes), _bytes(robot), time.monotonic() - began_s
        images = await _images(one.page) - images
        periods = sorted(await one.page.evaluate("() => window.benchPeriods"))
    return {
        "core": spent_s(before, after) / passed_s,
        "bytes": (bytes_after - bytes_before) / passed_s,
        "images_hz": images / passed_s,
        "p95_ms": at_share(periods, 0.95),
    }


async def _images(page: Page) -> int:
    return int(await page.evaluate("() => window.benchImages"))


def _bytes(robot: Program | None) -> int:
    """Return the number of bytes that the robot has sent to its client; 0 without a robot."""
    if robot is None:
        return 0
    after = len(robot.lines)
    robot.order("")
    return int(robot.wait_for("bytes", after=after)[1])


def _figures(rows: Sequence[dict[str, Any]], what: str) -> list[Result]:
    """Print the medians of all rounds; return the results that have goals."""
    of_rows: list[Costs] = [row[what] for row in rows]
    for line in (*LINES, MEMORY, *MINIMAL):
        middle = {
            name: statistics.median(costs[line][name] for costs in of_rows)
            for name in of_rows[0][line]
        }
        shown = {name: round(value, 3) for name, value in middle.items() if name != "bytes"}
        told = {"figure": "ros_lines", "shown": what, "line": line, **shown}
        tell({**told, "kB a second": round(middle["bytes"] / 1000)})
    for line in (JSON, FOXGLOVE, ZENOH):
        ratios = [(_core(row, line), _core(row, MEMORY, f"{line}, minimal program"))
                  for row in of_rows]  # fmt: skip
        urc, least = (round(statistics.median(column), 2) for column in zip(*ratios, strict=True))
        told = {"figure": "ros_lines_least", "shown": what, "line": line}
        tell({**told, "URC": urc, "shared part and minimal program": least})
    results = []
    most = BYTES_WITH_CAMERAS if what == "cameras" else BYTES_WITHOUT
    for line in (FOXGLOVE, ZENOH):
        results += [
            _ratio(of_rows, what, line, JSON, "core", CPU[line]),
            _ratio(of_rows, what, line, JSON, "bytes", most),
            _ratio(of_rows, what, line, CBOR, "bytes", BYTES_OF_CBOR),
            _limit(of_rows, what, line, "p95_ms", PERIOD_MS),
        ]
    return results


def _core(row: Costs, *names: str) -> float:
    """Return the sum of some processor times as a ratio to rosbridge with JSON."""
    return sum(row[name]["core"] for name in names) / row[JSON]["core"]


def _ratio(
    rows: Sequence[Costs], what: str, line: str, other: str, name: str, goal: float
) -> Result:
    theirs, ours = ([row[one][name] for row in rows] for one in (other, line))
    middle = statistics.median(theirs)
    return Result(
        name=f"ros_lines, {what}: {name} of {line} / {other}",
        ratio=round(statistics.median(b / a for a, b in zip(theirs, ours, strict=True)), 3),
        goal=goal,
        baseline_ms=round(middle * 1000, 1),
        subject_ms=round(statistics.median(ours) * 1000, 1),
        spread=round(max(theirs) / middle, 2),
        rounds=len(rows),
    )


def _limit(rows: Sequence[Costs], what: str, line: str, name: str, most: float) -> Result:
    ours = [row[line][name] for row in rows]
    middle = statistics.median(ours)
    return Result(
        name=f"ros_lines, {what}: time between frames of {line}, 95th percentile / {most:g} ms",
        ratio=round(middle / most, 3),
        goal=1.0,
        baseline_ms=most,
        subject_ms=round(middle, 1),
        spread=round(max(ours) / middle, 2),
        rounds=len(rows),
    )
