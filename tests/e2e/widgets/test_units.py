"""People who read other units than the robot's: nothing they see is another number than it was."""

import csv
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from tests.e2e.drawn import PIXELS_OF
from urc.model.interface import WidgetUse
from urc.model.values import AlarmLimits, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

SIGNALS = {
    signal.name: signal
    for signal in (
        Signal("pace", "number", unit="m/s"),
        Signal("dash", "number", unit="m/s", limits=AlarmLimits(hihi=8)),
        Signal("rise", "number", unit="m"),
        Signal("gap", "number", unit="mm", precision=0),
        Signal("ticks", "integer", min=0, max=20000),
    )
}


LINE_TOPS = f"""
() => {{
  const rows = new Set();
  for (const canvas of document.querySelectorAll(".plot-strip")) {{
    const {{ width, height, data }} = ({PIXELS_OF})(canvas);
    for (let place = 0; place < width * height; place += 1) {{
      if (data[4 * place + 3] === 255) rows.add(Math.floor(place / width));
    }}
  }}
  return rows.size ? Math.max(...rows) - Math.min(...rows) : null;
}}
"""
"""How many rows of pixels apart the highest and the lowest piece of the line are."""


def plot(*signals: str, **options: Any) -> WidgetUse:
    """Return a plot of signals."""
    return WidgetUse("plot", "plot", {}, {}, options)._replace(lists={"series": signals})


def value(signal: str, **options: Any) -> WidgetUse:
    """Return a value of a signal."""
    return WidgetUse(signal, "value", {"value": signal}, {}, options)


@asynccontextmanager
async def shown(
    new_page: PageMaker, *uses: WidgetUse, signals: Mapping[str, Signal] = SIGNALS
) -> AsyncIterator[tuple[FakeRobot, Page]]:
    """Show widgets on one page."""
    robot = FakeRobot(dashboard_profile(signals=signals, uses=uses))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        yield robot, page


async def choose(page: Page, system: str) -> None:
    """Choose the units in which people read."""
    js = """(system) => {
      const choice = document.querySelector("[data-units-choice]");
      choice.value = system;
      choice.dispatchEvent(new Event("change"));
    }"""
    await page.evaluate(js, system)


async def said(page: Page, selector: str) -> list[float]:
    """Return the numbers that elements say."""
    return [float(text) for text in await page.locator(selector).all_text_contents() if text]


async def saved(page: Page, file: Path) -> list[list[str]]:
    """Save what a paused plot shows; return its rows."""
    async with page.expect_download() as download:
        await page.click(".plot-save")
    await (await download.value).save_as(file)
    return list(csv.reader(file.read_text("utf-8").splitlines()))


async def test_figures_keep_what_means_something_in_every_unit(new_page: PageMaker) -> None:
    """A whole number is not rounded, a small length not nothing, and there is no noise."""
    gauge = WidgetUse("gauge", "gauge", {"value": "ticks"})
    uses = (value("gap"), value("pace", precision=0), gauge)
    async with shown(new_page, *uses) as (robot, page):
        robot.set_reading("gap", 12.0)
        robot.set_reading("pace", 9.0)
        robot.set_reading("ticks", 12345)
        await until_text(page, ".gauge-text", "12345")
        await choose(page, "imperial")
        await until_text(page, "[data-cell='0'] .value-figure", "0.47 in")
        await until_text(page, "[data-cell='1'] .value-figure", "20 mph")


async def test_an_alarm_is_read_out_in_the_unit_that_is_shown(new_page: PageMaker) -> None:
    """A screen reader hears the number with its own unit."""
    async with shown(new_page, value("dash")) as (robot, page):
        robot.set_reading("dash", 3.0)
        await choose(page, "imperial")
        await until_text(page, ".value-text", "6.711")
        robot.set_reading("dash", 9.0, alarm="hihi")
        await until_text(page, "[data-alarms]", "dash: Very high, 20.13 mph")


async def test_the_history_of_a_value_is_the_same_line_in_other_units(new_page: PageMaker) -> None:
    """Its ends change with the unit, and nothing jumps."""
    async with shown(new_page, value("pace", history="60s")) as (robot, page):
        robot.set_reading("pace", 10.0)
        await until_text(page, ".value-most", "11")
        await choose(page, "imperial")
        await until_text(page, ".value-most", "24.61")
        await until_text(page, ".value-least", "20.13")
        robot.set_reading("pace", 11.0)
        await until_text(page, ".value-most", "24.61")
        await until_text(page, ".value-least", "22.37")


async def test_a_plot_is_the_same_line_in_other_units(new_page: PageMaker, tmp_path: Path) -> None:
    """What stands still is level, its scale is in the unit of the legend, the file as declared."""
    async with shown(new_page, plot("pace")) as (robot, page):
        robot.set_reading("pace", 10.0, age_s=1.0)
        await until_text(page, ".plot-value", "10 m/s")
        await choose(page, "imperial")
        await until_text(page, ".plot-value", "22.37 mph")
        robot.set_reading("pace", 10.0)
        await page.wait_for_function(f"() => ({LINE_TOPS})() !== null")
        assert await page.evaluate(LINE_TOPS) < 6
        figures = await said(page, ".plot-figure")
        assert 19 < min(figures) < 22.37 < max(figures) < 25

        await page.click(".plot-pause")
        await page.wait_for_selector(".plot-history .u-over")
        await page.focus(".plot-history")
        await page.keyboard.press("ArrowRight")
        await until_text(page, ".plot-value", "22.37 mph")
        await choose(page, "nautical")
        await until_text(page, ".plot-value", "19.44 kn")
        rows = await saved(page, tmp_path / "plot.csv")
        assert rows[0] == ["time", "pace (m/s)"]
        assert [row[1] for row in rows[1:]] == ["10", "10"]
