"""The night theme: pictures are as dim as the page, and full colour lasts for a moment."""

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.drawn import GREEN, plain
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio


async def filter_of(page: Page) -> str:
    """Return what the page does with the picture of the camera."""
    found: str = await page.locator(".camera-picture").evaluate(
        "(el) => getComputedStyle(el).filter"
    )
    return found


async def test_pictures_are_dim_at_night_and_full_for_a_moment(new_page: PageMaker) -> None:
    """The button stands there at night only."""
    signals = {"front": Signal("front", "image", stale_after_s=60)}
    use = WidgetUse("c", "camera", {"image": "front"})
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[use]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("front", plain(GREEN))
        await page.wait_for_selector(".camera[data-state='live']")
        full = page.get_by_role("button", name="Full colour for 5 s")
        assert await filter_of(page) == "none"
        await expect(full).to_be_hidden()
        await page.evaluate("document.documentElement.dataset.theme = 'night'")
        assert "brightness(0.45)" in await filter_of(page)
        await full.click()
        assert await filter_of(page) == "brightness(1)"
        await page.wait_for_selector(".camera:not([data-full])")
        assert "brightness(0.45)" in await filter_of(page)
