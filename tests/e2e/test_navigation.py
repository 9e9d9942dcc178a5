"""Nav2 on the emulated TurtleBot 4, through a real server, bridge, guard and browser."""

from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dev_pages import Start
from tests.e2e.motion.driving import centre

pytestmark = pytest.mark.anyio

PLACE = "document.querySelector('.map-text').textContent"
STOP = "[data-stop-button]"


async def opened(page: Page, urc_process: Start, data: Path) -> None:
    """Open the page with the map; return when the map has arrived."""
    words = ("serve", "turtlebot4", "--simulate", "--port", "0", "--data-dir", str(data))
    address = str((await urc_process(*words).wait_for_async(r"(http://\S+)"))[1])
    await page.goto(address)
    start = address.split("?")[0].rstrip("/")
    await page.goto(f"{start}/robots/turtlebot4/?interface=navigation")
    await page.wait_for_function(f"() => {PLACE}.startsWith('x ')", timeout=60_000)
    await expect(page.locator(".map-note")).to_have_text("", timeout=30_000)


async def until_still(page: Page) -> str:
    """Return the place of the robot once it no longer changes, which lasts at most ten seconds."""
    last = ""
    for _ in range(10):
        now = str(await page.evaluate(PLACE))
        if now == last:
            return now
        last = now
        await page.wait_for_timeout(1000)
    raise AssertionError(f"the robot is still moving at {last}")


async def test_a_goal_on_the_map_is_driven_to_and_stop_cancels_it(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    page = await new_page("desktop")
    await opened(page, urc_process, tmp_path / "data")
    began = await page.evaluate(PLACE)
    x, y = await centre(page, ".map-area")
    await page.mouse.click(x - 150, y + 60)
    await expect(page.locator(".map-words")).to_contain_text("Go to x -")
    await page.wait_for_timeout(1500)
    assert await page.evaluate(PLACE) == began, "it moved before the operator had confirmed it"
    await page.get_by_role("button", name="Go there").click()
    await page.wait_for_function(f"() => {PLACE} !== {began!r}", timeout=30_000)
    # The plan is drawn as the first path of the map.
    await page.wait_for_function(
        "() => [...document.querySelectorAll('.map-area path[stroke-width=\"4\"]')]"
        ".some((one) => /^M[^L]*L/.test(one.getAttribute('d') ?? ''))",
        timeout=30_000,
    )
    await expect(page.locator(".map-words")).to_contain_text("On the way to x -")
    # Another goal can be chosen meanwhile; the first one is not lost by that.
    await page.mouse.click(x + 100, y + 60)
    await expect(page.locator(".map-words")).to_contain_text("Go to x ")
    await page.get_by_role("button", name="Cancel", exact=True).click()
    await page.locator(STOP).first.click()
    await expect(page.locator(".map-words")).to_contain_text("cancelled", timeout=10_000)
    there = await until_still(page)
    await page.wait_for_timeout(2000)
    assert await page.evaluate(PLACE) == there


async def test_a_route_on_the_map_is_paused_and_continued_and_stop_cancels_it(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    page = await new_page("desktop")
    await opened(page, urc_process, tmp_path / "data")
    words = page.locator(".map-words")
    x, y = await centre(page, ".map-area")
    await page.get_by_role("button", name="Draw a route").click()
    for right, down in ((-150, 60), (100, 60), (150, 0)):
        await page.mouse.click(x + right, y + down)
    await page.get_by_role("button", name="Send …").click()
    await page.get_by_role("button", name="Send", exact=True).click()
    await expect(words).to_contain_text("On the way to waypoint 1 of 3")
    began = await page.evaluate(PLACE)
    await page.wait_for_function(f"() => {PLACE} !== {began!r}", timeout=30_000)
    await page.get_by_role("button", name="Pause", exact=True).click()
    await expect(words).to_contain_text("Paused · Waypoints left: 3", timeout=10_000)
    paused = await until_still(page)
    await page.wait_for_timeout(2000)
    assert await page.evaluate(PLACE) == paused
    await page.get_by_role("button", name="Continue …").click()
    await page.get_by_role("button", name="Send", exact=True).click()
    await expect(words).to_contain_text("On the way to waypoint 1 of 3")
    await page.wait_for_function(f"() => {PLACE} !== {paused!r}", timeout=30_000)
    await page.locator(STOP).first.click()
    await expect(words).to_contain_text("cancelled", timeout=10_000)
    await expect(words).to_contain_text("Waypoints left: 3")
    there = await until_still(page)
    await page.wait_for_timeout(2000)
    assert await page.evaluate(PLACE) == there
