"""A needle that tracks its value: where a gauge's needle stands in each frame, against the figure.

The robot tells its clock 50 times a second; the gauge's scale is one second. Once a frame was
drawn, the angle of the needle on the screen is read back as a time, and so is the figure below it.
A needle that is animated from value to value stays behind: this one may not be a frame behind.
How old both were is told beside it.
"""

import asyncio
import json
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from bench.browser_page import FRAME_MS, at_share, opened, peer, running_browser, served
from bench.harness import Result

__all__ = ["run"]

RATE_HZ = 50
LOOK_S, LOOK_IF_FULL_S = 3.0, 10.0
ROUNDS, ROUNDS_IF_FULL = 3, 9
LEAST_SHARE = 0.5
TURN_MS = 1000.0
DOCUMENT = """\
signals:
  t: { type: integer, min: 0, max: 10000 }
messages:
  time: { regex: '^[0-9]{6}(?P<t>[0-9]{4})$' }
widgets:
  t: { use: gauge, bind: { value: t }, options: { precision: 0 } }
interfaces:
  default: { grid: "t" }
"""
READY = "() => document.querySelector('.gauge')?.dataset.state === 'live'"
# The scale is 270 degrees, from -135 on, for 10000 tenths of milliseconds.
WATCH = """
async (seconds) => {
  const needle = document.querySelector(".gauge-needle polygon");
  const figure = document.querySelector(".gauge-text");
  const found = [];
  const endMs = performance.now() + seconds * 1000;
  const channel = new MessageChannel();
  channel.port1.onmessage = () => {
    const { points } = needle; // the two in the middle are its tip
    const [x, y] = [points[1].x + points[2].x, points[1].y + points[2].y];
    const degrees = Math.atan2(x, -y) * 180 / Math.PI;
    const said = Number(figure.textContent.replace(/[^0-9]/g, "")) / 10;
    found.push([performance.now(), (degrees + 135) / 270 * 1000, said]);
  };
  await new Promise((done) => {
    const frame = () => {
      channel.port2.postMessage(0);
      if (performance.now() > endMs) done();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  });
  channel.port1.close();
  return found;
}
"""


def run(*, full: bool) -> Sequence[Result]:
    """Compare the needle's distance from the figure with one frame."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        port = stack.enter_context(peer("robot.py", RATE_HZ))
        address = stack.enter_context(served(port, DOCUMENT, Path(folder)))
        looks = asyncio.run(_look_all(address, seconds, rounds))
    errors = [[abs(_apart(said, drawn)) for _, drawn, said in look] for look in looks]
    old = sorted(_apart(now, drawn) % TURN_MS for look in looks for now, drawn, _ in look)
    told = {"p50_ms": at_share(old, 0.5), "p99_ms": at_share(old, 0.99), "frames": len(old)}
    print(json.dumps({"browser_needle": "age of the needle in each frame", **told}), flush=True)
    worst = sorted(at_share(sorted(each), 0.99) for each in errors)
    middle = worst[len(worst) // 2]
    return [
        Result(
            name="gauge needle: p99 of its distance from the figure / one frame",
            ratio=round(middle / FRAME_MS, 3),
            goal=1.0,
            baseline_ms=round(FRAME_MS, 2),
            subject_ms=middle,
            spread=1.0,
            rounds=rounds,
        )
    ]


async def _look_all(
    address: str, seconds: float, rounds: int
) -> list[list[tuple[float, float, float]]]:
    """Return for each frame of each round: when, what the needle shows, and what the figure."""
    looks: list[list[tuple[float, float, float]]] = []
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds):
            async with opened(browser, address) as one:
                await one.page.wait_for_function(READY)
                found = await one.page.evaluate(WATCH, seconds)
                looks.append([(one.origin_ms + now, drawn, said) for now, drawn, said in found])
            if len({said for _, _, said in looks[-1]}) < LEAST_SHARE * RATE_HZ * seconds:
                raise SystemExit(
                    f"bench: the gauge showed {len(looks[-1])} frames, few of them new"
                )
    return looks


def _apart(later: float, earlier: float) -> float:
    """Return the difference of two times that are known modulo the scale."""
    return (later - earlier + TURN_MS / 2) % TURN_MS - TURN_MS / 2
