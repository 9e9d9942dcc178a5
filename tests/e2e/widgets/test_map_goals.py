"""Goals in a real browser: a running goal beside a kept route, and lost goals of all pages."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from playwright.async_api import Locator, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from tests.e2e.motion.driving import centre
from tests.e2e.widgets.test_map import AT, POSE
from urc.model.driver import Argument, Command
from urc.model.interface import WidgetUse
from urc.model.payload import Envelope, WriteSpec
from urc.model.values import Reading
from urc.protocol.events import Replied
from urc.runtime.command_failed import CommandFailed
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

LISTS = {name: Argument(name, "array") for name in ("xs", "ys", "yaws")}
PLACE = {name: Argument(name, "number") for name in ("x", "y")}
COMMANDS = {
    "follow": Command("follow", "wire", WriteSpec("text"), LISTS, moves=True),
    "go": Command("go", "wire", WriteSpec("text"), PLACE, moves=True, title="Go to"),
    "end": Command("end", "wire", WriteSpec("text"), stops=True),
}
OUTPUTS = {"waypoints": "follow", "goto": "go", "end_route": "end", "end_goal": "end"}
BAND = ".urc-lost-goals"


class Walker(FakeRobot):
    """A ROS robot whose goals end when the test ends them."""

    def __init__(self) -> None:
        use = WidgetUse("m", "map", AT, OUTPUTS)
        super().__init__(dashboard_profile(signals=POSE, uses=[use], commands=COMMANDS))
        self.payloads = {
            "follow": Envelope("goal", {"action": "/follow"}, {}),
            "go": Envelope("goal", {"action": "/go"}, {}),
        }
        self.ways: list[asyncio.Future[None]] = []

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        reply = await super().command(name, arguments, **more)
        if name != "end":
            self.ways.append(asyncio.get_running_loop().create_future())
            await self.ways[-1]
        return reply


@asynccontextmanager
async def walked(page: Page) -> AsyncIterator[Walker]:
    """Show the map of a robot at 0, 0; 32 pixels are one metre."""
    robot = Walker()
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for name, value in (("px", 0.0), ("py", 0.0), ("turned", 0.0)):
            robot.set_reading(name, value)
        await until_text(page, ".map-text", "x 0.00 m, y 0.00 m")
        yield robot
        for way in robot.ways:
            if not way.done():
                way.set_result(None)


def button(page: Page, name: str) -> Locator:
    return page.get_by_role("button", name=name, exact=True)


async def tapped(page: Page, right: float, up: float) -> None:
    x, y = await centre(page, ".map-area")
    await page.mouse.click(x + 32 * right, y - 32 * up)


async def going(page: Page, robot: Walker) -> None:
    """Send the robot to a place, and wait until the page no longer waits for a quick reply."""
    count = len(robot.ways)
    await tapped(page, 2, 1)
    await button(page, "Go there").click()
    await until(lambda: len(robot.ways) == count + 1)
    await expect(page.locator(".map-words")).to_contain_text("On the way to x 2.0")


async def routed(page: Page, robot: Walker) -> None:
    count = len(robot.ways)
    await button(page, "Draw a route").click()
    await tapped(page, 1, 0)
    await tapped(page, 2, 0)
    await button(page, "Send …").click()
    await button(page, "Send").click()
    await until(lambda: len(robot.ways) == count + 1)
    await expect(page.locator(".map-words")).to_contain_text("On the way to waypoint 1 of 2")


async def test_a_running_goal_is_shown_beside_the_rest_of_a_paused_route(
    new_page: PageMaker,
) -> None:
    page = await new_page(size="desktop")
    async with walked(page) as robot:
        await routed(page, robot)
        await button(page, "Pause").click()
        robot.ways[0].set_exception(CommandFailed("refused", "the action was cancelled"))
        await until_text(page, ".map-words", "Paused · Waypoints left: 2")
        await going(page, robot)
        await expect(page.locator(".map-words")).to_contain_text("Waypoints left: 2")
        await expect(page.locator(".map-mark")).to_have_count(0)  # only waypoints have numbers
        await expect(button(page, "Continue …")).to_be_visible()
        await button(page, "Cancel goal").click()
        await until(lambda: [name for name, _ in robot.commands][-1] == "end")
        robot.ways[1].set_exception(CommandFailed("refused", "the action was cancelled"))
        await expect(page.locator(".map-words")).to_contain_text("Waypoints left: 2")
        await expect(page.locator(".map-mark")).to_have_count(2)


async def test_a_lost_goal_is_shown_on_all_pages_until_a_person_says_that_it_has_ended(
    new_page: PageMaker,
) -> None:
    """A newer goal hides it on the map, which shows where the robot goes, but not in the band."""
    page, other = await new_page(size="desktop"), await new_page(size="phone")
    async with walked(page) as robot:
        await routed(page, robot)
        robot.ways[0].set_exception(CommandFailed("disconnected", "the connection is lost"))
        await other.goto(page.url)
        text = "▲ The robot may still be on its way: follow · screen 1"
        for one in (page, other):
            await until_text(one, f"{BAND} p", text)
        await going(page, robot)
        await expect(page.locator(BAND)).to_contain_text("follow · screen 1")
        await button(other, "It has ended").click()
        for one in (page, other):
            await expect(one.locator(BAND)).to_have_count(0)
        assert [(one.command, one.is_lost) for one in robot.hub.goals] == [("go", False)]
        robot.ways[1].set_exception(CommandFailed("disconnected", "the connection is lost"))
        await until_text(page, f"{BAND} p", "▲ The robot may still be on its way: Go to · screen 1")
        robot.hub.settle_goals()
        await expect(page.locator(BAND)).to_have_count(0)
        await expect(page.locator(".map-bar")).not_to_have_attribute("data-moving", "")
