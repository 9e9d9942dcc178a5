"""The screen of the device in a real browser: all of it, awake while one drives, what is felt."""

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard
from tests.e2e.motion.driving import LEFT, calmly_driven, fire, push
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

STUBS = """
Object.defineProperty(document, "fullscreenEnabled", { get: () => false });
window.felt = [];
navigator.vibrate = (pattern) => felt.push(pattern);
window.locks = [];
Object.defineProperty(navigator, "wakeLock", { value: { request: async (kind) => {
  const lock = { kind, released: false, release: async () => { lock.released = true; } };
  locks.push(lock);
  return lock;
} } });
"""


REFUSE = """
Object.defineProperty(navigator, "wakeLock", { value: { request: async () => { throw 0; } } });
"""


async def test_the_screen_stays_on_while_this_page_drives(new_page: PageMaker) -> None:
    """It is asked again when the page comes back; and a hand feels that it holds."""
    async with calmly_driven() as (robot, address):
        page = await new_page()
        new_page.allow(page, lambda text: "WebSocket" in text)
        await page.add_init_script(STUBS)
        await page.goto(address)
        await page.wait_for_function("() => document.querySelector('.joystick')?.dataset.phase")
        await expect(page.locator("[data-fullscreen]")).to_be_hidden()
        await push(page)
        await robot.until_moving()
        await page.wait_for_function("() => locks.length === 1 && felt.length > 0")
        await fire(page, "locks[0].released = true")  # as a browser does with a hidden page
        await fire(page, "document.dispatchEvent(new Event('visibilitychange'))")
        await page.wait_for_function("() => locks.length === 2")
        await page.mouse.up()
        await page.get_by_role("button", name="Release").click()
        await page.wait_for_function("() => locks[1].released")


async def test_a_screen_that_may_go_dark_is_told(new_page: PageMaker) -> None:
    """Driving goes on without, and the note moves no stick under the finger."""
    async with calmly_driven() as (robot, address):
        page = await new_page()
        new_page.allow(page, lambda text: "WebSocket" in text)
        await page.add_init_script(REFUSE)
        await page.goto(address)
        await page.wait_for_function("() => document.querySelector('.joystick')?.dataset.phase")
        stick = page.locator(LEFT)
        before = await stick.bounding_box()
        await push(page)
        await robot.until_moving()
        await expect(page.locator("[data-note]")).to_contain_text("The screen may go dark")
        assert await stick.bounding_box() == before
        await page.mouse.up()
        await robot.until_stopped()


async def test_full_screen_where_a_browser_has_it(new_page: PageMaker) -> None:
    """One button, both ways."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        button = page.get_by_role("button", name="Full screen")
        await button.click()
        await expect(button).to_have_attribute("aria-pressed", "true")
        await button.click()
        await expect(button).to_have_attribute("aria-pressed", "false")


async def test_no_log_moves_what_steers(new_page: PageMaker) -> None:
    """However much is told: it scrolls in its panel, and the page stays as high as the screen."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        cell = page.locator("[data-cell='0']")
        await cell.wait_for()
        before = await cell.bounding_box()
        for number in range(60):
            robot.log(f"line {number} of a robot that is silent now and then")
        await page.locator("[data-log] > li").nth(59).wait_for(state="attached")
        assert await cell.bounding_box() == before
        await page.locator("[data-badge-why]").click()
        await page.locator("[data-log] > li").nth(0).wait_for()
        assert await cell.bounding_box() == before
        assert await page.evaluate("document.documentElement.scrollHeight <= innerHeight")
