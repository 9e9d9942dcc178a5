"""Who drives, seen by several browsers at once: one holder, and a stop between any two."""

import asyncio

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_text
from tests.e2e.motion.driving import LEFT, calmly_driven, fresh, moved, opened, push, text_of

pytestmark = pytest.mark.anyio

WHO = "[data-who]"


async def says(page: Page, pattern: str) -> None:
    """Wait until the page says who drives."""
    await page.wait_for_function(
        "([selector, pattern]) =>"
        " new RegExp(pattern).test(document.querySelector(selector).textContent)",
        arg=[WHO, pattern],
    )


async def wish(page: Page, verb: str) -> None:
    """Press one of the buttons about the controls."""
    await page.click(f"[data-verb='{verb}']")


async def test_everybody_sees_who_drives_and_a_second_hand_moves_nothing(
    new_page: PageMaker,
) -> None:
    """The refusal names the holder; what the holder does goes on."""
    async with calmly_driven() as (robot, address):
        first, second = await opened(new_page, address), await opened(new_page, address)
        await push(first)
        await robot.until_moving()
        await says(second, "^screen 1 is driving$")
        await push(second)
        await second.wait_for_function(
            "() => document.querySelector('.joystick-note').textContent"
            " === '◆ screen 1 has the controls'"
        )
        count = len(robot.line.written)
        await until(lambda: len(moved(robot.after(count))) >= 5)
        assert "drive stop" not in robot.line.texts
        await first.mouse.up()
        await robot.until_stopped()


async def test_a_hand_over_passes_through_a_stop_and_needs_a_new_gesture(
    new_page: PageMaker,
) -> None:
    """Asked, granted: the first stick is still held, and moves nothing; the second begins anew."""
    async with calmly_driven() as (robot, address):
        first, second = await opened(new_page, address), await opened(new_page, address)
        await push(first)
        await robot.until_moving()
        await wish(second, "ask")
        await says(first, "^◆ screen 2 asks to drive: \\d+ s$")
        await says(second, "^Asked screen 1: \\d+ s$")
        await first.keyboard.press("Tab")
        await first.evaluate("document.querySelector('[data-verb=yes]').click()")
        await says(second, "^● You drive$")
        await robot.until_stopped()
        count = len(robot.line.written)
        await asyncio.sleep(0.4)
        assert robot.after(count) == [], "the hand that held on moves nothing"
        await push(second)
        await robot.until_moving()
        await first.mouse.up()
        count = len(robot.line.written)
        await until(lambda: len(moved(robot.after(count))) >= 5)
        await second.mouse.up()
        await robot.until_stopped()


async def test_a_request_can_be_turned_down_and_the_controls_taken_over(
    new_page: PageMaker,
) -> None:
    """Kept by a word; taken by whoever sits at the machine itself, through a stop."""
    async with calmly_driven() as (robot, address):
        first, second = await opened(new_page, address), await opened(new_page, address)
        await wish(first, "take")
        await wish(second, "ask")
        await first.click("[data-verb='no']")
        await says(second, "^screen 1 is driving$")
        await push(first)
        await robot.until_moving()
        await wish(second, "force")
        await says(first, "^screen 2 is driving$")
        await robot.until_stopped()
        await first.mouse.up()
        await wish(second, "leave")
        await says(first, "^No one drives")


async def test_a_page_that_only_watches_sees_all_and_drives_nothing(new_page: PageMaker) -> None:
    """It has no button for the controls, its sticks move nothing, and its STOP works."""
    async with calmly_driven() as (robot, address):
        page = await fresh(new_page)
        await page.goto(f"{address}?watch")
        await says(page, "^No one drives; this page only watches$")
        assert await page.locator("[data-verb]:visible").count() == 0
        await push(page)
        await page.wait_for_function(
            "() => document.querySelector('.joystick-note').textContent.includes('only watches')"
        )
        await page.mouse.up()
        assert robot.line.texts == []
        await page.click("[data-stop-button]")
        await robot.until_stopped()
        await until_text(page, "[data-latched-text]", "■ Stopped by you")
        assert await page.locator("[data-verb]:visible").count() == 0, "reset is for drivers"


async def test_a_page_that_goes_stops_and_coming_back_resumes_nothing(
    new_page: PageMaker,
) -> None:
    """A reload with the stick held: stopped, nobody drives, and the new page sends nothing."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        await page.reload()
        await robot.until_stopped()
        await says(page, "^No one drives")
        count = len(robot.line.written)
        await page.mouse.move(300, 300, steps=4)
        await asyncio.sleep(0.4)
        assert moved(robot.after(count)) == {}
        await page.mouse.up()


async def test_a_line_that_is_lost_and_back_resumes_nothing(new_page: PageMaker) -> None:
    """Offline and on again with the stick held: only a new gesture moves."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        await page.evaluate(
            "() => { window.lines = []; const send = WebSocket.prototype.send;"
            " WebSocket.prototype.send = function (data) {"
            " if (!lines.includes(this)) lines.push(this); return send.call(this, data); }; }"
        )
        # Not the redundant socket, which a slow page also has: the hand would go on driving.
        line = "window.lines.find(({ url }) => new URL(url).pathname === '/ws')"
        await page.wait_for_function(f"() => {line}")
        await page.evaluate(f"{line}.close()")
        await robot.until_stopped()
        await says(page, "^No one drives")
        count = len(robot.line.written)
        await asyncio.sleep(0.4)
        assert robot.after(count) == []
        await page.mouse.up()
        await push(page, LEFT)
        await robot.until_moving()
        await page.mouse.up()
        await robot.until_stopped()


async def test_the_page_says_that_the_robot_refused(new_page: PageMaker) -> None:
    """Whatever the driver requires: the reason stands at the stick, and nothing is sent anew."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        robot.frames.refusal = "The robot is not in automatic mode"
        await push(page)
        note = "[data-cell='0'] .joystick-note"
        await until_text(page, note, "◆ The robot is not in automatic mode")
        robot.frames.refusal = ""
        await asyncio.sleep(0.4)
        assert moved(robot.line.texts) == {}, "the same gesture is over"
        await page.mouse.up()
        await push(page)
        await robot.until_moving()
        await page.mouse.up()
        await robot.until_stopped()
        assert await text_of(page, note).text_content() == ""
