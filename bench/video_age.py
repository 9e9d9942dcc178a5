"""Age of a camera's images, from the camera to the canvas, compared with a minimal page.

GStreamer's RTSP server films 640 × 480 pixels, 30 a second, with the time in each image
(`bench.rig.stamped_camera`). URC's page and a minimal page (`bench.rig.plain_video`) show the same
stream in the same Chromium, one after the other. Both decode with WebCodecs. At each display frame,
a script reads the time from the canvas. The age includes filming, encoding, RTSP, decoding and
drawing, but not the screen.

Then both pages are open, and each binary message is recorded at its arrival in the browser. URC's
delay is the difference between both pages for the same access unit.
"""

import asyncio
import statistics
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import AsyncExitStack
from math import inf
from pathlib import Path
from typing import Any

from playwright.async_api import Browser

from bench.browser_page import Opened, at_share, opened, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.rig.programs import Program, Server
from tests.e2e.ports import free_port

__all__ = ["run"]

Look = Mapping[str, Any]
"""Ages and arrivals of one page, in its own time, and the start of this time."""
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
LEAST_SHARE = 0.5
"""Smallest share of the access units that both pages must have received."""
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
# The last bytes of a message name its access unit, whatever stands before it. URC's page receives
# videos in a worker, which adds the time of arrival.
ARRIVALS = """
(() => {
  window.benchArrivals = [];
  const take = (data, now) => {
    if (!(data instanceof ArrayBuffer) || data.byteLength < 90) return;
    window.benchArrivals.push([String(new Uint8Array(data.slice(-48))), now]);
  };
  const RealSocket = WebSocket;
  window.WebSocket = class extends RealSocket {
    constructor(...words) {
      super(...words);
      this.addEventListener("message", ({ data }) => take(data, performance.now()));
    }
  };
  const RealWorker = Worker;
  window.Worker = class extends RealWorker {
    constructor(...words) {
      super(...words);
      this.addEventListener("message", ({ data }) => {
        take(data?.data, data?.timeMs - performance.timeOrigin);
      });
    }
  };
})();
"""
WATCH = """
async (seconds) => {
  window.benchArrivals.length = 0;
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
  return { ages, arrivals: window.benchArrivals.slice() };
}
"""
MODULUS_MS = 2**20


def run(*, full: bool) -> Sequence[Result]:
    """Measure both pages."""
    look_s = LOOK_IF_FULL_S if full else LOOK_S
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        looks, added = asyncio.run(_measured(Path(folder), look_s))
    ages = {name: _ages(look) for name, look in looks.items()}
    for name, values in ages.items():
        tell(
            {
                "figure": "video_age",
                "page": name,
                "images_hz": round(len(values) / look_s, 1),
                "p50_ms": at_share(values, 0.5),
                "p99_ms": at_share(values, 0.99),
            }
        )
    # Too few access units that both pages received prove nothing, so the goal is missed.
    is_enough = len(added) >= LEAST_SHARE * RATE * look_s
    middle_ms = statistics.median(added) if is_enough else inf
    p50_ms = round(middle_ms, 1) if is_enough else None
    tell({"figure": "video_added", "units": len(added), "p50_ms": p50_ms})
    urc = ages[URC]
    return [
        _result("median age of a camera's images", at_share(urc, 0.5), P50_MS, len(urc)),
        _result("99th percentile of these ages", at_share(urc, 0.99), P99_MS, len(urc)),
        _result("median delay added to a minimal page's", middle_ms, ADDED_MS, len(added)),
    ]


async def _measured(folder: Path, look_s: float) -> tuple[Looks, list[float]]:
    """Return what each page showed, and URC's delays in milliseconds."""
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
                looks = {
                    name: await _look(browser, [place], look_s) for name, place in pages.items()
                }
                both = await _look(browser, list(pages.values()), look_s)
    return {name: look[0] for name, look in looks.items()}, _added(*both)


async def _look(browser: Browser, addresses: Sequence[str], look_s: float) -> list[Look]:
    """Return what the pages showed and received, all open at the same time."""
    async with AsyncExitStack() as stack:
        pages: list[Opened] = []
        for address in addresses:
            one = await stack.enter_async_context(opened(browser, address, script=ARRIVALS))
            await one.page.wait_for_selector("canvas")
            pages.append(one)
        await asyncio.sleep(SETTLE_S)
        found = await asyncio.gather(*(one.page.evaluate(WATCH, look_s) for one in pages))
        return [
            {**look, "origin_ms": one.origin_ms} for one, look in zip(pages, found, strict=True)
        ]


def _ages(found: Look) -> list[float]:
    """Return the sorted ages of all shown images, in milliseconds."""
    origin_ms = found["origin_ms"]
    return sorted((origin_ms + now - stamp) % MODULUS_MS for now, stamp in found["ages"])


def _added(ours: Look, minimal: Look) -> list[float]:
    """Return how much later each access unit arrived on URC's page, in milliseconds."""
    arrivals = dict(minimal["arrivals"])
    shift_ms = ours["origin_ms"] - minimal["origin_ms"]
    return [now + shift_ms - arrivals[name] for name, now in ours["arrivals"] if name in arrivals]


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
