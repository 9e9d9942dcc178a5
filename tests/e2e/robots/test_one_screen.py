"""Pages over a background fit one screen: all cells and sticks are on it, and STOP stands free."""

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import turned
from tests.e2e.keys import enter
from tests.e2e.processes import UrcProcess
from tests.e2e.robots.page_layouts import DRAWN, NAMES, SETTLE_S
from tests.effort import sampled

pytestmark = pytest.mark.anyio

SCREENS = ((1280, 720), (1280, 800), (1180, 820), (844, 390), (667, 375), (390, 844))
ROBOTS = 4
"""Robots in an everyday run."""
ONE_SCREEN = (Path(__file__).parent / "one_screen.js").read_text("utf-8")
INTERFACES = "[...document.querySelectorAll('[data-interface-choice] option')].map((o) => o.value)"
FREE = """() => {
  const [stop, reset] = ["[data-stop-button]", "[data-verb='reset']"].map(
    (name) => document.querySelector(name).getBoundingClientRect());
  return Math.hypot(
    Math.max(stop.left - reset.right, reset.left - stop.right, 0),
    Math.max(stop.top - reset.bottom, reset.top - stop.bottom, 0));
}"""
COVERED = """(cell) => [...cell.querySelectorAll("button, [role='slider']")]
  .filter((one) => one.checkVisibility({ visibilityProperty: true, opacityProperty: true }))
  .flatMap((one) => {
    const { left, top, width, height } = one.getBoundingClientRect();
    return [0.1, 0.5, 0.9].flatMap((across) => [0.1, 0.5, 0.9].map((down) =>
      document.elementFromPoint(left + across * width, top + down * height)))
      .filter((found) => !cell.contains(found))
      .map((found) => `${one.textContent.trim()} lies under ${found?.className}`);
  })"""
"""What covers the controls of an open question."""
LEAST_RESET_PX = 150
"""Distance of Reset from STOP, so that a finger that stops a robot never resets it."""


async def opened(page: Page, address: str, name: str, interface: str = "") -> None:
    """Open a robot's page, and wait until it is live."""
    query = f"?interface={interface}" if interface else ""
    await page.goto(f"{address.rstrip('/')}/robots/{name}/{query}")
    await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")


async def faults_of(page: Page) -> dict[str, list[str]]:
    """Return the faults of the open page on each screen that has any."""
    found = {}
    for size in SCREENS:
        await turned(page, size)
        await page.evaluate(DRAWN)
        await asyncio.sleep(SETTLE_S)
        if lines := await page.evaluate(ONE_SCREEN):
            found[f"{size[0]} x {size[1]}"] = lines
    return found


@pytest.mark.parametrize("name", sampled(NAMES, ROBOTS, "one screen"))
async def test_all_cells_and_sticks_are_on_the_screen_and_stop_stands_free(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path, name: str
) -> None:
    """Without scrolling, in each interface of the robot; Reset is far from STOP."""
    process = urc_process("demo", "--no-browser", "--port", "0", XDG_DATA_HOME=str(tmp_path))
    address = (await process.wait_for_async(r"dashboard (http://\S+)", 60.0))[1]
    page = await new_page()
    await enter(page.context, address)
    wrong = {}
    await opened(page, address, name)
    for interface in await page.evaluate(INTERFACES):
        await opened(page, address, name, interface)
        for screen, lines in (await faults_of(page)).items():
            wrong[f"{interface}, {screen}"] = lines
    if await page.locator("[data-stop-button]").count():
        await page.locator("[data-stop-button]").click()
        await expect(page.locator("[data-verb='reset']")).to_be_visible()
        for size in SCREENS:
            await turned(page, size)
            free = await page.evaluate(FREE)
            if free < LEAST_RESET_PX:
                wrong[f"stopped, {size[0]} x {size[1]}"] = [f"Reset is {free:.0f} px from STOP"]
    assert not wrong, json.dumps(wrong, indent=1, ensure_ascii=False)


async def test_an_open_question_lies_above_all_other_widgets(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """A finger that slides to confirm touches nothing else, not even next to a stick."""
    process = urc_process("demo", "--no-browser", "--port", "0", XDG_DATA_HOME=str(tmp_path))
    address = (await process.wait_for_async(r"dashboard (http://\S+)", 60.0))[1]
    page = await new_page()
    await enter(page.context, address)
    await page.set_viewport_size({"width": 390, "height": 844})
    await opened(page, address, "tello")
    for name in ("Takeoff", "Cut motors"):
        await page.get_by_role("button", name=name).first.click()
        question = page.locator(".urc-asking")
        await expect(question).to_have_count(1)
        assert await question.evaluate(COVERED) == [], name
        await page.keyboard.press("Escape")
        await expect(question).to_have_count(0)
