"""Pages as an app of the device: installable, and there when the server is not."""

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from urc.model.driver import Command, Hold
from urc.model.payload import WriteSpec
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

ACTIVE = "navigator.serviceWorker.ready.then((kept) => kept.active?.scriptURL)"


async def test_the_browser_finds_all_that_an_app_needs(new_page: PageMaker) -> None:
    """Chromium itself says whether the pages can be installed."""
    page = await new_page(is_kept=True)
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        await page.goto(address)
        devtools = await page.context.new_cdp_session(page)
        manifest = await devtools.send("Page.getAppManifest")
        assert manifest["url"] == f"{address}app.webmanifest"
        assert manifest["errors"] == []
        faults = await devtools.send("Page.getInstallabilityErrors")
        assert faults["installabilityErrors"] in (
            [],
            # Pages of tests are like private windows, from which nothing is installed.
            [{"errorId": "in-incognito", "errorArguments": []}],
        )


async def test_a_page_opens_without_its_server_and_says_so(new_page: PageMaker) -> None:
    """What was opened before opens again; it shows no value as live, and STOP says NO LINK."""
    page = await new_page(is_kept=True)
    new_page.allow(page, lambda text: "ERR_CONNECTION_REFUSED" in text or "WebSocket" in text)
    go = Command("go", "wire", WriteSpec("text"), hold=Hold(repeat_s=0.05))
    robot = FakeRobot(dashboard_profile(commands={"go": go}))
    async with running_dashboard(robot) as address:
        await page.goto(address)
        assert str(await page.evaluate(ACTIVE)).endswith("/sw.js")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("battery", 42)
        await expect(page.locator(".urc-grid")).to_contain_text("42")
    await page.reload()
    await expect(page.locator("[data-badge-text]")).to_have_text("No connection to URC")
    await expect(page.locator(".urc-grid")).not_to_contain_text("42")
    await page.click("[data-stop-button]")
    await expect(page.locator("[data-stop-note]")).to_contain_text("NO LINK")


async def test_what_moves_a_robot_is_never_kept(new_page: PageMaker) -> None:
    """Only pages and their files are."""
    page = await new_page(is_kept=True)
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        await page.goto(address)
        await page.evaluate(ACTIVE)
        await page.reload()
        await page.evaluate("fetch('/healthz').then((said) => said.text())")
        kept = await page.evaluate(
            "caches.open('urc-1').then((cache) => cache.keys())"
            ".then((all) => all.map((one) => new URL(one.url).pathname))"
        )
        assert "/static/core/tokens.css" in kept
        assert "/healthz" not in kept
