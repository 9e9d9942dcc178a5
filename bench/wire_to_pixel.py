"""From the robot's line to the page's write, and from the pointer to the robot's line.

A robot tells its clock 50 times a second; the age of a value counts at the end of the callback
that wrote it into the page. What nothing can be faster than is half a display frame. The page by
hand is told beside it. The other way a synthetic pointer pushes a stick; its time begins with the
event's own stamp and ends when the robot has the line that it changed. That is done in a secure
context, such as this machine's own address, where browsers have raw events, and over plain http
from a name, as in a local network, where they have none. How much of it is the browser's, a stick
by hand says, which hands on each raw event and does nothing else.
"""

import asyncio
import json
import statistics
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from playwright.async_api import Browser

from bench.browser_ages import TooFew, ages
from bench.browser_page import (
    FRAME_MS,
    Opened,
    at_share,
    opened,
    peer,
    running_browser,
    served,
)
from bench.browser_peers import CLOCK
from bench.harness import Result
from bench.rig.programs import Heard, Robots
from tests.e2e.browser import PLAIN_HOST

__all__ = ["run"]

PIXEL_GOAL = 1.15
RAW_MS, PLAIN_MS = 1.0, 7.0
HAND_GOAL = 1.15
HAND, OURS, RAW, PLAIN = "by hand", "URC", "URC, raw events", "URC, plain http"
RATE_HZ = 50
LOOK_S, LOOK_IF_FULL_S = 3.0, 15.0
MOVES, MOVES_IF_FULL = 50, 300
ROUNDS, ROUNDS_IF_FULL = 3, 9
LEAST_SHARE = 0.5
GOLDEN = 0.6180339887
HELD_S = 5.0
PRESSES = 4
STEPS = 20
STICK = """\
commands:
  go:
    send: "M {{ value }}"
    args: { value: { type: integer, min: -1000, max: 1000 } }
    hold: { repeat: 10ms, release: { value: 0 }, watchdog: none }
widgets:
  stick:
    use: joystick
    bind: { moved: { command: go, args: { x: value } } }
    options: { axes: x, dead_zone: 0, expo: 0 }
interfaces:
  default: { grid: "stick" }
"""
READY = """
() => document.querySelector("[data-who]")?.textContent.match(/drive/)
  && document.querySelector(".urc-cell [data-phase]")?.dataset.phase === "idle"
"""
EVENTS = """
window.benchMoves = [];
for (const name of ["pointerrawupdate", "pointermove"]) {
  addEventListener(name, (event) => {
    if (window.benchMoves.at(-1)?.[1] !== event.clientY) {
      window.benchMoves.push([event.timeStamp, event.clientY]);
    }
  }, true);
}
"""


@dataclass(frozen=True, slots=True)
class Stick:
    """A page with a stick, and the robot that it moves."""

    address: str
    robot: int
    is_secure: bool = True


def run(*, full: bool) -> Sequence[Result]:
    """Compare the way to the page with half a frame, the way to the robot with its limits."""
    seconds = LOOK_IF_FULL_S if full else LOOK_S
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    moves = MOVES_IF_FULL if full else MOVES
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        works = [Path(folder) / name for name in ("clock", "stick")]
        for work in works:
            work.mkdir()
        clock = stack.enter_context(peer("robot.py", RATE_HZ))
        by_hand = f"http://127.0.0.1:{stack.enter_context(peer('plain.py', clock))}/"
        ours = stack.enter_context(served(clock, CLOCK, works[0]))
        robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"] * 2))
        stick = stack.enter_context(served(robots.ports[0], STICK, works[1]))
        bare = stack.enter_context(peer("stick.py", robots.ports[1]))
        sticks = {
            HAND: Stick(f"http://127.0.0.1:{bare}/", 1),
            RAW: Stick(stick, 0),
            PLAIN: Stick(stick.replace("127.0.0.1", PLAIN_HOST), 0, is_secure=False),
        }
        pages = {HAND: by_hand, OURS: ours}
        return asyncio.run(_measure(pages, sticks, robots, seconds, moves, rounds))


async def _measure(
    pages: Mapping[str, str],
    sticks: Mapping[str, Stick],
    robots: Robots,
    seconds: float,
    moves: int,
    rounds: int,
) -> list[Result]:
    shown: dict[str, list[list[float]]] = {name: [] for name in pages}
    ways: dict[str, list[list[float]]] = {name: [] for name in sticks}
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds):
            for name, address in pages.items():
                shown[name].append(await _written(browser, name, address, seconds))
            for name, stick in sticks.items():
                ways[name].append(await _pushed(browser, stick, robots, moves))
    for name, looks in shown.items():
        _tell(f"wire to write, {name}", looks)
    for name, looks in ways.items():
        _tell(f"pointer to wire, {name}", looks)
    by_hand = statistics.median(statistics.median(look) for look in ways[HAND])
    return [
        _result("wire to page, p50 / half a frame", PIXEL_GOAL, FRAME_MS / 2, shown[OURS]),
        _result("pointer to wire, secure context, p50 / 1 ms", 1.0, RAW_MS, ways[RAW]),
        _result("pointer to wire, secure context, p50 / by hand", HAND_GOAL, by_hand, ways[RAW]),
        _result("pointer to wire, plain, p50 / 7 ms", 1.0, PLAIN_MS, ways[PLAIN]),
    ]


async def _written(browser: Browser, name: str, address: str, seconds: float) -> list[float]:
    async with opened(browser, address) as one:
        await ages(one, 0.5, 0.0)  # what a page does at its start is over
        try:
            return await ages(one, seconds, RATE_HZ, by="write")
        except TooFew as problem:
            raise SystemExit(f"bench: wire_to_pixel: {name}: {problem}") from problem


async def _pushed(browser: Browser, stick: Stick, robots: Robots, moves: int) -> list[float]:
    """Push the stick; return how long each push took to the robot, in milliseconds."""
    heard = robots.heard[stick.robot]
    async with opened(browser, stick.address, script=EVENTS) as one:
        if await one.page.evaluate("() => isSecureContext") != stick.is_secure:
            raise SystemExit(f"bench: wire_to_pixel: {stick.address} is no page of its kind")
        await one.page.wait_for_function(READY)
        begun = len(heard)
        times = await _push(one, robots, heard, begun, moves)
        await one.page.mouse.up()
    with robots.changed:
        taken = _taken(times, heard[begun:])
    if len(taken) < moves * LEAST_SHARE:
        raise SystemExit(f"bench: wire_to_pixel: {len(taken)} of {moves} pushes came to the robot")
    return taken


async def _push(
    one: Opened, robots: Robots, heard: Sequence[Heard], begun: int, moves: int
) -> list[float]:
    """Return when the pointer moved, by the monotonic clock in milliseconds."""
    page = one.page
    box = await page.locator(".joystick-pad").bounding_box()
    if box is None:
        raise SystemExit("bench: wire_to_pixel: the page has no stick")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def is_moving() -> bool:
        return any(not line.text.endswith(" 0") for line in heard[begun:])

    for tries_left in reversed(range(PRESSES)):
        await page.mouse.move(x, y)
        await page.mouse.down()
        await page.mouse.move(x, y - STEPS)
        try:
            what = "the stick moves the robot"
            await asyncio.to_thread(robots.wait_until, is_moving, HELD_S, what)
            break
        except AssertionError as problem:
            # A gesture that was stopped, as on a machine that stood still, is begun anew by hand.
            await page.mouse.up()
            if not tries_left:
                raise SystemExit(f"bench: wire_to_pixel: {problem}") from problem
    await page.evaluate("() => { window.benchMoves = []; }")
    for number in range(moves):
        await page.mouse.move(x, y - STEPS - 2 * (number % STEPS + 1))
        # The time between them is never the same, so that no phase of the display is favoured.
        await asyncio.sleep(0.03 + number * GOLDEN % 1 * FRAME_MS / 1000)
    found: list[tuple[float, float]] = await page.evaluate("() => window.benchMoves")
    return [one.origin_ms + at for at, _ in found]


def _taken(times: Sequence[float], heard: Sequence[Heard]) -> list[float]:
    """Return the time from each move to the first line after it that says something else."""
    news = [line.time_ns / 1e6 for before, line in pairwise(heard) if line.text != before.text]
    taken = []
    for at, following in zip(times, [*times[1:], float("inf")], strict=True):
        first = next((time for time in news if time >= at), None)
        if first is not None and first < following:
            taken.append(first - at)
    return taken


def _tell(name: str, looks: Sequence[Sequence[float]]) -> None:
    every = sorted(each for look in looks for each in look)
    said = {"p50_ms": at_share(every, 0.5), "p99_ms": at_share(every, 0.99)}
    print(json.dumps({"wire_to_pixel": name, **said, "count": len(every)}), flush=True)


def _result(name: str, goal: float, most_ms: float, looks: Sequence[Sequence[float]]) -> Result:
    medians = [statistics.median(look) for look in looks]
    middle = statistics.median(medians)
    return Result(
        name=name,
        ratio=round(middle / most_ms, 3),
        goal=goal,
        baseline_ms=round(most_ms, 2),
        subject_ms=round(middle, 3),
        spread=round(max(medians) / middle, 2),
        rounds=len(looks),
    )
