"""Sixty widgets that are fed ten thousand values a second: what a frame costs, and how many come.

URC's page has real widgets and a real server behind it. Beside it stands the page that one writes
first, with as many places: a message a value, written as it comes. Both also with the page's
processor slowed six times, as on an old telephone.

Where a frame has no room for all sixty, URC's widgets take turns (``static/widgets/pace.js``): each
is then drawn with its newest value in every twentieth frame or more often. So the time of a frame
counts beside the number of frames: the naive page writes each value and comes to few frames.
"""

import asyncio
import json
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from playwright.async_api import Browser

from bench.browser_page import Cost, against, cost_of, kept, opened, peer, running_browser, served
from bench.harness import Result
from bench.peers.feed import CHANNELS, is_whole

__all__ = ["run"]

GOAL = 0.1
"""Time for a frame / naive page, both slowed."""
SLOWED = 6
LOOK_S, LOOK_IF_FULL_S = 3.0, 8.0
ROUNDS, ROUNDS_IF_FULL = 2, 9
NAIVE_S = 1.0
"""What it cannot keep up with waits in the page, and so does whoever asks it: at most so long."""
COLUMNS, ROWS = 10, 6
EVERY = 3
"""So many signals apart are the ones that are shown; the page is sent all of them."""
KINDS = (
    ("value", "value", ""),
    ("gauge", "value", "V"),
    ("value", "value", "m"),
    ("bar", "value", "%"),
    ("value", "value", ""),
    ("state", "value", ""),
    ("battery", "level", "%"),
    ("value", "value", "A"),
    ("gauge", "value", ""),
    ("compass", "heading", "deg"),
)
"""Widget, input, unit."""
# A cell that cannot be seen is not drawn: all sixty have to be, and to say something.
READY = """
(count) => {
  const cells = [...document.querySelectorAll(".urc-grid [data-config]")];
  const isSeen = (cell) => {
    const { left, top, right, bottom } = cell.getBoundingClientRect();
    return left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight && right > left;
  };
  const isLive = (cell) => cell.querySelector("[data-state=live]") !== null;
  return cells.length === count && cells.every((cell) => isSeen(cell) && isLive(cell));
}
"""


def document() -> str:
    """Return the robot's signals, its one message, and its sixty widgets."""
    names = [f"s{each}" for each in range(CHANNELS)]
    signals: dict[str, dict[str, object]] = {
        name: {"type": "integer" if is_whole(each) else "number", "min": 0, "max": 100}
        for each, name in enumerate(names)
    }
    slots = [f"w{each}" for each in range(COLUMNS * ROWS)]
    widgets: dict[str, object] = {}
    for each, slot in enumerate(slots):
        kind, entry, unit = KINDS[each % len(KINDS)]
        name = names[each * EVERY]
        signals[name] |= {"unit": unit} if unit else {}
        widgets[slot] = {"use": kind, "bind": {entry: name}}
    rows = [" ".join(slots[start : start + COLUMNS]) for start in range(0, len(slots), COLUMNS)]
    parts = {
        "signals": signals,
        "messages": {"all": {"json": {name: name for name in names}}},
        "widgets": widgets,
        "interfaces": {"default": {"grid": "\n".join(rows) + "\n"}},
    }
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in parts.items())


def run(*, full: bool) -> Sequence[Result]:
    """Compare the time of a frame with the naive page's; count URC's frames."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        port = stack.enter_context(peer("feed.py", "many"))
        naive = stack.enter_context(peer("naive.py", "many", port))
        ours = stack.enter_context(served(port, document(), Path(folder)))
        return asyncio.run(_compare(f"http://127.0.0.1:{naive}/", ours, seconds, rounds))


async def _compare(naive: str, ours: str, seconds: float, rounds: int) -> list[Result]:
    pairs: list[tuple[Cost, Cost]] = []
    normal: list[Cost] = []
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds):
            base = await _naive(browser, naive)
            async with opened(browser, ours) as one:
                await one.page.wait_for_function(READY, arg=COLUMNS * ROWS)
                normal.append(await cost_of(one, seconds))
                pairs.append((base, await cost_of(one, seconds, slowed=SLOWED)))
    return [
        against("60 widgets, slowed 6 times: time for a frame / naive page", GOAL, pairs),
        kept("60 widgets", normal),
        kept("60 widgets, slowed 6 times", [ours for _, ours in pairs]),
    ]


async def _naive(browser: Browser, address: str) -> Cost:
    async with opened(browser, address) as one:
        await one.page.wait_for_function(
            "() => [...document.querySelectorAll('.cell span')].every((each) => each.textContent)"
        )
        return await cost_of(one, NAIVE_S, slowed=SLOWED)
