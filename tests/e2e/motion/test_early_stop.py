"""STOP on a robot page whose modules have not loaded: pressed, sent, and kept."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from playwright.async_api import Page, Route, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_attribute, until_text
from tests.e2e.motion.driving import CALM_LEASE_S, STOP, Wire, driven
from urc.model.interface import WidgetUse

pytestmark = pytest.mark.anyio

NOTE = "[data-stop-note]"
DONE = "✓ sent ✓ confirmed ✓ latched"
STOP_URL = "**/api/v1/robots/puppet/stop"
BOTH_STOPPED = ["drive stop", "lift stop"]


@asynccontextmanager
async def without_modules(
    new_page: PageMaker, wire: Wire | None = None
) -> AsyncIterator[tuple[Wire, Page, asyncio.Event]]:
    """Open a robot page without its modules; give robot, page and the event that releases them."""
    released = asyncio.Event()

    async def hold(route: Route) -> None:
        await released.wait()
        await route.continue_()

    async with driven(robot=wire or Wire(lease_s=CALM_LEASE_S)) as (robot, address):
        page = await new_page()
        await page.route("**/live/main.js*", hold)
        await page.goto(address, wait_until="commit")
        await page.locator(STOP).wait_for()
        try:
            yield robot, page, released
        finally:
            released.set()


async def touch(page: Page) -> None:
    """Touch STOP without lifting the finger."""
    await page.dispatch_event(STOP, "pointerdown", {"button": 0, "pointerId": 7})


async def test_stop_acts_before_the_modules_have_loaded(new_page: PageMaker) -> None:
    """The request itself stops the robot; the modules press no second time."""
    async with without_modules(new_page) as (robot, page, released):
        await touch(page)
        await until(lambda: sorted(robot.line.texts) == BOTH_STOPPED)
        await expect(page.locator(NOTE)).to_have_text(re.compile("^Stop"))
        await until_attribute(page, STOP, "data-phase", "confirmed")
        released.set()
        await expect(page.locator("[data-latched-text]")).to_have_text(re.compile("^■ Stopped by "))
        assert sorted(robot.line.texts) == BOTH_STOPPED
        await page.click("[data-verb='reset']")
        await until_text(page, "[data-who]", "No one drives")


@pytest.mark.parametrize("gesture", ["click", "Escape"])
async def test_keys_and_screen_readers_stop_before_the_modules_have_loaded(
    new_page: PageMaker, gesture: str
) -> None:
    async with without_modules(new_page) as (robot, page, _):
        if gesture == "click":
            await page.evaluate(f"document.querySelector('{STOP}').click()")
        else:
            await page.keyboard.press(gesture)
        await until(lambda: sorted(robot.line.texts) == BOTH_STOPPED)


async def test_the_modules_repeat_an_early_stop_that_did_not_arrive(new_page: PageMaker) -> None:
    """The request fails once; the page says so, and its modules press again."""
    async with without_modules(new_page) as (robot, page, released):
        new_page.allow(page, lambda text: "STOP" in text or "ERR_FAILED" in text)
        await page.route(STOP_URL, lambda route: route.abort(), times=1)
        await touch(page)
        await until_attribute(page, STOP, "data-phase", "fault")
        await until_text(page, NOTE, "NO LINK: STOP was not delivered")
        assert robot.line.texts == []
        released.set()
        await until_text(page, NOTE, DONE)
        assert set(robot.line.texts) == set(BOTH_STOPPED)


async def test_the_modules_repeat_an_early_stop_that_is_still_on_its_way(
    new_page: PageMaker,
) -> None:
    """Its connection may have lost a packet; the modules have another one."""
    held = asyncio.Event()

    async def hold(route: Route) -> None:
        await held.wait()
        await route.abort()

    async with without_modules(new_page) as (robot, page, released):
        new_page.allow(page, lambda text: "STOP" in text or "ERR_FAILED" in text)
        await page.route(STOP_URL, hold, times=1)
        await touch(page)
        await until_attribute(page, STOP, "data-phase", "sending")
        released.set()
        await until(lambda: set(robot.line.texts) == set(BOTH_STOPPED))
        await until_text(page, NOTE, DONE)
        held.set()


async def test_the_stop_widget_acts_before_it_is_mounted(new_page: PageMaker) -> None:
    wire = Wire(WidgetUse("up", "stop", {}, {}, {}), lease_s=CALM_LEASE_S)
    async with without_modules(new_page, wire) as (robot, page, released):
        await page.dispatch_event(".stop-main", "pointerdown", {"button": 0, "pointerId": 7})
        await until(lambda: sorted(robot.line.texts) == BOTH_STOPPED)
        released.set()
        await until_text(page, NOTE, DONE)
