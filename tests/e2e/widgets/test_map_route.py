"""Routes on the map in a real browser: edited, sent, paused, continued and cleared."""

import asyncio
import math
import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from playwright.async_api import Locator, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.motion.driving import STOP, centre
from tests.e2e.widgets.test_map import AT, POSE, drag
from urc.model.driver import Argument, Command
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Reading, Signal
from urc.protocol.events import Replied
from urc.runtime.command_failed import CommandFailed
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

SIGNALS = {**POSE, "waypoint": Signal("waypoint", "integer", stale_after_s=60)}
LISTS = {name: Argument(name, "array") for name in ("xs", "ys", "yaws")}
COMMANDS = {
    "follow": Command("follow", "wire", WriteSpec("text"), LISTS, moves=True),
    "end": Command("end", "wire", WriteSpec("text"), stops=True),
}


class Follower(FakeRobot):
    """A robot whose route ends when the test ends it, or by the command that stops the robot."""

    way: asyncio.Future[None] | None = None
    is_deaf = False
    """Whether the robot ignores the end of its route."""

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        reply = await super().command(name, arguments, **more)
        if name == "follow":
            self.way = asyncio.get_running_loop().create_future()
            await self.way
        elif self.way is not None and not self.way.done() and not self.is_deaf:
            self.cancel()
        return reply

    def cancel(self) -> None:
        assert self.way is not None
        self.way.set_exception(CommandFailed("refused", "the action was cancelled"))

    @property
    def routes(self) -> list[Any]:
        return [given for name, given in self.commands if name == "follow"]


@asynccontextmanager
async def followed(page: Page) -> AsyncIterator[Follower]:
    """Show the map of a robot at 0, 0; 32 pixels are one metre."""
    use = WidgetUse(
        "m", "map", {**AT, "waypoint": "waypoint"}, {"waypoints": "follow", "end_route": "end"}
    )
    robot = Follower(dashboard_profile(signals=SIGNALS, uses=[use], commands=COMMANDS))
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for name, value in (("px", 0.0), ("py", 0.0), ("turned", 0.0)):
            robot.set_reading(name, value)
        await until_text(page, ".map-text", "x 0.00 m, y 0.00 m")
        yield robot
        if robot.way is not None and not robot.way.done():
            robot.way.set_result(None)


async def press(page: Page, name: str) -> None:
    await page.get_by_role("button", name=name, exact=True).click()


async def drawn(page: Page, *points: tuple[float, float]) -> None:
    """Draw a route by taps, from metres."""
    x, y = await centre(page, ".map-area")
    await press(page, "Draw a route")
    for right, up in points:
        await page.mouse.click(x + 32 * right, y - 32 * up)


async def sent(page: Page, robot: Follower) -> None:
    count = len(robot.routes)
    await press(page, "Send …")
    assert len(robot.routes) == count, "a route needs a second confirmation"
    await press(page, "Send")
    await until(lambda: len(robot.routes) == count + 1)


async def test_waypoints_are_aimed_by_a_drag_moved_in_order_and_deleted(
    new_page: PageMaker,
) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        await drawn(page, (3, 0))
        x, y = await centre(page, ".map-area")
        await drag(page, (x + 96, y - 96), (-80, 0))
        await page.mouse.click(x, y - 96)
        await page.mouse.click(x - 96, y - 96)
        rows = page.locator(".map-route li")
        await expect(rows).to_have_count(4)
        await expect(rows.nth(1)).to_contain_text(re.compile(r"2 · x 3.0\d m, y 3.0\d m, ∠ 180°"))
        await press(page, "Delete waypoint 4")
        await press(page, "Move waypoint 3 up")
        await expect(rows).to_have_count(3)
        await expect(rows.nth(2)).to_contain_text(re.compile(r"3 · x 3.0\d m, y 3.0\d m, ∠ 180°"))
        await rows.nth(0).get_by_role("button", name="1 ·").click()
        await press(page, "Turn left by 15°")
        await expect(rows.nth(0)).to_contain_text("∠ 15°")
        assert await page.locator(".map-mark").all_text_contents() == ["1", "2", "3"]
        assert await page.locator(".map-mark[data-chosen]").text_content() == "1"
        assert robot.commands == []
        await sent(page, robot)
        (route,) = robot.routes
        assert route["xs"] == pytest.approx([3, 0, 3], abs=0.1)
        assert route["ys"] == pytest.approx([0, 3, 3], abs=0.1)
        expected = [math.radians(15), math.radians(135), math.pi]
        assert route["yaws"] == pytest.approx(expected, abs=0.05)


async def test_a_paused_route_continues_with_what_is_left_after_a_new_confirmation(
    new_page: PageMaker,
) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        robot.set_reading("waypoint", 2)  # of an earlier route
        await drawn(page, (1, 0), (2, 0), (3, 1))
        await sent(page, robot)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 3")
        robot.set_reading("waypoint", 1)
        await until_text(page, ".map-words", "On the way to waypoint 2 of 3")
        await expect(page.locator(".map-mark")).to_have_text(["2", "3"])
        await press(page, "Pause")
        await until_text(page, ".map-words", "Paused · Waypoints left: 2")
        assert [name for name, _ in robot.commands] == ["follow", "end"]
        await page.wait_for_timeout(1500)
        assert len(robot.commands) == 2, "it must not continue by itself"
        await press(page, "Continue …")
        await expect(page.locator(".map-words")).to_contain_text("Send the robot to 2 places")
        assert len(robot.commands) == 2
        await press(page, "Send")
        await until(lambda: len(robot.routes) == 2)
        assert robot.routes[1]["xs"] == pytest.approx([2, 3], abs=0.1)
        assert robot.way is not None
        robot.way.set_result(None)
        await expect(page.locator(".map-words")).to_have_text("✓ sent", timeout=10_000)
        await expect(page.locator(".map-mark")).to_have_count(0)


async def test_a_route_that_stop_cancels_is_kept_and_can_be_changed_or_cleared(
    new_page: PageMaker,
) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        await drawn(page, (1, 0), (2, 0), (3, 1))
        await sent(page, robot)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 3")
        robot.set_reading("waypoint", 2)
        await until_text(page, ".map-words", "On the way to waypoint 3 of 3")
        robot.cancel()
        await until_text(page, ".map-words", "▲ the action was cancelled · Waypoints left: 1")
        await press(page, "Draw a route")
        x, y = await centre(page, ".map-area")
        await page.mouse.click(x, y - 64)
        await sent(page, robot)
        assert robot.routes[1]["xs"] == pytest.approx([3, 0], abs=0.1)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 2")
        await press(page, "Clear")
        await until_attribute(page, ".map-bar", "hidden", "")
        assert [name for name, _ in robot.commands] == ["follow", "follow", "end"]
        await expect(page.locator(".map-mark")).to_have_count(0)


async def test_a_route_that_cannot_be_ended_stays_active(new_page: PageMaker) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:

        def refuse(name: str, arguments: Mapping[str, Reading]) -> Mapping[str, Any]:
            if name == "end":
                raise CommandFailed("timed-out", "no answer within 2 s")
            return {}

        robot.on_command = refuse
        await drawn(page, (1, 0), (2, 0))
        await sent(page, robot)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 2")
        await press(page, "Pause")
        await until_text(page, ".map-words", "▲ no answer within 2 s")
        await expect(page.get_by_role("button", name="Pause", exact=True)).to_be_enabled()


async def lost(page: Page, robot: Follower) -> None:
    """Send a route, and lose the robot on the way to the second waypoint."""
    await drawn(page, (1, 0), (2, 0), (3, 1))
    await sent(page, robot)
    robot.set_reading("waypoint", 1)
    await until_text(page, ".map-words", "On the way to waypoint 2 of 3")
    assert robot.way is not None
    robot.way.set_exception(CommandFailed("disconnected", "the connection is lost"))
    await until_text(
        page,
        ".map-words",
        "▲ the connection is lost · The robot may still be on its way to waypoint 2 of 3",
    )


def button(page: Page, name: str) -> Locator:
    return page.get_by_role("button", name=name, exact=True)


@pytest.mark.parametrize("name", ["Pause", "Clear", "STOP"])
async def test_a_route_with_an_unknown_outcome_can_be_ended(new_page: PageMaker, name: str) -> None:
    """It does not count as ended, so that nobody continues a route that is under way."""
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        await lost(page, robot)
        await expect(button(page, "Continue …")).to_be_hidden()
        robot.set_reading("waypoint", 2)
        await expect(page.locator(".map-mark")).to_have_text(["3"])
        if name == "STOP":
            await page.click(STOP)
        else:
            await press(page, name)
        await until(lambda: ("end", {}) in robot.commands)
        if name == "Clear":
            await until_attribute(page, ".map-bar", "hidden", "")
            await expect(page.locator(".map-mark")).to_have_count(0)
        else:
            await expect(page.locator(".map-words")).to_contain_text("Waypoints left: 1")
            await expect(button(page, "Continue …")).to_be_visible()
        assert len(robot.routes) == 1


async def test_a_route_that_goes_on_after_pause_can_be_ended_again(new_page: PageMaker) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        robot.is_deaf = True
        await drawn(page, (1, 0), (2, 0))
        await sent(page, robot)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 2")
        await press(page, "Pause")
        await until(lambda: ("end", {}) in robot.commands)
        await expect(button(page, "Pause")).to_be_disabled()
        await expect(page.locator(".map-words")).to_contain_text("has not ended the route")
        robot.is_deaf = False
        await press(page, "Pause")
        await until_text(page, ".map-words", "Paused · Waypoints left: 2")


@pytest.mark.parametrize("opened", ["by a reload", "by another screen"])
@pytest.mark.parametrize("name", ["Pause", "Clear"])
async def test_a_page_that_is_opened_later_shows_the_route_and_ends_it(
    new_page: PageMaker, opened: str, name: str
) -> None:
    """The server holds the points; the present waypoint of an earlier route does not count."""
    page, watching = await new_page(size="desktop"), await new_page(size="desktop")
    async with followed(page) as robot:
        await watching.goto(page.url)  # it keeps the robot connected during the reload
        robot.set_reading("waypoint", 2)  # of an earlier route
        await drawn(page, (1, 0), (2, 0), (3, 1))
        await sent(page, robot)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 3")
        later = page if opened == "by a reload" else await new_page(size="desktop")
        await later.goto(page.url)
        words = later.locator(".map-words")
        await expect(words).to_contain_text(re.compile("On the way to waypoint 1 of 3 · screen 1"))
        await expect(later.locator(".map-mark")).to_have_text(["1", "2", "3"])
        robot.set_reading("waypoint", 1)
        await expect(later.locator(".map-mark")).to_have_text(["2", "3"])
        await expect(button(later, "End route")).to_be_hidden()
        await press(later, name)
        await until(lambda: robot.commands[1:] == [("end", {})])
        if name == "Pause":
            await until_text(later, ".map-words", "Paused · Waypoints left: 2")
            await press(later, "Continue …")
            await press(later, "Send")
            await until(lambda: len(robot.routes) == 2)
            assert robot.routes[1]["xs"] == pytest.approx([2, 3], abs=0.1)
        else:
            await until_attribute(later, ".map-bar", "hidden", "")
            await expect(later.locator(".map-mark")).to_have_count(0)


async def test_a_route_of_another_screen_disappears_when_it_ends(new_page: PageMaker) -> None:
    page, other = await new_page(size="desktop"), await new_page(size="desktop")
    async with followed(page) as robot:
        await other.goto(page.url)
        await until_text(other, ".map-text", "x 0.00 m, y 0.00 m")
        await drawn(page, (1, 0), (2, 0))
        await sent(page, robot)
        await expect(other.locator(".map-words")).to_contain_text("waypoint 1 of 2")
        assert robot.way is not None
        robot.way.set_result(None)
        await until_attribute(other, ".map-bar", "hidden", "")
        await expect(other.locator(".map-mark")).to_have_count(0)
        await expect(page.locator(".map-words")).to_have_text(re.compile("✓"))


async def test_after_a_new_session_a_route_is_ended_by_the_robots_feedback(
    new_page: PageMaker,
) -> None:
    """The points of another program's route are unknown, so the map shows none."""
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        await drawn(page, (1, 0), (2, 0))
        await sent(page, robot)
        url = page.url
        await page.goto("about:blank")
        assert robot.way is not None
        robot.way.set_result(None)
        await until(lambda: not robot.is_open)
        await page.goto(url)
        await until(lambda: robot.is_open)
        await until_attribute(page, ".map-bar", "hidden", "")
        await expect(page.locator(".map-mark")).to_have_count(0)
        robot.set_reading("waypoint", 1)
        await until_text(page, ".map-words", "On the way to waypoint 2")
        await press(page, "End route")
        await until(lambda: robot.commands[1:] == [("end", {})])
        await expect(button(page, "End route")).to_be_hidden()
        robot.set_reading("waypoint", 1)
        await expect(button(page, "End route")).to_be_visible()


class Goer(Follower):
    """A robot whose goal ends as a route does."""

    async def command(self, name: str, arguments: Mapping[str, Reading], **more: Any) -> Replied:
        if name != "go":
            return await super().command(name, arguments, **more)
        reply = await FakeRobot.command(self, name, arguments, **more)
        self.way = asyncio.get_running_loop().create_future()
        await self.way
        return reply


async def test_every_page_shows_and_cancels_a_single_goal(new_page: PageMaker) -> None:
    page, other = await new_page(size="desktop"), await new_page(size="desktop")
    use = WidgetUse(
        "m",
        "map",
        AT,
        {"goto": "go", "end_goal": "end"},
        given={"goto": OutputBinding({"to_x": "x", "to_y": "y"})},
    )
    numbers = {name: Argument(name, "number") for name in ("to_x", "to_y")}
    commands = {**COMMANDS, "go": Command("go", "wire", WriteSpec("text"), numbers, moves=True)}
    robot = Goer(dashboard_profile(signals=SIGNALS, uses=[use], commands=commands))
    async with running_dashboard(robot) as address:
        for one in (page, other):
            await one.goto(f"{address}robots/puppet/")
            await until(lambda: robot.is_open)
            for name, value in (("px", 0.0), ("py", 0.0), ("turned", 0.0)):
                robot.set_reading(name, value)
            await until_text(one, ".map-text", "x 0.00 m, y 0.00 m")
        x, y = await centre(page, ".map-area")
        await page.mouse.click(x + 64, y - 32)
        await press(page, "Go there")
        told = re.compile(r"On the way to x 2.0\d m, y 1.0\d m")
        await expect(page.locator(".map-words")).to_have_text(told)
        await expect(other.locator(".map-words")).to_have_text(
            re.compile(told.pattern + " · screen 1")
        )
        await press(other, "Cancel goal")
        await until(lambda: [name for name, _ in robot.commands] == ["go", "end"])
        await expect(page.locator(".map-words")).to_contain_text("the action was cancelled")
        await expect(button(page, "Cancel goal")).to_be_hidden()
        await expect(button(other, "Cancel goal")).to_be_hidden()


async def test_escape_is_stop_while_a_route_is_under_way_even_with_a_choice_on_the_map(
    new_page: PageMaker,
) -> None:
    """Without a route, it takes the choice back."""
    page, other = await new_page(size="desktop"), await new_page(size="desktop")
    async with followed(page) as robot:
        await other.goto(page.url)
        await until_text(other, ".map-text", "x 0.00 m, y 0.00 m")
        await drawn(other, (1, 1))
        await other.locator(".map-area").focus()
        await other.keyboard.press("Escape")
        await expect(other.locator(".map-mark")).to_have_count(0)
        assert robot.latched == []
        await drawn(page, (1, 0), (2, 0))
        await sent(page, robot)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 2")
        await drawn(other, (1, 1))
        await other.locator(".map-area").focus()
        await other.keyboard.press("Escape")
        await until(lambda: len(robot.latched) == 1)
        await until_text(other, "[data-latched-text]", "■ Stopped by you")


async def test_escape_is_stop_while_a_route_may_be_under_way(new_page: PageMaker) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        await lost(page, robot)
        await press(page, "Draw a route")
        await page.locator(".map-area").focus()
        await page.keyboard.press("Escape")
        await until(lambda: len(robot.latched) == 1)


async def test_a_route_by_keys_alone(new_page: PageMaker) -> None:
    page = await new_page(size="desktop")
    async with followed(page) as robot:
        key = page.keyboard.press
        await page.get_by_role("button", name="Draw a route").focus()
        await key("Enter")
        await page.locator(".map-area").focus()
        await key("Enter")
        await key("ArrowRight")
        await page.wait_for_timeout(500)
        await key("Enter")
        rows = page.locator(".map-route li")
        await expect(rows).to_have_count(2)
        await page.get_by_role("button", name="Move waypoint 2 up").focus()
        await key("Enter")
        focused = "document.activeElement.textContent"
        assert (await page.evaluate(focused)).startswith("1 ·")
        await page.get_by_role("button", name="Turn right by 15°").focus()
        await key("Enter")
        await page.get_by_role("button", name="Send …").focus()
        await key("Enter")
        assert robot.commands == []
        await page.get_by_role("button", name="Send", exact=True).focus()
        await key("Enter")
        await until(lambda: len(robot.routes) == 1)
        (route,) = robot.routes
        assert route["xs"][0] > route["xs"][1]
        assert route["yaws"][0] == pytest.approx(-math.radians(15), abs=0.02)
        await until_text(page, ".map-words", "On the way to waypoint 1 of 2")
        await page.get_by_role("button", name="Pause", exact=True).focus()
        await key("Enter")
        await until_text(page, ".map-words", "Paused · Waypoints left: 2")
