"""The drawer of a phone in landscape: the controls for which its layout has no place."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import turned, until
from tests.e2e.motion.driving import (
    CALM_LEASE_S,
    USES,
    Wire,
    centre,
    commands,
    driven,
    fingers_on,
    fresh,
    is_motion,
)
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.values import Signal
from urc.runtime.running_goals import RunningGoal
from urc.testing.dashboard import dashboard_profile

pytestmark = pytest.mark.anyio

PHONE, PHONE_LYING, TABLET, DESKTOP = (390, 844), (844, 390), (820, 1180), (1440, 900)
HANDLE, DRAWER, LIFT = "[data-drawer-handle]", "[data-drawer]", ".hold-button-main"
STICK, STOP = ".joystick-pad", "[data-stop-button]"


def crowded() -> Wire:
    """Return a robot with two sticks, and no place for a button and a value on a low screen."""
    robot = Wire(lease_s=CALM_LEASE_S)
    signals = {"front": Signal("front", "image"), "state": Signal("state", title="Winch")}
    uses = (
        *USES,
        WidgetUse("front", "camera", {"image": "front"}),
        WidgetUse("state", "value", {"value": "state"}),
    )
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands(CALM_LEASE_S))
    sticks = (Slot("left", 1, 0, 2), Slot("right", 1, 3, 2))
    grids = {
        "landscape": Layout(3, 4, (Slot("up", 0, 0), Slot("state", 0, 3), *sticks)),
        "phone_landscape": Layout(3, 4, sticks),
    }
    interface = Interface("default", "Default", grids, background="front")
    robot.profile = profile._replace(interfaces={"default": interface})
    return robot


async def lying(new_page: PageMaker, address: str) -> Page:
    """Open the robot's page on a phone in landscape, and wait until it can be driven."""
    page = await fresh(new_page, "phone")
    await page.goto(address)
    await turned(page, PHONE_LYING)
    await expect(page.locator(".joystick").first).to_have_attribute("data-phase", "idle")
    await expect(page.locator(HANDLE)).to_be_visible()
    return page


SEEN = """([drawer, ...others]) => {
  const box = (el) => el.getBoundingClientRect();
  const { left, right, top, bottom } = box(document.querySelector(drawer));
  const met = (el) => {
    const { x, y, width, height } = box(el);
    return el.contains(document.elementFromPoint(x + width / 2, y + height / 2));
  };
  const all = others.flatMap((name) => [...document.querySelectorAll(name)]);
  const covered = all.filter((el) => {
    const other = box(el);
    return other.left < right && other.right > left && other.top < bottom && other.bottom > top;
  });
  const isWhole = left >= 0 && right <= innerWidth && top >= 0 && bottom <= innerHeight;
  return { count: all.length, met: all.filter(met).length, covered: covered.length, isWhole };
}"""


async def test_what_has_no_place_is_in_a_drawer_and_only_on_a_low_screen(
    new_page: PageMaker,
) -> None:
    """By name, above STOP and between the sticks, which stay free."""
    async with driven(robot=crowded()) as (_, address):
        page = await lying(new_page, address)
        await expect(page.locator("[data-rest]")).to_be_hidden()
        await expect(page.locator(LIFT)).to_be_hidden()
        await expect(page.locator(HANDLE)).to_have_text("Lift, Winch")
        await page.locator(HANDLE).click()
        drawer = page.get_by_role("group", name="More controls")
        await expect(drawer.locator(LIFT)).to_contain_text("Lift")
        await expect(drawer).to_contain_text("Winch")
        await page.evaluate("Promise.all(document.getAnimations().map((one) => one.finished))")
        seen = await page.evaluate(SEEN, [DRAWER, STICK, STOP])
        assert seen == {"count": 3, "met": 3, "covered": 0, "isWhole": True}
        for size in (PHONE, TABLET, DESKTOP):
            await turned(page, size)
            await expect(page.locator(HANDLE)).to_be_hidden()
            await expect(page.locator(LIFT)).to_be_visible()
            await expect(page.locator("[data-drawer-head]")).to_be_hidden()
        await turned(page, PHONE_LYING)
        await expect(page.locator(HANDLE)).to_be_visible()
        await expect(page.locator(LIFT)).to_be_hidden()


async def test_the_handle_has_the_title_that_the_interface_gives(new_page: PageMaker) -> None:
    robot = crowded()
    interface = robot.profile.interfaces["default"]._replace(drawer="Cargo")
    robot.profile = robot.profile._replace(interfaces={"default": interface})
    async with driven(robot=robot) as (_, address):
        page = await lying(new_page, address)
        await expect(page.locator(HANDLE)).to_have_text("Cargo")
        await page.locator(HANDLE).click()
        await expect(page.get_by_role("group", name="Cargo").locator(LIFT)).to_be_visible()


async def test_a_control_in_the_drawer_is_released_when_it_closes_and_sticks_are_not(
    new_page: PageMaker,
) -> None:
    """The other finger drives meanwhile; a tap on the background closes the drawer."""
    async with driven(robot=crowded()) as (robot, address):
        page = await lying(new_page, address)
        fingers = await fingers_on(page)
        x, y = await centre(page, f"{STICK} >> nth=0")
        await fingers.put(1, x, y)
        await fingers.put(1, x, y - 50)
        await robot.until_moving("drive")
        await fingers.put(2, *await centre(page, HANDLE))
        await fingers.lift(2)
        await expect(page.locator(LIFT)).to_be_visible()
        await fingers.put(2, *await centre(page, LIFT))
        await robot.until_moving("lift")
        await fingers.put(3, 422, 60)
        await robot.until_stopped("lift")
        await expect(page.locator(LIFT)).to_be_hidden()
        count = len(robot.line.texts)
        await until(lambda: len(robot.after(count)) > 3)
        assert all(is_motion(text, "drive") for text in robot.after(count))
        for finger in (3, 2, 1):
            await fingers.lift(finger)
        await robot.until_stopped("drive")
        assert robot.latched == []


async def swipe(page: Page) -> None:
    """Pull the head of the drawer down."""
    x, y = await centre(page, ".urc-drawer-title")
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x, y + 80, steps=4)
    await page.mouse.up()


WAYS: Mapping[str, Callable[[Page], Awaitable[object]]] = {
    "its button": lambda page: page.locator("[data-drawer-close]").click(),
    "Escape": lambda page: page.keyboard.press("Escape"),
    "a tap on the background": lambda page: page.mouse.click(422, 60),
    "a swipe": swipe,
}


async def test_the_drawer_closes_in_each_way_and_none_of_them_is_stop(new_page: PageMaker) -> None:
    async with driven(robot=crowded()) as (robot, address):
        page = await lying(new_page, address)
        for name, close in WAYS.items():
            await page.locator(HANDLE).click()
            await expect(page.locator(LIFT)).to_be_visible()
            await close(page)
            await expect(page.locator(LIFT), name).to_be_hidden()
            await expect(page.locator(HANDLE)).to_have_attribute("aria-expanded", "false")
        await page.locator(HANDLE).focus()
        await page.keyboard.press("Enter")
        await expect(page.locator("[data-drawer-close]")).to_be_focused()
        await page.keyboard.press("Escape")
        await expect(page.locator(HANDLE)).to_be_focused()
        assert robot.latched == []
        assert not any(is_motion(text, "lift") for text in robot.line.texts)


@pytest.mark.parametrize(
    "how", ["its button", "Escape while a stick is held", "Escape while the robot moves by itself"]
)
async def test_stop_works_over_an_open_drawer(new_page: PageMaker, how: str) -> None:
    async with driven(robot=crowded()) as (robot, address):
        page = await lying(new_page, address)
        await page.locator(HANDLE).click()
        await expect(page.locator(LIFT)).to_be_visible()
        if how == "its button":
            await page.locator(STOP).click()
        elif how == "Escape while the robot moves by itself":
            robot.hub.begin_goal(RunningGoal(0, "goal"))  # sent by any screen
            await asyncio.sleep(0.5)
            await page.keyboard.press("Escape")
            await until(lambda: len(robot.latched) == 1)
        else:
            x, y = await centre(page, f"{STICK} >> nth=0")
            await page.mouse.move(x, y)
            await page.mouse.down()
            await page.mouse.move(x, y - 50, steps=3)
            await robot.until_moving("drive")
            await page.keyboard.press("Escape")
        await expect(page.locator("[data-latched]")).to_be_visible()
        await until(lambda: len(robot.latched) == 1)
        await page.mouse.up()
