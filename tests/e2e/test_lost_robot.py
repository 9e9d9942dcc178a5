"""The card of a lost robot in a real browser: cause, next step, Try now; and widgets keep quiet."""

import re
from contextlib import AbstractAsyncContextManager

import pytest
from playwright.async_api import Page, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import Size, choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute
from tests.e2e.drawn import RED, plain
from tests.e2e.motion.driving import LEASE_S, commands
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.values import Signal
from urc.runtime.hub import LinkState
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.transports.base import MissingPackage

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


def seeing_robot(*others: WidgetUse) -> FakeRobot:
    """Return a robot whose camera is the background, with a battery and other widgets in front."""
    signals = {
        "eye": Signal("eye", "image", stale_after_s=1.0),
        "battery": Signal("battery", "integer", unit="%", stale_after_s=1.0),
        "laser": Signal("laser", "scan", stale_after_s=1.0),
    }
    uses = (
        WidgetUse("eye", "camera", {"image": "eye"}),
        WidgetUse("battery", "battery", {"level": "battery"}),
        *others,
    )
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands(LEASE_S))
    slots = (Slot(one.slot, 1, column) for column, one in enumerate(others))
    grid = Layout(2, 2, (Slot("eye", 1, 1), Slot("battery", 0, 0), *slots))
    interface = Interface("default", "Default", {"landscape": grid}, background="eye")
    return FakeRobot(profile._replace(interfaces={"default": interface}))


GROUND_CELL = "[data-place='ground']"
OF_PICTURE = """() => {
  const canvas = document.querySelector(".camera-picture");
  const { visibility, filter } = getComputedStyle(canvas);
  const hatch = getComputedStyle(canvas.closest(".urc-view"), "::after").backgroundImage;
  return { visibility, filter, hatch, width: canvas.width };
}"""


@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_the_last_picture_and_values_stay_in_sight_and_say_their_age(
    new_page: PageMaker, size: Size
) -> None:
    """Far longer than values of a live link; also after a reload; no longer than the loss."""
    robot = seeing_robot()
    async with running_dashboard(robot) as address:
        other, page = await new_page(size=size), await new_page(size=size)
        # The robot stays open while the page is loaded again.
        await other.goto(f"{address}robots/puppet/")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("eye", plain(RED))
        robot.set_reading("battery", 73)
        await until_attribute(page, ".camera", "data-state", "live")
        await expect(page.locator(GROUND_CELL)).not_to_have_attribute("data-old", re.compile(""))
        robot.set_reading("eye", plain(RED), age_s=125)
        robot.set_reading("battery", 73, age_s=125)
        robot.link("lost", REFUSED, age_s=125)
        for _ in range(2):
            await expect(page.locator(CARD)).to_be_visible()
            await expect(page.locator("[data-lost-age]")).to_have_text("Last picture: 2 min ago")
            await until_attribute(page, GROUND_CELL, "data-old", "2 min old")
            await page.wait_for_function(
                "() => document.querySelector('.camera-picture').width === 8"
            )
            look = await page.evaluate(OF_PICTURE)
            assert look["visibility"] == "visible"
            assert "grayscale(1)" in look["filter"]
            assert "repeating-linear-gradient" in look["hatch"]
            await expect(page.locator(".battery")).to_contain_text("73")
            await expect(page.locator(".battery")).to_contain_text("2 min old")
            await page.wait_for_function(f"() => ({COVERED})().length === 0")
            await page.reload()
        robot.link("live")
        robot.set_reading("eye", plain(RED))
        robot.set_reading("battery", 73)
        await expect(page.locator(CARD)).to_be_hidden()
        await expect(page.locator(GROUND_CELL)).not_to_have_attribute("data-old", re.compile(""))


async def test_an_old_value_is_whole_next_to_its_age_on_a_phone(new_page: PageMaker) -> None:
    robot = seeing_robot(WidgetUse("laser", "scan", {"scan": "laser"}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("battery", 42)
        await expect(page.locator(".battery-digits")).to_have_text("42")
        robot.link("lost", REFUSED)
        await expect(page.locator(".battery-note")).to_contain_text("old")
        for width, height in ((390, 844), (844, 390)):
            await page.set_viewport_size({"width": width, "height": height})
            value = await page.locator(".battery-meter").bounding_box()
            number = await page.locator(".battery-number").bounding_box()
            cell = await page.locator("[data-cell]:has(> .battery)").bounding_box()
            assert value is not None
            assert number is not None
            assert cell is not None
            assert value["width"] >= number["width"] > 20
            assert number["y"] + number["height"] <= cell["y"] + cell["height"]


async def test_a_view_without_data_keeps_its_title(new_page: PageMaker) -> None:
    robot = seeing_robot(WidgetUse("laser", "scan", {"scan": "laser"}, title="Laser"))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await lose(page, address, robot)
        title = await page.locator(".scan-title").bounding_box()
        cell = await page.locator("[data-cell]:has(> .scan)").bounding_box()
        assert title is not None
        assert cell is not None
        assert cell["y"] <= title["y"] < title["y"] + title["height"] <= cell["y"] + 40


async def test_controls_behind_the_card_are_out_of_sight_until_the_robot_is_back(
    new_page: PageMaker,
) -> None:
    """Below the last picture of a phone; STOP and a control with the focus stay in sight."""
    robot = lifting_robot()
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        control = page.locator(".urc-cell:has(.hold-button)").last
        await expect(control).to_have_css("opacity", "1")
        robot.set_reading("eye", plain(RED))
        await until_attribute(page, ".camera", "data-state", "live")
        robot.link("lost", REFUSED)
        await expect(page.locator(CARD)).to_be_visible()
        await expect(control).to_have_css("opacity", "0")
        await expect(page.locator("[data-stop-button]")).to_be_visible()
        await control.locator(".hold-button-main").focus()
        await expect(control).to_have_css("opacity", "1")
        await page.locator("[data-lost-again]").focus()
        robot.link("live")
        await expect(control).to_have_css("opacity", "1")


GAP = """() => {
  const box = (selector) => document.querySelector(selector).getBoundingClientRect();
  const [card, view] = [box(".urc-lost-card"), box(".urc-cell:has(> .scan)")];
  return view.top - card.bottom;
}"""
"""Pixels between the card and the view below it."""
SLACK = """() => {
  const card = document.querySelector(".urc-lost-card");
  const box = card.getBoundingClientRect();
  const style = getComputedStyle(card);
  const first = card.firstElementChild.getBoundingClientRect();
  const last = card.lastElementChild.getBoundingClientRect();
  const inside = last.bottom - first.top;
  return box.height - inside - parseFloat(style.paddingTop) - parseFloat(style.paddingBottom);
}"""
"""Empty height in the card, in pixels."""


def lifting_robot(*views: WidgetUse) -> FakeRobot:
    """Return a robot with values at the top, five controls below them, and views at the bottom."""
    names = ("lift", "raise", "hoist", "heave", "lower")
    lifts = [WidgetUse(one, "hold-button", {}, {"held": "lift"}) for one in names]
    robot = seeing_robot(*lifts, *views)
    rows = [Slot(one, 1 + row, 0) for row, one in enumerate((*names, *(v.slot for v in views)))]
    grids = {"phone_portrait": Layout(1 + len(rows), 2, (Slot("battery", 0, 0), *rows))}
    interface = Interface("default", "Default", grids, background="eye")
    return FakeRobot(robot.profile._replace(interfaces={"default": interface}))


async def test_on_a_phone_the_card_is_small_and_above_the_views(new_page: PageMaker) -> None:
    """It takes the place of the controls, as low as possible; the views say their age."""
    robot = lifting_robot(WidgetUse("laser", "scan", {"scan": "laser"}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.link("lost", REFUSED)
        await expect(page.locator(CARD)).to_be_visible()
        await expect(page.locator(".urc-cell:has(> .scan)")).to_have_css("opacity", "1")
        await page.wait_for_function(f"() => ({GAP})() >= 0 && ({GAP})() <= 24")
        assert await page.evaluate(SLACK) <= 6, "its edges"
        await page.wait_for_function(f"() => ({COVERED})().length === 0")


async def test_on_a_phone_the_card_is_next_to_stop_if_nobody_drives(new_page: PageMaker) -> None:
    """The row of the driver is empty, so the card takes its place below the last picture."""
    robot = lifting_robot()
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("eye", plain(RED))
        await until_attribute(page, ".camera", "data-state", "live")
        robot.link("lost", REFUSED)
        await expect(page.locator(CARD)).to_be_visible()
        await page.wait_for_function(
            """() => {
              const box = (selector) => document.querySelector(selector).getBoundingClientRect();
              const gap = box("[data-stop-button]").top - box(".urc-lost-card").bottom;
              return gap >= 4 && gap <= 24;
            }"""
        )
        await page.wait_for_function(f"() => ({COVERED})().length === 0")


@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_without_a_picture_the_card_is_in_the_background_and_controls_say_why(
    new_page: PageMaker, size: Size
) -> None:
    lift = WidgetUse("lift", "hold-button", {}, {"held": "lift"})
    robot = seeing_robot(lift)
    async with running_dashboard(robot) as address:
        page = await new_page(size=size)
        await lose(page, address, robot)
        await expect(page.locator("[data-lost-age]")).to_have_text("No picture: not connected")
        await page.wait_for_function(f"() => ({COVERED})().length === 0")
        control = page.locator(".urc-cell:has(.hold-button)")
        await expect(control).to_have_css("opacity", "1")
        said = "(el) => getComputedStyle(el, '::before').content"
        note = control.locator(".urc-why, .urc-foot-note, .urc-board-note")
        assert await note.evaluate(said) == '"◆ No link"'
        boxes = [await one.bounding_box() for one in (page.locator(CARD), control)]
        card, below = (box for box in boxes if box)
        assert card["y"] + card["height"] <= below["y"] or card["x"] >= below["x"] + below["width"]


COVERED = """() => {
  const box = (selector) => document.querySelector(selector).getBoundingClientRect();
  const card = box(".urc-lost-card");
  return [".battery", ".urc-stop-button", ".urc-bar"].filter((name) => {
    const { left, right, top, bottom } = box(name);
    return left < card.right && right > card.left && top < card.bottom - 1 && bottom > card.top + 1;
  });
}"""
"""What the card covers of what must stay in sight."""


async def test_what_is_shown_is_old_at_once_when_the_server_is_gone(new_page: PageMaker) -> None:
    """Before the card, which waits for a moment; the age counts on without the server."""
    robot = seeing_robot()
    page = await new_page()
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("eye", plain(RED))
        robot.set_reading("battery", 73)
        await until_attribute(page, ".camera", "data-state", "live")
    await expect(page.locator(GROUND_CELL)).to_have_attribute("data-old", re.compile(r"\d s old$"))
    await expect(page.locator(CARD)).to_contain_text("No connection to URC")
    await expect(page.locator("[data-lost-age]")).to_have_text(
        re.compile(r"^Last picture: ([3-9]|\d\d) s ago$")
    )
    await expect(page.locator(".battery")).to_contain_text("73")


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


PACKAGE = "mqtt needs the package paho-mqtt: " + "x" * 90 + " -m pip install 'paho-mqtt<3,>=2.1'"


class UninstalledRobot(FakeRobot):
    """A robot whose transport needs an extra that is not installed."""

    def open(self) -> AbstractAsyncContextManager[FakeRobot]:
        raise MissingPackage(PACKAGE)


async def test_a_robot_whose_extra_is_missing_is_not_a_lost_server(new_page: PageMaker) -> None:
    """The card has the whole command, however long it is."""
    uses = [WidgetUse("link", "link"), WidgetUse("alerts", "alerts")]
    async with running_dashboard(UninstalledRobot(dashboard_profile(uses=uses))) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await expect(page.locator(CARD)).to_contain_text("Cannot open Puppet")
        await expect(page.locator(CARD)).to_contain_text(PACKAGE)
        await expect(page.locator(CARD)).to_contain_text("Install it, then start URC again.")
        await expect(page.locator("[data-badge-text]")).to_have_text("Cannot open")
        await expect(page.locator(".link-now")).to_have_text("▲ Cannot open")
        await expect(page.locator(".alerts-note")).to_contain_text("not connected to the robot")
        lost_server = re.compile("connect(ion|ed) to URC", re.IGNORECASE)
        await expect(page.locator("body")).not_to_contain_text(lost_server, use_inner_text=True)
