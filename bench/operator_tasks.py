"""Five tasks of an operator, by touch on a phone and by keys: counts and seconds, then and now.

The tasks are those of `tests.e2e.test_operator_tasks`, here with real servers and emulated robots.
They run on this version's pages, and on the pages of an earlier version without backgrounds, which
git gets out of the history. The seconds follow the keystroke-level model. They are the measured
time of the page and the robot, plus the model's times for choices, targets and keys.
"""

import asyncio
import io
import shutil
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from playwright.async_api import Browser

from bench.earlier_pages import EARLIER, WAYS, EarlierKeys, EarlierTouch
from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.programs import Program
from tests.e2e.browser import Size, running_browser
from tests.e2e.conftest import PageMaker
from tests.e2e.motion.driving import fingers_on
from tests.e2e.operator_input import OperatorInput, Told
from tests.e2e.operator_tasks import CARD, Hand, Keys, Touch

__all__ = ["run"]

ROOT: Final = Path(__file__).resolve().parents[1]
ROUNDS, ROUNDS_IF_FULL = 1, 3
FLEET, WITH_ALARM = 12, 6
HOLD = "hold: { repeat: 100ms,"
LEASE = "450ms"
"""The longest lease that is shorter than the watchdog of the robot's base, which is 500 ms."""
READY_S = 60.0
GUARD_MS = 3000
"""Time in which the guard of a robot starts; until then, no gesture drives."""
READY = """() => document.querySelector('.joystick')?.dataset.phase === 'idle'
  && /driv/.test(document.querySelector('[data-who]')?.textContent ?? '')"""
"""The stick is shown, and the page knows who drives; until then, a push has no effect."""
ROVER = """\
urc: 1
kind: robot
name: rover-{number:02}
title: Rover {number:02}
transports:
  wire: {{ type: tcp, host: 127.0.0.1, port: 9, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
signals:
  battery: {{ type: integer, unit: "%", min: 0, max: 100, limits: {{ low: 20, lolo: 10 }} }}
polls:
  - {{ every: 500ms, send: "B", reply: {{ regex: '^B (?P<battery>[0-9]+)$' }} }}
commands:
  drive:
    args: {{ speed: {{ min: -1, max: 1, default: 0 }}, turn: {{ min: -1, max: 1, default: 0 }} }}
    send: "D {{{{ speed }}}} {{{{ turn }}}}"
    hold: {{ repeat: 100ms, release: {{ speed: 0, turn: 0 }}, watchdog: none }}
widgets:
  battery: {{ use: battery, bind: {{ level: battery }} }}
  stick: {{ use: joystick, bind: {{ moved: {{ command: drive, args: {{ x: speed, y: turn }} }} }} }}
interfaces:
  default:
    grid: |
      battery
      stick
simulator:
  wire:
    - {{ match: '^B$', send: "B {level}" }}
"""
ALARM = "robot with an alarm: find, stop"
SWAP = "drive, swap the camera, let go"
TAKE = "controls of a screen that was left: take, drive, let go"
RESET = "STOP while driving: reset, drive on, let go"
SPEED = "slower while holding, let go"
TASKS = (ALARM, SWAP, TAKE, RESET, SPEED)
THEN, NOW = "then", "now"
DEVICES: Mapping[str, tuple[Size, Mapping[str, type[Hand]]]] = {
    "touch, phone": ("phone", {THEN: EarlierTouch, NOW: Touch}),
    "keys, desktop": ("desktop", {THEN: EarlierKeys, NOW: Keys}),
}
IMPOSSIBLE: Mapping[type[Hand], Sequence[str]] = {
    EarlierTouch: (SWAP, SPEED),
    EarlierKeys: (SWAP,),
}
"""Tasks for which the earlier pages have no way."""
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Version:
    """The version of the pages: its name, and the folder of its checkout."""

    name: str
    folder: Path

    def serve(self, data: Path, *arguments: str) -> tuple["Program", str]:
        """Start `urc serve` of this version with emulated robots; return it with its address."""
        command = [sys.executable, "-P", "-m", "urc.cli.main", "serve", *arguments, "--simulate"]
        options = ("--port", "0", "--data-dir", str(data))
        # PYTHONPATH comes before the editable installation of this checkout.
        program = _Served(["env", f"PYTHONPATH={self.folder}", *command, *options])
        return program, program.wait_for("dashboard", READY_S)[1]


class _Served(Program):
    def _end(self) -> None:
        if self.is_running:
            self._process.terminate()  # it does not end with its standard input
        super()._end()


def run(*, full: bool) -> Sequence[Result]:
    """Do the tasks on both versions' pages; store the result of each."""
    kept = Kept("operator_tasks-full" if full else "operator_tasks")
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        versions = (Version(THEN, _earlier(Path(folder, "earlier"))), Version(NOW, ROOT))
        for place in range(ROUNDS_IF_FULL if full else ROUNDS):
            for version in versions:
                for device in DEVICES:
                    asyncio.run(_round(version, device, place, Path(folder), kept))
    return _results([dict(row) for row in kept.end()])


def _earlier(folder: Path) -> Path:
    """Write the files of the earlier version."""
    command = ["git", "-C", str(ROOT), "archive", "--format=tar", EARLIER]
    done = subprocess.run(command, capture_output=True, timeout=60, check=False)
    if done.returncode:
        raise SystemExit(
            f"bench: operator_tasks: git has no version {EARLIER}: run `git fetch --unshallow`"
        )
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as files:
        files.extractall(folder, filter="data")
    return folder


async def _round(version: Version, device: str, place: int, folder: Path, kept: Kept) -> None:
    """Do the tasks that are not stored yet, each in a new browser and on a new server."""
    done = {row["task"] for row in kept.rows if _key(row) == (version.name, device, place)}
    size, kinds = DEVICES[device]
    for task in (one for one in TASKS if one not in done):
        async with running_browser() as browser:
            row = await _done(browser, version, task, (size, kinds[version.name]), folder)
        kept.add({"version": version.name, "device": device, "round": place, "task": task, **row})


def _key(row: Mapping[str, object]) -> tuple[object, object, object]:
    return row["version"], row["device"], row["round"]


async def _done(
    browser: Browser, version: Version, task: str, as_: tuple[Size, type[Hand]], folder: Path
) -> Row:
    """Return the account of one task; only `touches: None` if the pages have no way to do it."""
    size, kind = as_
    if task in IMPOSSIBLE.get(kind, ()):
        return {"touches": None}
    with tempfile.TemporaryDirectory(dir=folder) as data:
        arguments = (_fleet if task == ALARM else _turtlebot)(Path(data), version)
        program, address = version.serve(Path(data, "urc"), *arguments)
        maker = PageMaker(browser)
        with closing(program):
            try:
                hand = await _hand(maker, size, kind)
                await _do(hand, maker, version, task, address)
                return hand.input.account()
            finally:
                await maker.close()


def _turtlebot(folder: Path, version: Version) -> list[str]:
    """Copy the robot's documents with the longest lease, so that no pause ends a gesture."""
    robots = folder / "robots"
    shutil.copytree(version.folder / "robots", robots)
    file = robots / "drivers/ros-base.yaml"
    text = file.read_text("utf-8")
    assert text.count(HOLD) == 1, file
    file.write_text(text.replace(HOLD, f"{HOLD} lease: {LEASE},"), "utf-8")
    return [str(robots / "turtlebot4.yaml")]


def _fleet(folder: Path, version: Version) -> list[str]:
    """Write the documents of twelve robots, of which one has an alarm; return the arguments."""
    found = []
    for number in range(FLEET):
        file = folder / f"rover-{number:02}.yaml"
        file.write_text(ROVER.format(number=number, level=7 if number == WITH_ALARM else 80))
        found.append(str(file))
    return found if version.name == THEN else [*found, "--monitor-alarms"]


async def _hand(maker: PageMaker, size: Size, kind: type[Hand]) -> Hand:
    page = await maker(size=size)
    await page.emulate_media(reduced_motion="reduce")
    told = Told(page)
    return kind(OperatorInput(page, await fingers_on(page)), told)


async def _do(hand: Hand, maker: PageMaker, version: Version, task: str, address: str) -> None:
    """Open the page at which the task begins, and do the task."""
    menu, _, key = address.partition("?key=")
    if task == ALARM:
        await hand.page.goto(f"{menu}?key={key}")
        card = CARD if version.name == NOW else WAYS
        await hand.page.locator(card).locator("visible=true").first.wait_for()
        await hand.stop_the_robot_with_an_alarm()
        assert hand.page.url.endswith(f"/rover-{WITH_ALARM:02}/"), hand.page.url
        return
    robot = f"{menu}robots/turtlebot4/?key={key}"
    if task == TAKE:
        left = await maker(size="desktop")
        await left.goto(robot)
        await left.locator("[data-verb='take']").click()
        await left.locator("[data-verb='leave']").wait_for()
    await hand.page.goto(robot)
    if task != TAKE:
        await hand.page.wait_for_function(READY)
        await hand.page.wait_for_timeout(GUARD_MS)
    tasks = {
        SWAP: hand.swap_the_camera,
        TAKE: hand.take_over,
        RESET: hand.drive_after_stop,
        SPEED: hand.slow_down,
    }
    await tasks[task]()


def _results(rows: Sequence[Row]) -> list[Result]:
    results = []
    for device in DEVICES:
        totals = {THEN: 0.0, NOW: 0.0}
        for task in TASKS:
            found = {
                name: [
                    row
                    for row in rows
                    if (row["version"], row["device"], row["task"]) == (name, device, task)
                ]
                for name in (THEN, NOW)
            }
            figures = {name: _middle(these) for name, these in found.items()}
            columns = {name: _told(one) for name, one in figures.items()}
            tell({"figure": "operator_tasks", "task": task, "device": device, **columns})
            if all(figures.values()):
                for name, one in figures.items():
                    totals[name] += one["model_s"]
        results.append(_result(device, totals, len(rows)))
    return results


def _middle(rows: Sequence[Row]) -> dict[str, float]:
    """Return the median of each count and time; nothing if the task could not be done."""
    if not rows or rows[0]["touches"] is None:
        return {}
    return {
        name: statistics.median(row[name] for row in rows)
        for name in ("touches", "swipes", "keys", "machine_s", "model_s")
    }


def _told(figures: Mapping[str, float]) -> str:
    """Return the counts and the seconds as text."""
    if not figures:
        return "not possible"
    counts = (
        f"{figures[key]:g} {one if figures[key] == 1 else many}"
        for key, one, many in (
            ("touches", "tap", "taps"),
            ("swipes", "swipe", "swipes"),
            ("keys", "key", "keys"),
        )
        if figures[key]
    )
    return f"{', '.join(counts)}; {figures['model_s']:.1f} s"


def _result(device: str, totals: Mapping[str, float], rounds: int) -> Result:
    """Compare the sums of the tasks that both versions can do."""
    return Result(
        name=f"operator tasks, {device}: seconds now / in the earlier version",
        ratio=round(totals[NOW] / totals[THEN], 3),
        goal=1.0,
        baseline_ms=round(totals[THEN] * 1000, 1),
        subject_ms=round(totals[NOW] * 1000, 1),
        spread=1.0,
        rounds=rounds,
    )
