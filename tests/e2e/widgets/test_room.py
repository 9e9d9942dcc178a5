"""The room that widgets give to what matters, in the cells that pages really have."""

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.gallery import resize
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

BATTERY = """() => {
  const cell = document.querySelector("[data-widget=battery][data-state-name=normal]");
  const box = (part) => cell.querySelector(part).getBoundingClientRect();
  return {
    picture: box(".battery-inner").height / cell.getBoundingClientRect().height,
    facts: [...cell.querySelectorAll(".battery-facts > li")]
      .filter((one) => one.offsetHeight).length,
  };
}"""
LEAST_BAR_PX = 4
SPEEDS = """() => [...document.querySelectorAll(".joystick .urc-speed, .joystick .urc-speed-next")]
  .filter((one) => {
    const [box, range] = [one.getBoundingClientRect(), document.createRange()];
    range.selectNodeContents(one.lastChild);
    const text = range.getBoundingClientRect();
    return box.width && (text.left < box.left + 4 || text.right > box.right - 4);
  })
  .map((one) => one.textContent.trim())"""
"""Speed steps whose figures touch the edge of their button."""
SIZE = """(el, [width, height]) => {
  el.style.cssText = `width: ${width}px; height: ${height}px; place-self: start; min-height: 0`;
}"""
CUT_VALUES = """() => [...document.querySelectorAll(".plot-value")]
  .filter((one) => one.offsetWidth > 0)
  .filter((one) => one.scrollWidth > one.clientWidth
    || one.getBoundingClientRect().right > one.closest("li").getBoundingClientRect().right + 1)
  .map((one) => one.textContent)"""
READOUT = """() => {
  const box = (part) => document.querySelector(part).getBoundingClientRect();
  return {
    drawing: getComputedStyle(document.querySelector(".scan-face")).visibility,
    isBelow: box(".scan-line").top >= box(".scan-title").bottom - 1,
    isOpen: document.querySelector(".urc-pip > .urc-swap").checkVisibility(),
  };
}"""
ENTRIES = """() => {
  const frame = document.querySelector(".plot-legend").getBoundingClientRect();
  return [...document.querySelectorAll(".plot-entry")].filter((one) => {
    const box = one.getBoundingClientRect();
    return box.width > 0 && box.left >= frame.left - 1 && box.right <= frame.right + 1
      && box.top >= frame.top - 1 && box.bottom <= frame.bottom + 1;
  }).length;
}"""


async def gallery(page: Page, address: str, widget: str) -> None:
    """Open the states of a widget."""
    await page.goto(f"{address}widgets/{widget}/")
    await page.wait_for_selector("[data-gallery][data-ready]")


@pytest.mark.parametrize(("width", "height"), [(165, 155), (221, 152), (305, 150), (358, 180)])
async def test_a_battery_in_a_wider_cell_is_no_smaller(
    new_page: PageMaker, width: int, height: int
) -> None:
    """The picture has a third of the height or more; volts and amperes stand next to it."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="desktop")
        await gallery(page, address, "battery")
        await resize(page, width, height)
        battery = await page.evaluate(BATTERY)
    assert battery["picture"] >= 0.3
    assert battery["facts"] == (3 if width > 200 else 0)


async def test_modules_in_a_chip_have_bars_and_the_lowest_voltage(new_page: PageMaker) -> None:
    """Seven bars that can be seen, next to the figure of the weakest module."""
    names = [f"module_{number}" for number in range(7)]
    signals = {name: Signal(name, unit="V", precision=2) for name in names}
    battery = WidgetUse("battery", "battery", lists={"modules": tuple(names)})
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[battery]))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await page.eval_on_selector(".urc-cell", SIZE, [153, 68])
        for number, name in enumerate(names):
            robot.set_reading(name, 4.1 - number / 100)
        await expect(page.locator(".battery-least")).to_have_text("▾ 4.04 V")
        widths = await page.locator(".battery-bar").evaluate_all(
            "(bars) => bars.map((bar) => bar.getBoundingClientRect().width)"
        )
    assert len(widths) == len(names)
    assert min(widths) >= LEAST_BAR_PX


@pytest.mark.parametrize("width", [260, 310, 345, 410])
async def test_a_speed_step_never_runs_out_of_its_button(new_page: PageMaker, width: int) -> None:
    """Steps take two rows where one is too narrow for their figures."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="desktop")
        await gallery(page, address, "joystick")
        for height in (220, 260, 300, 318):
            await resize(page, width, height)
            assert await page.evaluate(SPEEDS) == [], height


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1180, 820), (390, 844), (358, 640)])
async def test_the_legend_of_a_plot_shows_every_signal(
    new_page: PageMaker, width: int, height: int
) -> None:
    """Six joints, six entries with their values: none is past an edge."""
    names = [f"joint_{number}" for number in range(6)]
    signals = {name: Signal(name, unit="°", stale_after_s=60) for name in names}
    plot = WidgetUse("plot", "plot", lists={"series": tuple(names)})
    grid = Layout(3, 2, (Slot("plot", 0, 0, 1, 2),))
    profile = dashboard_profile(signals=signals, uses=[plot])
    robot = FakeRobot(profile._replace(interfaces={"x": Interface("x", "X", {"landscape": grid})}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.set_viewport_size({"width": width, "height": height})
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for name in names:
            robot.set_reading(name, -90.25)
        await page.locator(".plot-value", has_text="-90.25 °").nth(5).wait_for(state="attached")
        assert await page.evaluate(ENTRIES) == len(names)


@pytest.mark.parametrize(("width", "height"), [(144, 108), (160, 90), (205, 150), (231, 174)])
async def test_a_small_plot_shows_the_values_that_fit_and_the_number_of_the_others(
    new_page: PageMaker, width: int, height: int
) -> None:
    """Names lose the words that all share; no value is cut; the rest is counted."""
    names = [f"joint_{number}" for number in range(8)]
    signals = {name: Signal(name, unit="°", title=f"Joint {name[-1]}") for name in names}
    plot = WidgetUse("plot", "plot", lists={"series": tuple(names)})
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[plot]))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await page.eval_on_selector(".urc-cell", SIZE, [width, height])
        for name in names:
            robot.set_reading(name, -90.25)
        await page.locator(".plot-value", has_text="-90.25 °").nth(7).wait_for(state="attached")
        await page.wait_for_function("() => document.querySelector('.plot-rest')")
        shown = await page.evaluate(ENTRIES)
        rest = await page.inner_text(".plot-rest")
        cut = await page.evaluate(CUT_VALUES)
        await page.click(".plot-rest")
        await expect(page.locator(".plot-entry:visible")).to_have_count(len(names))
        await page.click(".plot-legend > li >> nth=0")
        await expect(page.locator(".plot-rest")).to_have_text(rest)
    assert shown >= 1
    assert rest == f"{len(names) - shown} more readings"
    assert cut == []


async def test_a_view_too_low_for_a_drawing_is_a_name_with_a_value(new_page: PageMaker) -> None:
    """The value covers no drawing; the button that enlarges the view stays."""
    signals = {
        "eye": Signal("eye", "image", stale_after_s=1.0),
        "laser": Signal("laser", "scan", stale_after_s=1.0),
    }
    uses = [
        WidgetUse("eye", "camera", {"image": "eye"}),
        WidgetUse("laser", "scan", {"scan": "laser"}),
    ]
    profile = dashboard_profile(signals=signals, uses=uses)
    grid = Layout(2, 2, (Slot("eye", 1, 1), Slot("laser", 0, 1)))
    interface = Interface("x", "X", {"landscape": grid}, background="eye")
    robot = FakeRobot(profile._replace(interfaces={"x": interface}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.set_viewport_size({"width": 844, "height": 390})
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for height, drawing in ((108, "visible"), (58, "hidden")):
            await page.eval_on_selector(".urc-pip", SIZE, [144, height])
            found = await page.evaluate(READOUT)
            assert found == {"drawing": drawing, "isBelow": True, "isOpen": True}
