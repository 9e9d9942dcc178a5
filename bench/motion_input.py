"""Time from a release until the robot receives the stop, for each of the twelve ways to release.

A real Chromium drives a robot through a real ``urc serve`` with its guard. The robot stores the
time at which each byte arrives. Each time is measured on the machine's monotonic clock, from the
page's event until the stop's first byte arrives at the robot. The lease lasts one second, so a stop
after its expiry would be obvious. A late trial is repeated if the machine caused the delay.
"""

import asyncio
import os
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import NamedTuple

from bench.browser_page import SIZE, Opened, opened, running_browser
from bench.figures import distribution, tell
from bench.harness import Result
from bench.rig.programs import Heard, Robots, Server
from tests.e2e.motion.driving import LEFT, push
from tests.e2e.motion.test_input import renderers_of
from tests.e2e.motion.ways import WAYS, start_over

__all__ = ["run"]

EACH, EACH_IF_FULL = 5, 50
MOST_TIMES = 3
"""Maximum number of trials, as a multiple of the required number, if trials are invalid."""
MOST_MS = 100.0
WAIT_S = 15.0
DOCUMENT = """\
urc: 1
kind: robot
name: hand
title: Hand
summary: A robot that is let go of.
transports:
  wire:
    { type: tcp, host: 127.0.0.1, port: PORT, framing: { type: delimiter, tx: LF, rx: LF } }
commands:
  go:
    send: "M {{ speed }}"
    args: { speed: { min: -1, max: 1, default: 0 } }
    hold: { repeat: 20ms, lease: 1s, release: { speed: 0 }, watchdog: none }
widgets:
  stick:
    use: joystick
    bind: { moved: { command: go, args: { x: speed } } }
    options: { axes: x }
interfaces:
  default: { grid: "stick" }
"""
EVENTS = {
    "pointerup": "pointerup",
    "pointercancel": "pointercancel",
    "lostpointercapture": "lostpointercapture",
    "blur": "blur",
    "hidden": "visibilitychange",
    "pagehide": "pagehide",
    "freeze": "freeze",
    "resize": "resize",
    "rotation": "orientationchange",
    "full screen": "fullscreenchange",
    "context menu": "contextmenu",
    "pad lost": "gamepaddisconnected",
}
"""DOM event that the page receives, keyed by the way to release."""
# Runs before the page's scripts, so that the page's own listeners run after these.
STAMP = f"""
window.stamps = {{}};
for (const kind of {list(EVENTS.values())}) {{
  addEventListener(kind, () => (window.stamps[kind] ??= performance.now()), true);
}}
"""


class Trial(NamedTuple):
    """One release."""

    stop_ms: float
    """Time from the event to the stop, in milliseconds; infinite if no stop arrived."""
    late_ms: float
    """Delay caused by the machine during the trial, in milliseconds."""

    @property
    def is_excused(self) -> bool:
        """Whether the machine's delay makes the trial invalid."""
        return 0 < self.stop_ms - MOST_MS <= self.late_ms


class Scene(NamedTuple):
    """A page, its robot, and a program that measures the machine's delays."""

    one: Opened
    robots: Robots
    witness: Robots
    """The program that measures its own late wake-ups, and the waits of the server, guard and
    browser for a processor."""


def run(*, full: bool) -> Sequence[Result]:
    """Release the control repeatedly in each way; compare the slowest stop with the limit."""
    each = EACH_IF_FULL if full else EACH
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"]))
        (folder / "hand.yaml").write_text(
            DOCUMENT.replace("PORT", str(robots.ports[0])), encoding="utf-8"
        )
        server = stack.enter_context(Server([folder / "hand.yaml"], folder / "data"))
        address = f"http://127.0.0.1:{server.port}/robots/hand/?key={server.key}"
        found = asyncio.run(_let_go(address, server.pid, robots, each))
    return [_told(way, trials, each) for way, trials in found.items()]


async def _let_go(address: str, server: int, robots: Robots, each: int) -> dict[str, list[Trial]]:
    found: dict[str, list[Trial]] = {way: [] for way in WAYS}
    async with (
        running_browser(is_whole=True) as browser,
        opened(browser, address, script=STAMP) as one,
    ):
        await one.page.wait_for_selector(LEFT)
        await one.page.wait_for_selector(".joystick[data-phase='idle']")
        watched = [f"pid:{number}" for number in (server, *renderers_of(os.getpid()))]
        with Robots(watched) as witness:
            scene = Scene(one, robots, witness)
            for way, trials in found.items():
                while sum(not trial.is_excused for trial in trials) < each:
                    trials.append(await _once(scene, way))
                    if len(trials) >= MOST_TIMES * each:
                        break
    return found


async def _once(scene: Scene, way: str) -> Trial:
    one, robots, witness = scene
    page = one.page
    await push(page)
    await asyncio.to_thread(robots.wait_until, lambda: _speed(robots) > 0, WAIT_S, "motion")
    await page.evaluate("window.stamps = {}")
    await WAYS[way](page)
    await page.wait_for_function("(kind) => window.stamps[kind] !== undefined", arg=EVENTS[way])
    event_ms = one.origin_ms + await page.evaluate("(kind) => window.stamps[kind]", EVENTS[way])
    await asyncio.to_thread(robots.wait_until, lambda: _speed(robots) == 0, WAIT_S, "the stop")
    from_ns, until_ns = round(event_ms * 1e6), time.monotonic_ns()
    stop = next((line for line in robots.since(0, from_ns) if _is_stop(line)), None)
    await start_over(page, *SIZE)
    late_ms = max(each.latest_ms(from_ns, until_ns) for each in (robots, witness))
    late_ms += witness.waited_ms(from_ns, until_ns)
    return Trial(inf if stop is None else stop.time_ns / 1e6 - event_ms, late_ms)


def _speed(robots: Robots) -> float:
    heard = robots.heard[0]
    return float(heard[-1].text[2:]) if heard else 0.0


def _is_stop(heard: Heard) -> bool:
    return float(heard.text[2:]) == 0


def _told(way: str, trials: Sequence[Trial], each: int) -> Result:
    times_ms = [one.stop_ms for one in trials if not one.is_excused]
    broken = sum(one > MOST_MS for one in times_ms)
    figures = {"way": way, "trials": len(times_ms), "broken": broken}
    figures["excused"] = len(trials) - len(times_ms)
    spread = distribution(times_ms, MOST_MS)
    spread.pop("histogram_ms", None)  # nearly all values would be in one bar
    tell({"figure": "motion_input", **figures, **spread})
    slowest = max(times_ms) if len(times_ms) >= each else inf
    return Result(
        name=f"motion: stop after {way}: slowest of {len(times_ms)} / {MOST_MS:g} ms",
        ratio=round(slowest / MOST_MS, 3),
        goal=1.0,
        baseline_ms=MOST_MS,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(times_ms),
    )
