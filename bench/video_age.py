"""Age of a camera's images, from the camera to the canvas, compared with a minimal page.

GStreamer's RTSP server films 640 × 480 pixels, 30 a second, with the time in each image
(`bench.rig.stamped_camera`). URC's page and a minimal page (`bench.rig.plain_video`) show the same
stream in the same Chromium, one after the other. Both decode with WebCodecs. At each display frame,
a script reads the time from the canvas. The age includes filming, encoding, RTSP, decoding and
drawing, but not the screen.

Then a relay in front of the camera notes when each access unit's last packet arrives
(`bench.rig.rtsp_tap`). A page without a browser notes when the unit is complete there
(`bench.rig.unit_page`). Checksums of the pictures match both. The difference is URC's delay.
"""

import asyncio
import json
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

from playwright.async_api import Browser

from bench.browser_page import at_share, opened, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.rig.programs import Program, Server
from tests.e2e.ports import free_port

__all__ = ["run"]

Look = Mapping[str, Any]
"""Ages of one page's images, in its own time, and the start of this time."""
Looks = Mapping[str, Look]
URC, MINIMAL = "URC", "minimal page"
SETTLE_S = 6.0
LOOK_S, LOOK_IF_FULL_S = 8.0, 60.0
P50_MS, P99_MS = 120.0, 250.0
"""Goals for the age of the shown images."""
ADDED_MS = 5.0
"""Goal for the median of URC's delay."""
RATE = 30
"""Images a second."""
LEAST_SHARE = 0.9
"""Smallest share of the access units that the page must have received."""
READY_S = 30.0
PYTHON = "/usr/bin/python3"
"""Debian's Python, which has GStreamer's bindings."""
PROFILE = """\
urc: 1
kind: robot
name: bench
title: Bench
transports:
  eye: {{ type: camera, url: "rtsp://127.0.0.1:{port}/cam" }}
signals:
  picture: {{ type: video }}
messages:
  picture: {{ raw: picture }}
widgets:
  front: {{ use: camera, bind: {{ image: picture }} }}
interfaces:
  default:
    background: front
    grid: |
      .
"""
WATCH = """
async (seconds) => {
  const canvas = document.querySelector(".camera canvas, canvas");
  const small = new OffscreenCanvas(640, 1);
  const pen = small.getContext("2d", { willReadFrequently: true });
  const ages = [];
  const endMs = performance.now() + seconds * 1000;
  let last = -1;
  await new Promise((done) => {
    const frame = () => {
      const now = performance.now();
      pen.drawImage(canvas, 0, 16, 640, 1, 0, 0, 640, 1);
      const { data } = pen.getImageData(0, 0, 640, 1);
      let stamp = 0;
      for (let bit = 0; bit < 20; bit += 1) stamp += data[4 * (32 * bit + 16)] > 128 ? 2 ** bit : 0;
      if (stamp !== last) ages.push([now, stamp]);
      last = stamp;
      if (now < endMs) requestAnimationFrame(frame); else done();
    };
    requestAnimationFrame(frame);
  });
  return { ages };
}
"""
MODULUS_MS = 2**20


def run(*, full: bool) -> Sequence[Result]:
    """Measure both pages."""
    look_s = LOOK_IF_FULL_S if full else LOOK_S
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        looks = asyncio.run(_measured(Path(folder), look_s))
        added = _delays(Path(folder), look_s)
    ages = {name: _ages(look) for name, look in looks.items()}
    for name, values in ages.items():
        tell(
            {
                "figure": "video_age",
                "page": name,
                "images_hz": round(len(values) / look_s, 1),
                "p50_ms": round(at_share(values, 0.5), 1),
                "p99_ms": round(at_share(values, 0.99), 1),
            }
        )
    # Too few access units prove nothing, so the goal is missed.
    middle_ms = at_share(added, 0.5) if len(added) >= LEAST_SHARE * RATE * look_s else inf
    shares = {
        name: round(at_share(added, share), 1)
        for name, share in (("p50_ms", 0.5), ("p99_ms", 0.99))
        if added
    }
    tell({"figure": "video_added", "units": len(added), **shares})
    urc = ages[URC]
    return [
        _result("median age of a camera's images", at_share(urc, 0.5), P50_MS, len(urc)),
        _result("99th percentile of these ages", at_share(urc, 0.99), P99_MS, len(urc)),
        _result("median delay from packets to the page", middle_ms, ADDED_MS, len(added)),
    ]


async def _measured(folder: Path, look_s: float) -> Looks:
    """Return what each page showed."""
    port = free_port()
    file = folder / "bench.yaml"
    file.write_text(PROFILE.format(port=port), "utf-8")
    script = Path(__file__).parent / "rig" / "stamped_camera.py"
    url = f"rtsp://127.0.0.1:{port}/cam"
    with Program([PYTHON, "-P", str(script), str(port)]) as camera:
        camera.wait_for("ready", READY_S)
        with (
            Program([sys.executable, "-m", "bench.rig.plain_video", url]) as plain,
            Server([file], folder / "data") as server,
        ):
            plain_port = plain.wait_for("ready", READY_S)[1]
            pages = {
                URC: f"http://127.0.0.1:{server.port}/robots/bench/?key={server.key}",
                MINIMAL: f"http://127.0.0.1:{plain_port}/",
            }
            async with running_browser() as browser:
                return {name: await _look(browser, place, look_s) for name, place in pages.items()}


async def _look(browser: Browser, address: str, look_s: float) -> Look:
    """Return what a page showed."""
    async with opened(browser, address) as one:
        await one.page.wait_for_selector("canvas")
        await asyncio.sleep(SETTLE_S)
        return {**await one.page.evaluate(WATCH, look_s), "origin_ms": one.origin_ms}


def _delays(folder: Path, look_s: float) -> list[float]:
    """Return URC's delay of each access unit, in milliseconds, sorted."""
    port = free_port()
    script = Path(__file__).parent / "rig" / "stamped_camera.py"
    file = folder / "tapped.yaml"
    with Program([PYTHON, "-P", str(script), str(port)]) as camera:
        camera.wait_for("ready", READY_S)
        with Program([sys.executable, "-m", "bench.rig.rtsp_tap", str(port)]) as tap:
            file.write_text(PROFILE.format(port=tap.wait_for("ready", READY_S)[1]), "utf-8")
            with Server([file], folder / "tapped") as server:
                arguments = [str(server.port), server.key, "bench", "picture"]
                with Program([sys.executable, "-m", "bench.rig.unit_page", *arguments]) as page:
                    page.wait_for("ready", READY_S)
                    time.sleep(SETTLE_S)
                    began_ns = time.monotonic_ns()
                    time.sleep(look_s)
                    arrived = _times_ns(page)
            left = _times_ns(tap)
    wanted = {name: time_ns for name, time_ns in left.items() if time_ns > began_ns}
    return sorted(
        (arrived[name] - time_ns) / 1e6 for name, time_ns in wanted.items() if name in arrived
    )


def _times_ns(program: Program) -> dict[str, int]:
    """End a program, and return the times of its access units in nanoseconds."""
    program.order("end")
    times: dict[str, int] = json.loads(program.wait_for("times", READY_S)[1])
    return times


def _ages(found: Look) -> list[float]:
    """Return the sorted ages of all shown images, in milliseconds."""
    origin_ms = found["origin_ms"]
    return sorted((origin_ms + now - stamp) % MODULUS_MS for now, stamp in found["ages"])


def _result(what: str, measured_ms: float, goal_ms: float, count: int) -> Result:
    return Result(
        name=f"video_age: {what} / {goal_ms:g} ms",
        ratio=round(measured_ms / goal_ms, 3),
        goal=1.0,
        baseline_ms=goal_ms,
        subject_ms=round(measured_ms, 2),
        spread=1.0,
        rounds=count,
    )
