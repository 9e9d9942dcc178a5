"""The button of a small screen for the widgets that its layout lacks."""

import re

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, turned, until
from tests.e2e.motion.driving import LEFT, UP, driven, opened, push
from tests.e2e.test_layouts import PHONE, PHONE_LYING, TABLET, gauged, row, steered
from urc.model.interface import Interface
from urc.model.values import AlarmLimits, Signal
from urc.testing.dashboard import FakeRobot

pytestmark = pytest.mark.anyio


async def test_a_button_lists_the_widgets_that_a_small_screen_lacks_and_leads_to_them(
    new_page: PageMaker,
) -> None:
    """Only screens that lack widgets show it. Each change of the page releases held controls."""
    grids = {"landscape": row("left", "right", "up"), "phone_landscape": row("left")}
    async with driven(robot=steered(Interface("x", "X", grids))) as (robot, address):
        page = await opened(new_page, address)
        more = page.locator("[data-rest]")
        await expect(more).to_be_hidden()
        await turned(page, PHONE_LYING)
        await expect(page.locator(UP)).to_be_hidden()
        await expect(more).to_have_attribute("aria-pressed", "false")
        await expect(more).to_have_text("More (2)")
        await expect(more).to_have_attribute("title", re.compile(r"^More \(2\): .+, Lift$"))
        await expect(more).to_have_accessible_name(re.compile(r"^More \(2\): "))
        await push(page)
        await robot.until_moving()
        await more.focus()
        await page.keyboard.press("Enter")
        await page.locator("[data-rest-list]").get_by_role("button", name="Lift").focus()
        await page.keyboard.press("Enter")
        await robot.until_stopped()
        await page.mouse.up()
        await expect(more).to_have_attribute("aria-pressed", "true")
        await expect(more).to_have_accessible_name("Back")
        await expect(page.locator("[data-rest-list]")).to_be_hidden()
        await expect(page.locator(LEFT)).to_be_hidden()
        await page.locator(UP).hover()
        await page.mouse.down()
        await robot.until_moving("lift")
        await more.focus()
        await page.keyboard.press("Enter")
        await robot.until_stopped("lift")
        await page.mouse.up()
        await expect(page.locator(UP)).to_be_hidden()
        await push(page)
        await robot.until_moving()
        await page.mouse.up()
        await robot.until_stopped()


async def test_the_button_for_missing_widgets_marks_those_with_an_alarm(
    new_page: PageMaker,
) -> None:
    """The shape of the alarm's priority, at the button and before the widget's name."""
    grids = {"landscape": row("a", "b", "c"), "phone_landscape": row("a")}
    robot = gauged(Interface("x", "X", grids))
    signals = {**robot.profile.driver.signals, "c": Signal("c", limits=AlarmLimits(hihi=4))}
    driver = robot.profile.driver._replace(signals=signals)
    robot = FakeRobot(robot.profile._replace(driver=driver))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await turned(page, PHONE_LYING)
        more = page.locator("[data-rest]")
        await expect(more).to_have_text("More (2)")
        robot.set_reading("c", 5, alarm="hihi")
        await expect(more).to_have_text("More (2) ▲")
        await expect(more).to_have_accessible_name("More (2): B, C · Alarm")
        await more.click()
        await expect(page.locator("[data-rest-list] > button")).to_have_text(["B", "▲ C"])


async def test_the_button_has_the_name_that_the_interface_gives_to_the_missing_widgets(
    new_page: PageMaker,
) -> None:
    """The name of the drawer, if it has all of them; a narrow screen has room for one word."""
    sticks = row("left", "right", "up")
    grids = {"landscape": sticks, "portrait": row("left"), "phone_landscape": row("left")}
    interface = Interface("x", "X", grids, background="left", drawer="Arms")
    async with driven(robot=steered(interface)) as (_, address):
        page = await opened(new_page, address)
        more = page.locator("[data-rest]")
        await turned(page, TABLET)
        await expect(more).to_have_text("Arms")
        await expect(more).to_have_accessible_name(re.compile(r"^Arms: .+, Lift$"))
        await turned(page, PHONE)
        await expect(more).to_have_text("More")
