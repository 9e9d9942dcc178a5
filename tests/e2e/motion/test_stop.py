"""STOP: on pointer-down, by whoever is there, by either way, and over a restart."""

import asyncio
import json
import re
from pathlib import Path

import pytest
from playwright.async_api import Page, Route, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_attribute, until_text
from tests.e2e.motion.driving import LEFT, STOP, calmly_driven, centre, fresh, moved, opened, push

pytestmark = pytest.mark.anyio

NOTE = "[data-stop-note]"
RESET = "[data-verb='reset']"
DONE = "✓ sent ✓ confirmed ✓ latched"


async def touch(page: Page) -> None:
    """Touch STOP with another finger, without letting go."""
    await page.dispatch_event(STOP, "pointerdown", {"button": 0, "pointerId": 7})


async def test_stop_acts_when_it_is_touched_and_latches(new_page: PageMaker) -> None:
    """While a stick is held: the robot stops, the stick is dead, and a reset moves nothing."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        await touch(page)
        await robot.until_stopped()
        assert set(robot.line.reasons) == {"stopped"}, "not when the lease runs out"
        await until_text(page, NOTE, DONE)
        await until_text(page, "[data-latched-text]", "■ Stopped by you")
        count = len(robot.line.written)
        await asyncio.sleep(0.4)
        assert moved(robot.after(count)) == {}
        await page.evaluate("document.querySelector('[data-verb=reset]').click()")
        await until_text(page, "[data-who]", "No one drives")
        await asyncio.sleep(0.4)
        assert robot.after(count) == [], "the same hand is still there"
        await page.mouse.up()
        await push(page)
        await robot.until_moving()
        await page.mouse.up()


async def test_the_button_says_stopped_once_the_stop_is_confirmed(new_page: PageMaker) -> None:
    """The bar tells when; a second press sends the stop again; after a reset it is STOP."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        button = page.locator(STOP)
        await expect(button).to_have_text("STOP")
        robot.line.is_up = False
        await button.click()
        await until_text(page, NOTE, "✓ sent ✓ latched")
        await expect(button).to_have_text("STOP")
        robot.line.is_up = True
        robot.line.write_due()
        await until_text(page, NOTE, DONE)
        await expect(button).to_have_text("STOPPED")
        when = page.locator("[data-latched-when]")
        await expect(when).to_have_text(re.compile(r"^at \d\d:\d\d$"))
        count = len(robot.line.written)
        await page.get_by_role("button", name="STOPPED: press to send STOP again").click()
        await until(lambda: set(robot.after(count)) == {"drive stop", "lift stop"})
        await page.click(RESET)
        await expect(button).to_have_text("STOP")
        await expect(page.get_by_role("button", name="STOP", exact=True)).to_be_visible()


async def test_escape_and_the_click_of_a_screen_reader_stop_too(new_page: PageMaker) -> None:
    """From anywhere on the page, and without a pointer."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await page.keyboard.press("Escape")
        await until_text(page, NOTE, DONE)
        assert set(robot.line.texts) == {"drive stop", "lift stop"}
        await page.click("[data-verb='reset']")
        await until_text(page, "[data-who]", "No one drives")
        count = len(robot.line.written)
        await page.evaluate(f"document.querySelector('{STOP}').click()")
        await until_text(page, NOTE, DONE)
        assert set(robot.after(count)) == {"drive stop", "lift stop"}


async def test_escape_closes_an_open_panel_first(new_page: PageMaker) -> None:
    """With nothing held it means that; the next one is STOP again."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await page.get_by_role("button", name="This device").click()
        await page.wait_for_selector("#device:popover-open")
        await page.keyboard.press("Escape")
        await page.wait_for_selector("#device:not(:popover-open)", state="attached")
        await page.click("[data-badge]")
        await expect(page.locator("[data-panel]")).to_have_attribute("open", "")
        await page.keyboard.press("Escape")
        await expect(page.locator("[data-panel]")).not_to_have_attribute("open", "")
        assert robot.line.texts == []
        await page.keyboard.press("Escape")
        await until_text(page, NOTE, DONE)


async def test_a_click_on_reset_brings_the_focus_back_to_the_stick(new_page: PageMaker) -> None:
    """The arrow keys drive again, also after the mouse."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        await page.mouse.up()
        await robot.until_stopped()
        await page.click(STOP)
        await page.click(RESET)
        await page.wait_for_function("() => document.activeElement?.matches('.joystick-pad')")
        await page.keyboard.down("ArrowUp")
        await robot.until_moving()
        await page.keyboard.up("ArrowUp")
        await robot.until_stopped()


async def test_escape_is_stop_while_something_is_held_whatever_lies_open(
    new_page: PageMaker,
) -> None:
    """Who drives is not asked which panel is open."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        await page.evaluate("document.querySelector('#device').showPopover()")
        await page.keyboard.press("Escape")
        await until_text(page, NOTE, DONE)
        await page.mouse.up()


async def test_a_press_that_slid_off_takes_nothing_from_the_next_one(new_page: PageMaker) -> None:
    """No click follows it; the next click, of a key or a screen reader, stops all the same."""
    async with calmly_driven() as (_, address):
        page = await opened(new_page, address)
        await page.mouse.move(*await centre(page, STOP))
        await page.mouse.down()
        await until_text(page, NOTE, DONE)
        await page.mouse.move(10, 10)
        await page.mouse.up()
        await page.click("[data-verb='reset']")
        await until_text(page, "[data-who]", "No one drives")
        await page.focus(STOP)
        await page.keyboard.press("Enter")
        await until_text(page, NOTE, DONE)


async def test_stop_of_somebody_else_stops_who_drives(new_page: PageMaker) -> None:
    """It needs no lease; the driver sees who it was."""
    async with calmly_driven() as (robot, address):
        driver, other = await opened(new_page, address), await opened(new_page, address)
        await push(driver)
        await robot.until_moving()
        await other.click(STOP)
        await robot.until_stopped()
        await until_text(driver, "[data-latched-text]", "■ Stopped by screen 2")
        await driver.mouse.up()
        count = len(robot.line.written)
        await push(driver)
        note = "[data-cell='0'] .joystick-note"
        await until_text(driver, note, "◆ Reset STOP first.")
        await driver.mouse.up()
        assert robot.after(count) == []


async def test_the_bar_names_the_reason_of_a_latched_stop_once(new_page: PageMaker) -> None:
    """Controls show one word, and the reason to screen readers; a press on one points at Reset."""
    async with calmly_driven() as (_robot, address):
        page = await opened(new_page, address)
        note, reset = page.locator("[data-cell='0'] .joystick-note"), page.locator(RESET)
        await page.click(STOP)
        await expect(page.locator("[data-latched-next]")).to_have_text("Reset to drive again")
        await expect(page.locator("[data-who]")).to_be_empty()
        await expect(note).to_have_text("◆ Reset STOP first.")
        await expect(note).to_have_css("font-size", "0px")
        shown = await note.evaluate("(one) => getComputedStyle(one, '::before').content")
        assert shown == '"◆ Stopped"'
        await expect(reset).not_to_have_attribute("data-pointed", "")
        await push(page)
        await expect(reset).to_have_attribute("data-pointed", "")
        await page.mouse.up()
        await expect(reset).not_to_have_attribute("data-pointed", "")
        await reset.click()
        await expect(page.locator("[data-cell='0']")).not_to_have_attribute("data-stopped", "")
        await until_text(page, "[data-who]", "No one drives")


async def test_stop_goes_by_a_request_when_the_socket_is_blocked(new_page: PageMaker) -> None:
    """No WebSocket at all: the page says NO LINK, and STOP reaches the robot all the same."""
    async with calmly_driven() as (robot, address):
        page = await fresh(new_page)
        await page.add_init_script(
            "window.WebSocket = class extends EventTarget {"
            " static OPEN = 1; readyState = 0; bufferedAmount = 0; close() {} send() {} }"
        )
        await page.goto(address)
        await until_text(page, NOTE, "▲ NO LINK")
        await touch(page)
        await until_text(page, NOTE, DONE)
        assert set(robot.line.texts) == {"drive stop", "lift stop"}


async def test_stop_goes_the_other_way_when_the_socket_says_nothing(new_page: PageMaker) -> None:
    """A line that is up and swallows everything: after 0.3 s a request is made as well."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await page.evaluate("WebSocket.prototype.send = () => {}")
        await touch(page)
        await robot.until_stopped()
        await until_text(page, NOTE, DONE)


async def test_no_link_is_said_when_stop_cannot_be_delivered(new_page: PageMaker) -> None:
    """Neither way: nobody may believe that the robot was stopped."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        new_page.allow(page, lambda text: "/stop" in text)

        async def refuse(route: Route) -> None:
            await route.abort()

        await page.route("**/api/v1/robots/*/stop", refuse)
        await page.evaluate("WebSocket.prototype.send = () => {}")
        await touch(page)
        await until_text(page, NOTE, "▲ NO LINK: use the robot's own stop switch")
        await until_attribute(page, STOP, "data-phase", "failed")
        assert robot.line.texts == []


async def test_no_link_is_said_of_a_press_after_the_server_has_gone(new_page: PageMaker) -> None:
    """An earlier STOP may have been reset on another screen since the loss of the link."""
    async with calmly_driven() as (_, address):
        page = await opened(new_page, address)
        new_page.allow(page, lambda text: "/stop" in text)
        await touch(page)
        await until_text(page, NOTE, DONE)
    await until_text(page, "[data-who]", "Not connected to URC")
    await until_text(page, NOTE, DONE)
    await touch(page)
    await until_text(page, NOTE, "▲ NO LINK: use the robot's own stop switch")
    await until_attribute(page, STOP, "data-phase", "failed")


async def test_a_robot_that_is_lost_is_told_as_no_link_and_stopped_when_it_is_back(
    new_page: PageMaker,
) -> None:
    """Latched at once, confirmed only when its line has taken the stop."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        robot.line.is_up = False
        robot.link("lost")
        await until_text(page, NOTE, "▲ NO LINK")
        await touch(page)
        await until_text(page, NOTE, "▲ NO LINK, latched")
        robot.line.is_up = True
        robot.line.write_due()
        robot.link("live")
        await until_text(page, NOTE, DONE)
        assert robot.line.texts == ["drive stop", "lift stop"]


async def test_a_latched_stop_holds_over_a_restart(new_page: PageMaker, tmp_path: Path) -> None:
    """Another server, the same data: still stopped, and only a reset lets it be driven."""
    async with calmly_driven(tmp_path) as (_, address):
        page = await opened(new_page, address)
        await touch(page)
        await until_text(page, NOTE, DONE)
        kept = tmp_path / "latches" / "puppet.latch.json"
        await until(lambda: kept.exists() and json.loads(kept.read_text())["owed"] is False)
    async with calmly_driven(tmp_path) as (robot, address):
        page = await opened_latched(new_page, address)
        await push(page)
        await asyncio.sleep(0.3)
        await page.mouse.up()
        assert robot.line.texts == []
        await page.click("[data-verb='reset']")
        await until_text(page, "[data-who]", "No one drives")
        assert robot.line.texts == [], "a reset starts nothing, and stops nothing"
        await push(page)
        await robot.until_moving()
        await page.mouse.up()


async def opened_latched(new_page: PageMaker, address: str) -> Page:
    """Open the page of a robot that was stopped before; it is screen 1, too, and was not it."""
    page = await fresh(new_page)
    await page.goto(address)
    await until_text(page, "[data-latched-text]", "■ Stopped by screen 1, before a restart")
    await expect(page.locator("[data-latched-when]")).to_be_hidden()
    return page


@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_stop_is_on_the_screen_and_nothing_lies_over_it(
    new_page: PageMaker, size: str
) -> None:
    """At least 64 px high, wherever the page is scrolled to, and its middle is its own."""
    async with calmly_driven() as (_, address):
        page = await opened(new_page, address, size)
        for scroll in (0, 10_000):
            await page.evaluate("y => scrollTo(0, y)", scroll)
            box = await page.locator(STOP).bounding_box()
            view = page.viewport_size
            assert box is not None
            assert view is not None
            assert box["height"] >= 64
            assert box["width"] >= 64
            assert box["y"] >= 0
            assert box["y"] + box["height"] <= view["height"]
            place = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
            top = "([x, y]) => document.elementFromPoint(x, y).matches('[data-stop-button]')"
            assert await page.evaluate(top, place)
        x, y = await centre(page, LEFT)
        assert await page.evaluate(
            "([x, y]) => document.elementFromPoint(x, y).closest('.joystick-pad') !== null", [x, y]
        )
