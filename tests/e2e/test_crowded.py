"""A page with little room: low screens, large text, and questions in the lowest cells."""

import pytest
from playwright.async_api import Page, expect

from tests.e2e.browser import running_browser
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import is_on_top, running_dashboard, turned, until, until_attribute
from tests.e2e.keys import known_here
from tests.e2e.motion.driving import (
    CALM_LEASE_S,
    USES,
    Wire,
    commands,
    driven,
    held,
    number,
    push,
)
from urc.model.driver import Command
from urc.model.exchange import Confirm
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import AlarmAttributes, AlarmLimits, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

SCREENS = ((320, 568), (390, 844), (667, 375), (844, 390), (1180, 820), (1440, 900))
LEAST_ROOM = 0.3
"""Share of the screen that header and bar leave for widgets."""
BARS = """() => {
  const stop = document.querySelector("[data-stop-button]");
  const word = document.createRange();
  word.selectNodeContents(stop);
  const [inner, outer] = [word.getBoundingClientRect(), stop.getBoundingClientRect()];
  const bar = document.querySelector(".urc-controls").getBoundingClientRect();
  const header = document.querySelector(".urc-bar").getBoundingClientRect();
  return {
    isWhole: inner.left >= outer.left && inner.right <= outer.right && outer.right <= innerWidth,
    lines: word.getClientRects().length,
    room: (bar.top - header.bottom) / innerHeight,
    isWide: document.documentElement.scrollWidth > innerWidth,
  };
}"""


ROWS = """() => {
  const parts = [...document.querySelectorAll(".urc-bar > *")];
  const boxes = parts.map((one) => one.getBoundingClientRect()).filter(({ height }) => height);
  return new Set(boxes.map(({ top, height }) => Math.round(top + height / 2))).size;
}"""


async def test_the_bar_of_an_error_is_one_row_on_a_phone(new_page: PageMaker) -> None:
    """As the menu's is."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="phone")
        new_page.allow(page, lambda text: "404" in text)
        for path in ("nothing", ""):
            await page.goto(f"{address}{path}")
            assert await page.evaluate(ROWS) == 1, path


NARROW_PX = (320, 360, 390, 430, 500, 560, 599, 600, 700, 820)
LEAST_TITLE_PX = 72
"""Six letters of a robot's name."""
BAR = """() => {
  const box = (name) => document.querySelector(name).getBoundingClientRect();
  const [title, badge, bar] = [".urc-bar-title", ".urc-badge", ".urc-bar"].map(box);
  const { scrollWidth, clientWidth } = document.querySelector(".urc-bar-title");
  return {
    title: title.width, isCut: scrollWidth > clientWidth, rows: bar.height / title.height,
    isSecondRow: badge.top >= title.bottom,
    isWide: document.documentElement.scrollWidth > innerWidth,
  };
}"""


@pytest.mark.parametrize("is_live", [True, False])
async def test_the_robots_name_keeps_its_room_on_narrow_screens(
    new_page: PageMaker, *, is_live: bool
) -> None:
    """The bar has one row on every screen; the badge never crushes the title."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        robot.link("live" if is_live else "lost")
        await until_attribute(page, "[data-badge]", "data-state", "good" if is_live else "bad")
        for width in NARROW_PX:
            await turned(page, (width, 900))
            bar = await page.evaluate(BAR)
            assert not bar["isCut"] or bar["title"] >= LEAST_TITLE_PX, width
            assert not bar["isSecondRow"], width
            assert not bar["isWide"], width


@pytest.mark.parametrize("size_px", [24, 32])
async def test_large_text_leaves_stop_whole_and_room_for_widgets(size_px: int) -> None:
    """Half as large again, or twice: STOP is one whole word, and the bars do not meet."""
    robot = FakeRobot(
        dashboard_profile(
            signals={"at": Signal("at")},
            uses=[WidgetUse("at", "value", {"value": "at"})],
            commands={"go": held("go", number("x"), lease_s=CALM_LEASE_S)},
        )
    )
    flag = f"--blink-settings=defaultFontSize={size_px}"
    async with driven(robot=robot) as (_, address), running_browser(flag) as large:
        context = await large.new_context()
        await known_here(context)
        page = await context.new_page()
        await page.goto(address)
        await page.locator("[data-stop-button]").wait_for()
        for width, height in SCREENS:
            await turned(page, (width, height))
            bars = await page.evaluate(BARS)
            assert bars["isWhole"], (width, height)
            assert bars["lines"] == 1, (width, height)
            assert not bars["isWide"], (width, height)
            assert bars["room"] > LEAST_ROOM, (width, height)


async def test_a_question_is_whole_in_the_lowest_cells(new_page: PageMaker) -> None:
    """It has the height of its words and its buttons, and hangs out of no screen."""
    asked = Confirm(level="hazardous", text="The arm will move to where it was before.")
    commands = {
        name: Command(name, "wire", WriteSpec("text", {}), confirm=asked, title="Play")
        for name in ("first", "last")
    }
    uses = [WidgetUse(name, "button", {}, {"press": name}, title=name) for name in commands]
    values = [WidgetUse(f"v{place}", "value", {"value": "at"}) for place in range(6)]
    slots = ["first", *(use.slot for use in values), "last"]
    grid = Layout(4, 2, tuple(Slot(name, *divmod(place, 2)) for place, name in enumerate(slots)))
    profile = dashboard_profile(
        signals={"at": Signal("at")}, uses=[*uses, *values], commands=commands
    )
    robot = FakeRobot(profile._replace(interfaces={"x": Interface("x", "X", {"landscape": grid})}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.set_viewport_size({"width": 390, "height": 844})
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for name in commands:
            cell = page.locator(".urc-cell", has=page.get_by_role("button", name=name))
            await cell.get_by_role("button").click()
            question = cell.locator(".urc-ask")
            await expect(question).to_be_visible()
            high, seen, top, bottom = await question.evaluate(
                "(el) => [el.scrollHeight, el.clientHeight,"
                " el.getBoundingClientRect().top, el.getBoundingClientRect().bottom]"
            )
            assert high <= seen, name
            assert 0 <= top < bottom <= 844, name
            await question.get_by_role("button", name="Cancel").click()


HEIGHTS = """() => [...document.querySelectorAll(".urc-cell:not([data-place='ground'])")].map(
    (el) => Math.round(el.getBoundingClientRect().height))"""
STILL = """() => [...document.querySelectorAll("[data-stop-button], .joystick-face, .urc-cell")]
    .map((el) => el.getBoundingClientRect()).map(({ x, y }) => [Math.round(x), Math.round(y)])"""


async def test_displays_make_way_on_a_low_phone_while_a_stick_is_held(new_page: PageMaker) -> None:
    """They become as low as values; an alarm covers neither them nor the background's buttons."""
    robot = Wire(lease_s=CALM_LEASE_S)
    low = AlarmLimits(low=20, attributes=(("low", AlarmAttributes("high", "", "Dock it.")),))
    signals = {
        **{name: Signal(name, "image", title=name.title()) for name in ("front", "side", "rear")},
        "charge": Signal("charge", unit="%", stale_after_s=60, limits=low),
        "course": Signal("course", unit="deg", stale_after_s=60),
    }
    uses = [
        USES[0],
        WidgetUse("front", "camera", lists={"images": ("front", "side")}),
        WidgetUse("rear", "camera", {"image": "rear"}),
        WidgetUse("charge", "value", {"value": "charge"}),
        WidgetUse("course", "compass", {"heading": "course"}),
    ]
    slots = (Slot("charge", 0, 0), Slot("course", 0, 2), Slot("rear", 0, 3), Slot("left", 0, 4, 2))
    interface = Interface("x", "X", {"landscape": Layout(2, 5, slots)}, background="front")
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands(CALM_LEASE_S))
    robot.profile = profile._replace(interfaces={"x": interface})
    async with driven(robot=robot) as (_, address):
        page = await new_page()
        await turned(page, (844, 390))
        await page.goto(address)
        await expect(page.locator(".joystick")).to_have_attribute("data-phase", "idle")
        free, places = await page.evaluate(HEIGHTS), await page.evaluate(STILL)
        assert sum(height > 100 for height in free) == 3, free
        await push(page, ".joystick-pad")
        await robot.until_moving()
        assert await page.evaluate(STILL) == places
        held_heights = await page.evaluate(HEIGHTS)
        assert sorted(held_heights)[:3] == [58, 58, 58], held_heights
        robot.set_reading("charge", 10, alarm="low")
        await page.locator("[data-alarm-strip]").wait_for()
        await until_uncovered(page)
        await page.mouse.up()
        await robot.until_stopped()
        assert await page.evaluate(HEIGHTS) == free


async def until_uncovered(page: Page) -> None:
    """Wait until the strip of an alarm, which is on top, covers no display and no button."""
    for name in ("Front", "Side"):
        await expect(page.get_by_role("button", name=name, exact=True)).to_be_visible()
    await page.wait_for_function(UNCOVERED)
    assert await is_on_top(page, "[data-alarm-seen]")


UNCOVERED = """() => {
  const strip = document.querySelector("[data-alarm-strip]").getBoundingClientRect();
  const shown = [...document.querySelectorAll(
    ".urc-pip, [data-footprint='instrument'], [data-place='ground'] .urc-view-button")]
    .filter((el) => el.checkVisibility()).map((el) => el.getBoundingClientRect());
  return shown.length >= 4 && shown.every(({ left, top, right, bottom }) =>
    bottom <= strip.top || top >= strip.bottom || right <= strip.left || left >= strip.right);
}"""
