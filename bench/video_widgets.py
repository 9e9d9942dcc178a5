"""Images that a page in Chromium shows of several videos at once, and what it tells about them.

Each canvas counts the images that it draws. The page may show less if the line does not bear all
images, but then each badge must tell so. Part of the benchmark `video_relay`.
"""

import asyncio
from collections.abc import Sequence
from typing import Any, Final

from bench.browser_page import opened, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.video_films import RATE_HZ

__all__ = ["document", "shown"]

SETTLE_S: Final = 5.0
MOST_UNEVEN: Final = 1.5
"""Goal for the rate of the fastest video as a multiple of the rate of the slowest one."""
MOST_UNTOLD: Final = 0.1
"""Goal for the share of images that are missing although the badge promises all of them."""
COUNT: Final = """
(() => {
  window.benchDrawn = new Map();
  const pens = ImageBitmapRenderingContext.prototype;
  const draw = pens.transferFromImageBitmap;
  pens.transferFromImageBitmap = function (image) {
    const { canvas } = this;
    if (image) window.benchDrawn.set(canvas, (window.benchDrawn.get(canvas) ?? 0) + 1);
    return draw.call(this, image);
  };
})();
"""
WATCH: Final = """
async (seconds) => {
  const cameras = [...document.querySelectorAll(".camera")].map((root) => ({
    root, canvas: root.querySelector(".camera-picture"), drawn: 0, full: 0, fullMs: 0,
  }));
  const count = ({ canvas }) => window.benchDrawn.get(canvas) ?? 0;
  const firsts = cameras.map(count);
  const lasts = firsts.slice();
  const beganMs = performance.now();
  let lastMs = beganMs;
  while (lastMs - beganMs < seconds * 1000) {
    await new Promise((done) => setTimeout(done, 50));
    const nowMs = performance.now();
    cameras.forEach((one, place) => {
      const drawn = count(one) - lasts[place];
      lasts[place] += drawn;
      if (one.root.dataset.quality) return;
      one.full += drawn;
      one.fullMs += nowMs - lastMs;
    });
    lastMs = nowMs;
  }
  const lasted = (lastMs - beganMs) / 1000;
  return cameras.map((one, place) => ({
    hz: (lasts[place] - firsts[place]) / lasted,
    full: one.full,
    fullS: one.fullMs / 1000,
    lasted,
  }));
}
"""


def document(count: int) -> str:
    """Return the widgets and the interface of a robot with the videos ``v0`` and so on."""
    places = range(count)
    widgets = "".join(f"  c{one}: {{ use: camera, bind: {{ image: v{one} }} }}\n" for one in places)
    rows = (" ".join(f"c{one}" for one in places[at : at + 2]) for at in range(0, count, 2))
    grid = "".join(f"      {row}\n" for row in rows)
    return f"widgets:\n{widgets}interfaces:\n  default:\n    grid: |\n{grid}"


def shown(address: str, lasts_s: float) -> list[Result]:
    """Measure a page with all videos."""
    found = asyncio.run(_watched(address, lasts_s))
    for place, one in enumerate(found):
        tell(
            {
                "figure": "video_widgets",
                "video": place + 1,
                "shown_hz": round(one["hz"], 1),
                "told as reduced": f"{100 * (1 - one['fullS'] / one['lasted']):.0f} %",
            }
        )
    rates = [one["hz"] for one in found]
    uneven = max(rates) / max(min(rates), 0.01)
    promised = sum(one["fullS"] for one in found) * RATE_HZ
    untold = max(0.0, promised - sum(one["full"] for one in found)) / max(promised, 1.0)
    return [
        _result("fastest / slowest on a page in Chromium", uneven, MOST_UNEVEN),
        _result("missing images without a sign on the page", untold, MOST_UNTOLD),
    ]


async def _watched(address: str, lasts_s: float) -> Sequence[dict[str, Any]]:
    async with running_browser() as browser, opened(browser, address, script=COUNT) as one:
        await one.page.wait_for_function("() => window.benchDrawn.size >= 4")
        await asyncio.sleep(SETTLE_S)
        found: list[dict[str, Any]] = await one.page.evaluate(WATCH, lasts_s)
        return found


def _result(name: str, ratio: float, goal: float) -> Result:
    return Result(f"videos: {name}", round(ratio, 3), goal, 0.0, 0.0, 1.0, 1)
