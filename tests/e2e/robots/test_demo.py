"""`urc demo`: every robot on a card with a live picture, one tap away, and a clean end."""

from collections.abc import Callable

import pytest
from playwright.async_api import expect

from tests.e2e.axe import faults, prepare
from tests.e2e.conftest import PageMaker
from tests.e2e.processes import UrcProcess
from tests.e2e.robots.recording import FOLDER

pytestmark = pytest.mark.anyio

PATIENCE_MS = 30_000
ALL_SHOWN = """(robots) =>
  document.querySelectorAll(".urc-look[data-shows]:not([data-shows=''])").length === robots"""
TAPPED = "[data-robot-card='gpsd']"


@pytest.mark.needs("axe")
async def test_every_robot_has_a_live_picture_and_a_tap_drives_it(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess]
) -> None:
    """Pictures come while they are seen; the boat of gpsd goes round by itself."""
    process = urc_process("demo", "--no-browser", "--port", "0")
    address = (await process.wait_for_async(r"dashboard (http://\S+)", 60.0))[1]
    page = await prepare(await new_page())
    await page.goto(address)
    robots = len(list(FOLDER.glob("*.yaml")))
    await expect(page.locator(".urc-look")).to_have_count(robots)
    # High enough for all of them: a card that is out of sight is not asked about.
    await page.set_viewport_size({"width": 1600, "height": 6000})
    await page.wait_for_function(ALL_SHOWN, arg=robots, timeout=PATIENCE_MS)
    await page.set_viewport_size({"width": 820, "height": 1180})
    assert await faults(page) == []
    card = page.locator(TAPPED)
    await card.scroll_into_view_if_needed()
    before = await card.locator("img").get_attribute("src")
    await expect(card.locator("img")).not_to_have_attribute(
        "src", before or "", timeout=PATIENCE_MS
    )
    await card.get_by_role("link").click()
    badge = page.locator("[data-badge]")
    await expect(badge).to_have_attribute("data-state", "good", timeout=PATIENCE_MS)
    assert process.interrupt() == 0
