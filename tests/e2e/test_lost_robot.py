"""The card of a lost robot in a real browser: cause, next step, Try now; and widgets keep quiet."""

import pytest
from playwright.async_api import Page, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import Size, choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from urc.runtime.hub import LinkState
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

REFUSED = "nothing listens on 127.0.0.1:6789 (connection refused)"
CARD = ".urc-lost-card"


class SlowRobot(FakeRobot):
    """A robot whose first connection takes a while."""

    is_slow = True

    def link(self, state: LinkState, detail: str = "", *, age_s: float = 0.0) -> None:
        """Report a state; while the robot is slow, it is still connecting."""
        super().link("connecting" if self.is_slow else state, detail, age_s=age_s)


async def lose(page: Page, address: str, robot: FakeRobot) -> None:
    """Open the robot's page, then lose the robot."""
    await page.goto(f"{address}robots/puppet/")
    await until(lambda: robot.is_open)
    robot.link("lost", REFUSED)
    await expect(page.locator(CARD)).to_be_visible()


async def test_one_card_has_cause_and_next_step_and_tries_at_once(new_page: PageMaker) -> None:
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await lose(page, address, robot)
        await expect(page.locator(CARD)).to_contain_text("Cannot reach Puppet")
        await expect(page.locator(CARD)).to_contain_text("127.0.0.1:6789 refuses the connection.")
        await expect(page.locator(CARD)).to_contain_text("Is the robot's program running?")
        note = page.locator("[data-cell] [class*='-note']").first
        await expect(note).to_be_hidden()
        await page.get_by_role("button", name="Try now").click()
        await until(lambda: robot.reconnects == 1)
        robot.link("live")
        await expect(page.locator(CARD)).to_be_hidden()


async def test_the_card_stays_in_another_interface(new_page: PageMaker) -> None:
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await lose(page, address, robot)
        await page.locator("[data-interface-choice]").select_option("debug")
        await page.locator("[data-debug]:not([aria-busy])").wait_for()
        await expect(page.locator(CARD)).to_be_visible()


async def test_the_page_says_that_it_waits_for_the_first_connection(new_page: PageMaker) -> None:
    """Later, a lost connection has the card instead."""
    robot = SlowRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        waits = page.locator("[data-robot-connecting]")
        await expect(waits).to_have_count(1)
        said = "getComputedStyle(document.querySelector('[data-stage]'), '::after').content"
        assert "Connecting to Puppet" in await page.evaluate(said)
        robot.is_slow = False
        robot.link("live")
        await expect(waits).to_have_count(0)
        robot.link("lost", REFUSED)
        await expect(page.locator(CARD)).to_be_visible()
        robot.link("connecting")
        await expect(page.locator(CARD)).to_be_hidden()
        await expect(waits).to_have_count(0)


@pytest.mark.needs("axe")
@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_the_card_is_readable_and_whole_in_each_theme(
    new_page: PageMaker, size: Size
) -> None:
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await prepare(await new_page(size=size))
        await lose(page, address, robot)
        for theme in ("light", "dark", "sunlight", "night"):
            await choose_theme(page, theme)
            assert await faults(page) == []
        box = await page.locator(CARD).bounding_box()
        screen = page.viewport_size
        assert box is not None
        assert screen is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= screen["width"]
        assert abs(box["x"] * 2 + box["width"] - screen["width"]) <= 2
