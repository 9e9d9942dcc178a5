"""Frame rate of a page whose sixty widgets together receive ten thousand values a second.

Real widgets show values from a real server. A second measurement slows the page's processor by a
factor of six, to simulate an old phone. If one frame is too short to draw all sixty widgets, the
widgets take turns (``static/widgets/draw_scheduler.js``). Each widget is drawn with its newest
value at least once in twenty frames.
"""

import asyncio
import json
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from bench.browser_page import Cost, cost_of, kept, opened, running_browser, served
from bench.harness import Result
from bench.peers.feed import CHANNELS, is_whole
from bench.rig.programs import peer

__all__ = ["run"]

SLOWED = 6
LOOK_S, LOOK_IF_FULL_S = 3.0, 8.0
ROUNDS, ROUNDS_IF_FULL = 2, 9
COLUMNS, ROWS = 10, 6
EVERY = 3
"""The page receives and shows only every third signal of the robot."""
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
"""Widget, input and unit of each signal."""
# A hidden cell is not drawn, so all sixty must be visible and live.
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
    """Return the robot's profile, with its signals, one message and sixty widgets."""
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
    """Count the frames."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        port = stack.enter_context(peer("feed.py"))
        ours = stack.enter_context(served(port, document(), Path(folder)))
        return asyncio.run(_count(ours, seconds, rounds))


async def _count(ours: str, seconds: float, rounds: int) -> list[Result]:
    normal: list[Cost] = []
    slowed: list[Cost] = []
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds):
            async with opened(browser, ours) as one:
                await one.page.wait_for_function(READY, arg=COLUMNS * ROWS)
                normal.append(await cost_of(one, seconds))
                slowed.append(await cost_of(one, seconds, slowed=SLOWED))
    return [
        kept("60 widgets", normal),
        kept("60 widgets, at a sixth of the processor's speed", slowed),
    ]
