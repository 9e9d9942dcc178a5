"""What was wished before STOP and came after its reset: a real page, and what is on the wire."""

import asyncio
from functools import partial
from pathlib import Path

import pytest
from playwright.async_api import Page, Route, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_text
from tests.e2e.motion.driving import STOP
from tests.e2e.motion.test_moves import PROFILE, opened, served

pytestmark = pytest.mark.anyio

FINGER = PROFILE.replace(
    "sequences:",
    """\
  flip: { args: { angle: { min: 0, max: 100 } }, send: "FLIP {{ angle }}", moves: true }
  saw: { send: SAW, confirm: { level: hazardous, text: It saws. } }
sequences:""",
)
FINGER = (
    FINGER[: FINGER.index("widgets:")]
    + """\
widgets:
  live: { use: slider, bind: { change: flip } }
  later: { use: slider, bind: { change: flip }, options: { send: release } }
  dial: { use: knob, bind: { change: flip } }
  drawn: { use: button, bind: { press: fold }, options: { gesture: slide } }
  saw: { use: button, bind: { press: saw } }
interfaces:
  default: { grid: live later dial drawn saw }
"""
)
GUARDED = PROFILE.replace(
    "sequences:",
    """\
  drive:
    args: { speed: { min: -1, max: 1, default: 0 }, turn: { min: -1, max: 1, default: 0 } }
    send: "DRIVE {{ (speed * 100) | round | int }} {{ (turn * 100) | round | int }}"
    priority: realtime
    hold: { repeat: 50ms, release: { speed: 0, turn: 0 }, watchdog: none }
sequences:""",
)
GUARDED = (
    GUARDED[: GUARDED.index("widgets:")]
    + """\
widgets:
  stick: { use: joystick, bind: { moved: { command: drive, args: { x: speed, y: turn } } } }
  guard: { use: deadman }
interfaces:
  default: { grid: stick guard }
"""
)
REST_S = 0.4
"""Longer than anything takes from a page to the robot."""


def has_more(heard: list[str], than: int) -> bool:
    """Return whether the robot has heard more lines than so many."""
    return len(heard) > than


async def stopped_and_reset(page: Page) -> None:
    """Press STOP and Reset on a page."""
    await page.click(STOP)
    await until_text(page, "[data-stop-note]", "✓ sent ✓ latched")
    await page.click("[data-verb='reset']")
    await expect(page.locator("[data-stop-note]")).not_to_contain_text("latched")


async def laid_on(page: Page, target: str, share: float) -> tuple[float, float]:
    """Put a hand on an element and draw it a little; return where it is then."""
    box = await page.locator(target).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] * share, box["y"] + box["height"] / 2
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x + 5, y, steps=2)
    return x, y


async def test_a_finger_that_was_there_before_stop_sets_nothing_after_the_reset(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """On a slider, one that gives when it is let go, and a knob: it has to be put down anew."""
    async with served(tmp_path, FINGER) as (heard, address):
        page, other = await opened(new_page, address), await opened(new_page, address)
        for cell, part in enumerate(("slider-track", "slider-track", "knob-dial")):
            target = f"[data-cell='{cell}'] .{part}"
            x, y = await laid_on(page, target, 0.4)
            await stopped_and_reset(other)
            await asyncio.sleep(REST_S)
            before = len(heard)
            await page.mouse.move(x + 20, y - 10, steps=4)
            await page.mouse.up()
            await asyncio.sleep(REST_S)
            assert heard[before:] == [], target
            await laid_on(page, target, 0.6)
            await page.mouse.up()
            await until(partial(has_more, heard, before))


async def test_what_was_drawn_to_its_end_before_stop_is_not_given_by_letting_go(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """A button that is slid, and the yes to a hazard, which is not even asked about any more."""
    async with served(tmp_path, FINGER) as (heard, address):
        page, other = await opened(new_page, address), await opened(new_page, address)
        for cell, slide in ((3, "[data-cell='3'] .button-main"), (4, ".urc-ask .urc-slide")):
            if cell == 4:
                await page.click("[data-cell='4'] .button-main")
                await asyncio.sleep(0.6)  # no answer counts before it can have been read
            x, y = await laid_on(page, slide, 0.05)
            await page.mouse.move(x + 2000, y, steps=4)
            await stopped_and_reset(other)
            await asyncio.sleep(REST_S)
            await page.mouse.up()
            await asyncio.sleep(REST_S)
            assert heard == []
        await expect(page.locator(".urc-ask")).to_have_count(0)


async def test_while_its_dead_man_loads_or_has_failed_a_page_drives_nothing(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """A guard that is not there is no leave to drive."""
    async with served(tmp_path, GUARDED) as (heard, address):
        page = await opened(new_page, address)
        held: list[Route] = []

        def keep(route: Route) -> None:
            held.append(route)

        await page.route("**/widgets/deadman/widget.js*", keep)
        await page.reload(wait_until="commit")
        await page.locator("[data-cell='0'] [data-phase='idle']").wait_for()
        # Before the lease has arrived, the stick names the missing connection instead.
        await expect(page.locator("[data-who]")).to_have_text("No one drives")
        await driven_in_vain(page)
        assert set(heard) <= {"DRIVE 0 0"}
        new_page.allow(page, lambda fault: "deadman/widget.js" in fault)
        await held.pop().abort()
        await page.locator("[data-cell='1'] .urc-fault").wait_for()
        await driven_in_vain(page)
        assert set(heard) <= {"DRIVE 0 0"}


async def driven_in_vain(page: Page) -> None:
    """Push the stick for a while, and see it say why nothing moves."""
    await laid_on(page, "[data-cell='0'] .joystick-pad", 0.5)
    await page.mouse.move(10, 10)
    await expect(page.locator("[data-cell='0']")).to_contain_text("hold the dead-man control first")
    await asyncio.sleep(REST_S)
    await page.mouse.up()


async def test_escape_is_stop_while_something_is_held_wherever_the_focus_is(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Also where it means something else by itself, as in a field with words in it."""
    profile = GUARDED.replace("guard: { use: deadman }", "guard: { use: log }")
    async with served(tmp_path, profile) as (heard, address):
        page = await opened(new_page, address)
        await laid_on(page, "[data-cell='0'] .joystick-pad", 0.5)
        await page.mouse.move(400, 10)
        await until(lambda: any(line.startswith("DRIVE") for line in heard))
        words = page.locator("[data-cell='1'] input")
        await words.evaluate("(field) => { field.value = 'words'; field.focus(); }")
        await page.keyboard.press("Escape")
        await until_text(page, "[data-stop-note]", "✓ sent ✓ confirmed ✓ latched")
        await page.mouse.up()
