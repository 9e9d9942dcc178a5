"""A plot of ten traces and a scan of 1080 rays: what a frame costs, and how many come.

Beside URC's page stands one that draws all it has in each frame: 10 x 3000 points by uPlot, and a
dot for each ray on a canvas. The traces come 60 times a second, and for URC 1000 times as well.
"""

import asyncio
import json
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from playwright.async_api import Browser

from bench.browser_page import Cost, against, cost_of, kept, opened, peer, running_browser, served
from bench.harness import Result
from bench.peers.feed import RAYS, SERIES

__all__ = ["run"]

GOAL = 0.2
"""Time for a frame / uPlot redraw, both slowed."""
SLOWED = 6
LOOK_S, LOOK_IF_FULL_S = 2.5, 8.0
ROUNDS, ROUNDS_IF_FULL = 2, 9
RATES = (60, 1000)
UPLOT = Path(__file__).resolve().parents[1] / "node_modules" / "uplot" / "dist"
READY = """
() => [".plot", ".scan"].every((each) => document.querySelector(each)?.dataset.state === "live")
"""

Costs = dict[tuple[int, int], list[Cost]]
"""(rate of the traces, how many times slowed) → costs."""


def document() -> str:
    """Return the robot's signals, its two messages, and its two widgets."""
    names = [f"p{each}" for each in range(SERIES)]
    parts = {
        "signals": {
            **{name: {"type": "number"} for name in names},
            "r": {"type": "array", "of": "number", "size": RAYS},
        },
        "messages": {
            "traces": {"json": {name: name for name in names}},
            "scan": {"json": {"r": "r"}},
        },
        "widgets": {
            "plot": {"use": "plot", "bind": {"series": names}},
            "scan": {"use": "scan", "bind": {"ranges": "r"}},
        },
        "interfaces": {"default": {"grid": "plot scan\n"}},
    }
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in parts.items())


def run(*, full: bool) -> Sequence[Result]:
    """Compare the time of a frame with a uPlot redraw's; count URC's frames."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        ours: dict[int, str] = {}
        ports = {rate: stack.enter_context(peer("feed.py", f"traces-{rate}")) for rate in RATES}
        for rate, port in ports.items():
            work = Path(folder) / str(rate)
            work.mkdir()
            ours[rate] = stack.enter_context(served(port, document(), work))
        naive = ""
        if UPLOT.is_dir():
            port = stack.enter_context(peer("naive.py", "traces", ports[RATES[0]], UPLOT))
            naive = f"http://127.0.0.1:{port}/"
        else:
            print(json.dumps({"left_out": "browser_plot_scan uPlot", "why": f"no {UPLOT}"}))
        return asyncio.run(_compare(naive, ours, seconds, rounds))


async def _compare(
    naive: str, ours: Mapping[int, str], seconds: float, rounds: int
) -> list[Result]:
    pairs: list[tuple[Cost, Cost]] = []
    costs: Costs = {}
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds):
            base = await _naive(browser, naive, seconds) if naive else None
            for rate, address in ours.items():
                async with opened(browser, address) as one:
                    await one.page.wait_for_function(READY)
                    for slowed in (1, SLOWED):
                        cost = await cost_of(one, seconds, slowed=slowed)
                        costs.setdefault((rate, slowed), []).append(cost)
            if base:
                pairs.append((base, costs[RATES[0], SLOWED][-1]))
    results = [
        kept(f"plot and scan, {rate} Hz" + (f", slowed {slowed} times" * (slowed > 1)), found)
        for (rate, slowed), found in costs.items()
    ]
    if pairs:
        name = "plot and scan, slowed 6 times: time for a frame / uPlot redraw"
        results.insert(0, against(name, GOAL, pairs))
    return results


async def _naive(browser: Browser, address: str, seconds: float) -> Cost:
    async with opened(browser, address) as one:
        await one.page.wait_for_selector(".u-over")
        return await cost_of(one, seconds, slowed=SLOWED)
