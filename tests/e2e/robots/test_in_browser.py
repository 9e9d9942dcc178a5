"""Robots that ship, in a real browser: connected, seen, commanded, driven, let go, left.

The robot is emulated behind real sockets, with the guard between, as in `urc demo`. The bytes that
reach it are held against the samples of its sheet; see `sheets.py`.
"""

import asyncio
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest
from playwright.async_api import Locator, Page, ViewportSize, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.gallery import CELLS, lasting_faults
from tests.e2e.robots.hands import Readings, fill, give, held, open_form, until
from tests.e2e.robots.recording import FOLDER, Overheard, alive
from tests.e2e.robots.sheets import (
    GOODBYES,
    STOPS,
    Sample,
    came,
    newest,
    samples,
    stopped,
)
from urc.model.values import Reading

pytestmark = pytest.mark.anyio

NAMES = sorted(file.stem for file in FOLDER.glob("*.yaml"))
DESKTOP = ViewportSize(width=1440, height=900)
SIZES = (ViewportSize(width=320, height=640), ViewportSize(width=667, height=375), DESKTOP)
"""The narrowest phone that WCAG 1.4.10 asks for, one on its side, and a large screen."""
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Resolves when widgets have been told of their new size."""
SLOWEST_S = 60.0
"""A signal that comes every eight seconds, on a machine that is busy."""
PATIENCE_MS = 30_000
LEAST_STEP_M = 0.1
PLACE = re.compile(r"[0-9] m|[0-9]°")
"""What a map writes that knows where the robot is: metres of its own map, or degrees."""

SWIMMERS = ("amphibot-ii", "amphibot-iii", "salamandra-i", "salamandra-ii")
ORDER = {
    "tello": ["enter", "takeoff", "move", "turn", "fly", "land", "emergency", "takeoff"],
    "create-2": ["start", "full", "dock", "safe"],
    "spot": ["claim", "power_on", "stand"],
    "ardupilot-rover": ["heartbeat", "set_mode", "arm"],
    "ur-e-series": ["power_on", "brake_release", "load", "play", "pause", "stop"],
    "ur-ros2": [
        *("to_servo", "take_twists", "run_servo", "jog", "take_joints", "jog_joints"),
        *("pause_servo", "to_goals"),
    ],
    **{name: ["start", "swim", "steer"] for name in SWIMMERS},
}
"""What must come before the other commands, which follow as they are declared."""
LAST = {name: ["power_off"] for name in ("spot", "ur-e-series", "ur-ros2")}
NAVIGATION = {"navigate", "stop_navigation", "place", "follow", "stop_route"}
"""Commands for Nav2, which `tests.e2e.test_navigation` gives on the map."""
WITHOUT = {
    "generic-ros2": NAVIGATION,
    "turtlebot3": NAVIGATION,
    "ur-ros2": {"move", "cancel", "go_back", "keep", "tool_mode", "joint_mode", "goal_mode"},
    "turtlebot4": {"stop_docking", "stop_undocking", *NAVIGATION},
}
"""Commands that are not given here. The docking of an emulated robot ends at once, and what has
ended cannot be given up. The goals of an arm take a list, and its sequences are buttons."""
ON_THE_WAY = {"plan", "plan_frame", "map_plan", "goal_x", "goal_y", "waypoint"}
LOCALISED = {"floor", "costs", "covariance", "footprint", "particles"}
PLACED = {"frames", "map_pose", "map_laser", "first_ray"}
SILENT = {
    "turtlebot4": ON_THE_WAY,
    "ur-ros2": {"kept"},
    **dict.fromkeys(("generic-ros2", "turtlebot3"), ON_THE_WAY | LOCALISED | PLACED),
}
"""Signals without a value: no goal is given, no position is remembered, and the setting for Nav2 is
off by default."""


class Stick(NamedTuple):
    """Something that is pushed on the default interface."""

    cell: str
    """Title of its cell."""
    pad: str
    """What is pushed there."""
    command: str
    moves: str
    """Signal that says where the robot is, or how it stands."""
    right: float = 0
    up: float = 60
    sees: str = ""
    """Signal with the picture of a camera, which changes as well."""
    least: float = LEAST_STEP_M
    """How far it goes where there is a map, in the unit of `moves`."""


STICKS = {
    **{
        name: Stick("Drive", ".joystick-pad", "drive", "x")
        for name in ("generic-ros1", "generic-ros2", "turtlebot3")
    },
    "turtlebot4": Stick("Drive", ".joystick-pad", "drive", "x", sees="picture"),
    "absolem": Stick("Drive", ".joystick-pad", "drive", "x", sees="panorama"),
    **{name: Stick("Drive", ".axis-track", "swim", "joint_1") for name in SWIMMERS},
    "ardupilot-rover": Stick("Drive", ".joystick-pad", "sticks", "longitude", least=1e-5),
    "create-2": Stick("Drive", ".joystick-pad", "wheels", "left_ticks"),
    "roveo-mini": Stick("Drive", ".joystick-pad", "drive", "speed"),
    "spot": Stick("Drive", ".joystick-pad", "drive", "x", sees="picture"),
    "ur-ros2": Stick("Tool", ".joystick-pad", "jog", "tool_x", least=0.02),
    "tello": Stick("Height, turn", ".joystick-pad", "fly", "height"),
}
READY: dict[str, dict[str, Mapping[str, Reading]]] = {
    "absolem": {"enable": {"motors": True}, "set_brake": {"brake": False}},
    "ardupilot-rover": {"set_mode": {"mode": 0}},
    "spot": {"power_on": {}, "stand": {}},
    "turtlebot3": {"motors": {"power": True}},
    "ur-ros2": {
        **{name: {} for name in ("power_on", "brake_release", "play")},
        **{name: {} for name in ("to_servo", "take_twists", "run_servo")},
    },
    **{name: {"start": {}} for name in SWIMMERS},
}
"""What must be given last, so that it can be driven."""


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", NAMES)
async def test_a_robot_is_connected_seen_commanded_driven_and_left(
    name: str, new_page: PageMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that a person does with it, from the menu and back."""
    async with alive(name, tmp_path, monkeypatch) as robot:
        page = await new_page()
        readings = Readings(page)
        await page.goto(robot.address)
        await page.get_by_role("link", name=f"Connect to {robot.profile.title}").click()
        await is_whole(page)
        await each_interface(page, robot)
        await each_command(page, robot)
        await each_signal(page, robot, readings)
        if name in STICKS:
            await driven(page, robot, STICKS[name], readings)
        if name == "esp32-cam":
            await sees_itself_turn(page, readings)
        mark = robot.mark()
        await page.locator("[data-back]").click()
        await page.wait_for_url(robot.address)
        await until(lambda: robot.sessions == 0, lambda: "it is still connected")
        if name in GOODBYES:
            transport, word = GOODBYES[name]
            assert came(robot, {transport: word}, mark), robot.bytes_since(transport, mark)


async def is_whole(page: Page) -> None:
    """Wait until the page is live and every widget in its place."""
    badge = page.locator("[data-badge]")
    await expect(badge).to_have_attribute("data-state", "good", timeout=PATIENCE_MS)
    await page.wait_for_function(
        "() => [...document.querySelectorAll('[data-cell]')]"
        ".every((cell) => cell.dataset.error === '')"
    )


async def choose(page: Page, interface: str) -> None:
    """Open an interface, and wait until every widget of it is in place."""
    # Without the mark, the cells of the interface before would pass for those of this one.
    await page.locator("[data-stage] > *").first.evaluate("(el) => el.dataset.before = ''")
    await page.get_by_label("Interface").select_option(interface)
    await expect(page.locator("[data-before]")).to_have_count(0)
    await is_whole(page)


async def each_interface(page: Page, robot: Overheard) -> None:
    """Open every interface, on screens of all sizes, and with either hand."""
    for name in robot.profile.interfaces:
        await choose(page, name)
        for size in SIZES:
            await page.set_viewport_size(size)
            await page.evaluate(DRAWN)
            assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            assert await lasting_faults(page, CELLS) == [], f"{name} at {size}"
    await page.get_by_role("button", name="This device").click()
    for hand in ("left", ""):
        await page.locator(f"label:has([data-hand-choice][value='{hand}'])").click()
        await is_whole(page)
    await page.get_by_role("button", name="This device").click()
    await choose(page, "debug")
    await page.locator("[data-debug]:not([aria-busy])").wait_for()


def in_order(robot: Overheard) -> list[Sample]:
    """Return the samples in an order in which the robot takes them."""
    found = {one.command: one for one in samples(robot.profile)}
    last = LAST.get(robot.profile.name, [])
    first = [name for name in ORDER.get(robot.profile.name, []) if name in found]
    rest = [name for name in found if name not in first and name not in last]
    return [found[name] for name in (*first, *rest, *last)]


async def each_command(page: Page, robot: Overheard) -> None:
    """Give every command with the arguments of its sheet, and hold the bytes against it."""
    commands = robot.profile.driver.commands
    without = WITHOUT.get(robot.profile.name, set())
    todo = [one for one in in_order(robot) if one.command not in without]
    assert {one.command for one in todo} == set(commands) - without
    for sample in todo:
        if commands[sample.command].hold is None:
            await given(page, robot, sample)
        else:
            await held_and_let_go(page, robot, sample)
    for name, arguments in READY.get(robot.profile.name, {}).items():
        await give(page, commands[name], arguments)


async def given(page: Page, robot: Overheard, sample: Sample) -> None:
    """Send a command by its form."""
    mark = robot.mark()
    await give(page, robot.profile.driver.commands[sample.command], sample.arguments)
    await until(lambda: came(robot, sample.sent, mark), lambda: told(robot, sample, mark))


async def held_and_let_go(page: Page, robot: Overheard, sample: Sample) -> None:
    """Hold the button of a motion, with these values, and see them come and the stop after them."""
    mark = robot.mark()
    form = await open_form(page, sample.command)
    await fill(form, sample.arguments)
    button = form.get_by_role("button", name="Hold to move")
    await held(page, button, lambda: came(robot, sample.sent, mark))
    stop = STOPS[robot.profile.name, sample.command]
    await until(lambda: stopped(robot, sample.sent, stop, mark), lambda: told(robot, sample, mark))


def told(robot: Overheard, sample: Sample, mark: Mapping[str, int]) -> str:
    """Return what came instead."""
    heard = {
        name: robot.bytes_since(name, mark) or robot.messages_since(name, mark)
        for name in sample.sent
    }
    return f"{sample}: the robot got {heard}"


async def each_signal(page: Page, robot: Overheard, readings: Readings) -> None:
    """Look at every signal of the profile until it is shown as live; an image is asked for anew."""
    signals = robot.profile.driver.signals
    names = [name for name in signals if name not in SILENT.get(robot.profile.name, ())]
    readings.pictures.clear()  # what comes from now on is wanted by the table of signals
    end_s = time.monotonic() + SLOWEST_S
    while names := await page.evaluate(NOT_LIVE, names):
        assert time.monotonic() < end_s, f"not shown as live: {names}"
        await asyncio.sleep(0.15)  # rows are written ten times a second, and only those in sight
    for name in (one for one, signal in signals.items() if signal.type == "image"):
        await page.locator(f"[data-signal='{name}']").scroll_into_view_if_needed()
        await readings.until_picture(name)


NOT_LIVE = """(names) => {
  const row = (name) => document.querySelector(`[data-signal='${name}']`);
  const left = names.filter((name) => row(name)?.dataset.state !== "live");
  row(left[Math.floor(Math.random() * left.length)])?.scrollIntoView({ block: "center" });
  return left;
}"""
"""Return those that are not shown as live, and bring one of them into sight."""


async def sees_itself_turn(page: Page, readings: Readings) -> None:
    """Wait for several different pictures of a camera that nobody drives."""
    await choose(page, "default")
    await until(lambda: len(readings.pictures.get("picture", ())) > 3, lambda: "the same picture")


async def driven(page: Page, robot: Overheard, stick: Stick, readings: Readings) -> None:
    """Push the stick until the robot has moved, let go, and see the stop at its socket."""
    await choose(page, "default")
    before, mark = readings.values.get(stick.moves), robot.mark()
    if stick.sees:
        await until(lambda: bool(readings.pictures.get(stick.sees)), lambda: "no picture came")
    pictures = set(readings.pictures.get(stick.sees, ()))
    places = await shown_places(page)
    # The reason of a stop may take the place of the heading.
    heading = page.get_by_role("heading", name=stick.cell, include_hidden=True)
    pad = page.locator("[data-cell]", has=heading).locator(stick.pad)
    await expect(pad).to_be_visible()

    transport = robot.profile.driver.commands[stick.command].transport
    stop = STOPS[robot.profile.name, stick.command]

    def has_moved() -> bool:
        now = readings.values.get(stick.moves)
        is_told = newest(robot, transport, stop, mark) == "motion"
        # On a map a step must be longer than the last digit of the place.
        is_short = (
            places and before is not None and now is not None and abs(now - before) < stick.least
        )
        return is_told and now is not None and now != before and not is_short

    await held(page, pad, has_moved, right=stick.right, up=stick.up)
    await until(
        lambda: newest(robot, transport, stop, mark) == "stop",
        lambda: f"it was not stopped: {robot.bytes_since(transport, mark)!r}",
    )
    for text, before_text in places:
        await expect(text).not_to_have_text(before_text, timeout=PATIENCE_MS)
    if stick.sees:
        seen = readings.pictures[stick.sees]
        await until(lambda: bool(seen - pictures), lambda: "the picture is the same as before")


async def shown_places(page: Page) -> list[tuple[Locator, str]]:
    """Return where each map of the page says that the robot is: the place itself, not its value."""
    texts = await page.locator(".map-text").all()
    found = []
    for text in texts:
        await expect(text).to_contain_text(PLACE, timeout=PATIENCE_MS)
        found.append((text, await text.inner_text()))
    return found
