"""Hands in a real browser: what is held moves, and each way of letting go stops."""

import asyncio
import os
import signal
from functools import partial
from pathlib import Path

import pytest

from tests.e2e.browser import LOCALE, PAGE_TIMEOUT_MS, SIZES, running_browser
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.keys import known_here
from tests.e2e.motion.driving import (
    CALM_LEASE_S,
    LEASE_S,
    LEFT,
    RIGHT,
    UP,
    Wire,
    calmly_driven,
    centre,
    drawn,
    driven,
    fingers_on,
    fire,
    lateness,
    moved,
    opened,
    push,
    push_until,
    text_of,
)
from tests.e2e.motion.ways import WAYS, start_over
from tests.effort import IS_THOROUGH

pytestmark = pytest.mark.anyio

LATE_S = 0.15
"""One loop plays the server, the robot and the test here; the 50 ms are held by the rig's tests."""
TIMES = 20 if IS_THOROUGH else 2
STILL_S = 0.4
"""Longer than a lease: whoever still ticked would be seen."""


async def stays_still(robot: Wire) -> None:
    """Nothing is written for longer than any lease, though the hand is still there."""
    count = len(robot.line.written)
    await asyncio.sleep(STILL_S)
    assert robot.after(count) == []


async def test_a_held_stick_moves_and_letting_go_stops(new_page: PageMaker) -> None:
    """It moves as far as it is pushed, for as long as it is held; then there is silence."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        assert 0 < robot.values("drive")["speed"] <= 2
        count = len(robot.line.written)
        # A hand at rest still holds.
        await until(lambda: len(moved(robot.after(count))) >= 5)
        await page.mouse.up()
        await robot.until_stopped()
        await stays_still(robot)
        assert await text_of(page, "[data-who]").text_content() == "● You drive"


@pytest.mark.parametrize("way", WAYS)
async def test_each_way_of_letting_go_is_neutral_and_ends_the_gesture(
    new_page: PageMaker, way: str
) -> None:
    """The stop comes at once, not when the lease runs out; the hand that stays moves nothing."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        for time in range(TIMES):
            if time:
                await start_over(page, *SIZES["desktop"])
            count = len(robot.line.written)
            await push(page)
            await until(partial(has_moved, robot, count))
            await WAYS[way](page)
            await robot.until_stopped()
        assert "expired" not in robot.line.reasons, "it did not wait for the lease to run out"
        await page.mouse.move(*(await centre(page, LEFT)), steps=5)
        await stays_still(robot)


def has_moved(robot: Wire, count: int) -> bool:
    """Return whether it was moved since so many words."""
    return bool(moved(robot.after(count)))


async def test_a_new_gesture_moves_again_after_each_of_them(new_page: PageMaker) -> None:
    """Whoever let go without wanting to, just takes hold again."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        for _ in range(3):
            await push(page)
            await robot.until_moving()
            await fire(page, "window.dispatchEvent(new Event('blur'))")
            await robot.until_stopped()
            assert "the window lost focus" in (
                await text_of(page, "[data-cell='0'] .joystick-note").text_content() or ""
            )
            await page.mouse.up()


async def test_two_sticks_and_a_button_move_at_once_by_touch(new_page: PageMaker) -> None:
    """Three fingers: two axes of one command, and another command; each is let go by itself."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address, "tablet")
        hands = await fingers_on(page)
        places = [await centre(page, selector) for selector in (LEFT, RIGHT, UP)]
        for finger, (x, y) in enumerate(places):
            await hands.put(finger, x, y)
        await hands.put(0, places[0][0], places[0][1] - 40)
        await hands.put(1, places[1][0] - 40, places[1][1])
        await until(
            lambda: (
                all(value > 0 for value in robot.values("drive").values())
                and robot.values("lift").get("rate") == 0.5
            )
        )
        await hands.lift(1)
        await until(lambda: robot.values("drive").get("turn") == 0)
        assert robot.values("drive")["speed"] > 0, "the other stick is still held"
        assert "drive stop" not in robot.line.texts
        await hands.lift(0)
        await robot.until_stopped("drive")
        count = len(robot.line.written)
        await until(lambda: len(moved(robot.after(count), "lift")) > 3)
        await hands.lift(2)
        await robot.until_stopped("lift")
        await stays_still(robot)
        for finger, (x, y) in enumerate(places):
            await hands.put(finger, x, y)
        await hands.put(0, places[0][0], places[0][1] - 40)
        await robot.until_moving("drive")
        await robot.until_moving("lift")
        await fire(page, "window.dispatchEvent(new Event('blur'))")
        await robot.until_stopped("drive")
        await robot.until_stopped("lift")
        await stays_still(robot)


async def test_turning_the_device_stops_and_new_fingers_drive_again(new_page: PageMaker) -> None:
    """A rotation changes the layout under two thumbs. Only new touches drive the robot."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address, "phone")
        hands = await fingers_on(page)
        for is_landscape in (True, False):
            for finger, selector in enumerate((LEFT, RIGHT)):
                x, y = await centre(page, selector)
                await hands.put(finger, x, y)
                await hands.put(finger, x, y - 40)
            await robot.until_moving()
            await hands.turn(is_landscape=is_landscape)
            await robot.until_stopped()
            assert "expired" not in robot.line.reasons, "it did not wait for the lease to run out"
            count = len(robot.line.written)
            for finger in (0, 1):
                await hands.put(finger, 100, 100 + 50 * finger)
            await stays_still(robot)
            assert len(robot.line.written) == count
            note = text_of(page, "[data-cell='0'] .joystick-note")
            assert "the screen was rotated" in (await note.text_content() or "")
            thumb = page.locator("[data-cell='0'] .joystick-thumb")
            assert await thumb.get_attribute("transform") == "translate(0.0 0.0)", "it is at rest"
            for finger in (0, 1):
                await hands.lift(finger)
        await stays_still(robot)


async def test_arrow_keys_hold_a_stick_that_has_the_focus(new_page: PageMaker) -> None:
    """Pressed it runs, let go it stops; a key that repeats is one press."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await page.focus(LEFT)
        await page.keyboard.down("ArrowUp")
        await page.keyboard.down("ArrowUp")
        await robot.until_moving()
        assert robot.values("drive") == {"speed": 1.0, "turn": 0.0}
        await page.keyboard.up("ArrowUp")
        await robot.until_stopped()
        await page.keyboard.down("ArrowDown")
        await until(lambda: robot.values("drive").get("speed") == -1.0)
        await page.keyboard.press("Tab")
        await robot.until_stopped()
        await stays_still(robot)


PAD = """
window.pad = { connected: true, mapping: "standard", axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false })) };
navigator.getGamepads = () => [window.pad];
window.dispatchEvent(new Event("gamepadconnected"));
"""


async def test_a_gamepad_moves_only_while_its_shoulder_button_is_held(
    new_page: PageMaker,
) -> None:
    """Pressed with the stick at rest, it holds; off its centre the press does not count."""
    use = Wire().profile.slots["left"]
    use = use._replace(options={**use.options, "pad": "left"})
    async with driven(robot=Wire(use, lease_s=CALM_LEASE_S)) as (robot, address):
        page = await opened(new_page, address)
        await fire(page, PAD + "window.pad.axes[1] = -0.5;")
        await stays_still(robot)
        await fire(page, "window.pad.buttons[4].pressed = true")
        await stays_still(robot)
        await fire(page, "window.pad.axes[1] = 0")
        await stays_still(robot)
        await fire(page, "window.pad.buttons[4].pressed = false")
        await drawn(page)  # once in each frame it is looked at
        await fire(page, "window.pad.buttons[4].pressed = true")
        await until(lambda: robot.values("drive") == {"speed": 0, "turn": 0})
        await fire(page, "window.pad.axes[1] = -0.5")
        await robot.until_moving()
        await fire(page, "window.pad.connected = false")
        await robot.until_stopped()
        await stays_still(robot)


@pytest.mark.alone
async def test_a_dialog_stops_within_the_lease_and_nothing_resumes(new_page: PageMaker) -> None:
    """While `alert` is open the page draws nothing, so it sends nothing."""
    async with driven() as (robot, address), lateness() as late:
        page = await opened(new_page, address)
        closing = asyncio.Event()

        async def keep(dialog: object) -> None:
            await closing.wait()
            await dialog.accept()  # type: ignore[attr-defined]  # Playwright's dialog

        page.on("dialog", keep)
        await push_until(robot.is_moving, page)
        last = robot.line.ticked_s
        opening = asyncio.create_task(fire(page, "setTimeout(() => alert('?'), 0)"))
        await robot.until_stopped()
        stopped_s = robot.line.written[-1][0]
        assert stopped_s - max(last, robot.line.ticked_s) <= LEASE_S + LATE_S + late.most_s
        closing.set()
        await opening
        await stays_still(robot)


@pytest.mark.alone
async def test_a_page_that_is_busy_stops_within_the_lease(new_page: PageMaker) -> None:
    """Three seconds of work on the page's thread: no tick, and none of them caught up on."""
    async with driven() as (robot, address), lateness() as late:
        page = await opened(new_page, address)
        await push_until(robot.is_moving, page)
        busy = asyncio.create_task(
            fire(page, "{ const end = performance.now() + 3000; while (performance.now() < end); }")
        )
        stopped_s = await robot.until_stopped()
        assert stopped_s - robot.line.ticked_s <= LEASE_S + LATE_S + late.most_s
        await busy
        await stays_still(robot)
        note = await text_of(page, "[data-cell='0'] .joystick-note").text_content() or ""
        assert note.startswith("◆ "), "it says why nothing moves"
        await page.mouse.up()
        await push_until(robot.is_moving, page)
        await page.mouse.up()


def renderers_of(browser: int) -> list[int]:
    """Return the processes that draw the pages of a browser."""
    found = []
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                words = (place / "cmdline").read_bytes()
                parents = (place / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if b"--type=renderer" in words and is_below(int(parents[1]), browser):
                found.append(int(place.name))
    return found


def is_below(process: int, ancestor: int) -> bool:
    """Return whether a process was started by another, however far above."""
    while process > 1:
        if process == ancestor:
            return True
        try:
            text = Path(f"/proc/{process}/stat").read_text()
        except OSError:
            return False
        process = int(text.rsplit(")", 1)[1].split()[1])
    return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to find a renderer")
@pytest.mark.alone
@pytest.mark.needs("chromium")
async def test_a_renderer_that_stands_still_stops_within_the_lease() -> None:
    """SIGSTOP is what a device that goes to sleep does to a page; the robot does not wait."""
    async with (
        driven() as (robot, address),
        running_browser(is_whole=True) as browser,
        lateness() as late,
    ):
        context = await browser.new_context(locale=LOCALE)
        await known_here(context)
        page = await context.new_page()
        page.set_default_timeout(PAGE_TIMEOUT_MS)
        await page.goto(address)
        await page.wait_for_selector("[data-cell='0'] .joystick[data-phase='idle']")
        await push_until(robot.is_moving, page)
        frozen = renderers_of(os.getpid())
        assert frozen
        for process in frozen:
            os.kill(process, signal.SIGSTOP)
        try:
            stopped_s = await robot.until_stopped()
            assert stopped_s - robot.line.ticked_s <= LEASE_S + LATE_S + late.most_s
        finally:
            for process in frozen:
                os.kill(process, signal.SIGCONT)
        await stays_still(robot)


async def test_ticks_are_skipped_while_the_socket_is_full(new_page: PageMaker) -> None:
    """What would wait behind other bytes is not sent at all; the newest goes when it is free."""
    async with calmly_driven() as (robot, address):
        page = await opened(new_page, address)
        await fire(
            page,
            "window.real = Object.getOwnPropertyDescriptor(WebSocket.prototype, 'bufferedAmount');"
            "Object.defineProperty(WebSocket.prototype, 'bufferedAmount',"
            " { configurable: true, get: () => 1 })",
        )
        await push(page)
        await asyncio.sleep(STILL_S)
        assert robot.line.texts == []
        await fire(
            page, "Object.defineProperty(WebSocket.prototype, 'bufferedAmount', window.real)"
        )
        await robot.until_moving()
        await page.mouse.up()
        await robot.until_stopped()
