"""People who read other units than the robot's: nothing they see is another number than it was."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

SIGNALS = {
    signal.name: signal
    for signal in (
        Signal("pace", "number", unit="m/s"),
        Signal("rise", "number", unit="m"),
        Signal("gap", "number", unit="mm", precision=0),
        Signal("ticks", "integer", min=0, max=20000),
    )
}


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


async def test_figures_keep_what_means_something_in_every_unit(new_page: PageMaker) -> None:
    """A whole number is not rounded, a small length not nothing, and there is no noise."""
    gauge = WidgetUse("gauge", "gauge", {"value": "ticks"})
    uses = (value("gap"), value("pace", precision=0), gauge)
    async with shown(new_page, *uses) as (robot, page):
        robot.say("gap", 12.0)
        robot.say("pace", 9.0)
        robot.say("ticks", 12345)
        await until_text(page, ".gauge-text", "12345")
        await choose(page, "imperial")
        await until_text(page, "[data-cell='0'] .value-figure", "0.47 in")
        await until_text(page, "[data-cell='1'] .value-figure", "20 mph")


async def test_an_alarm_is_read_out_in_the_unit_that_is_shown(new_page: PageMaker) -> None:
    """A screen reader hears the number with its own unit."""
    async with shown(new_page, value("pace")) as (robot, page):
        robot.say("pace", 3.0)
        await choose(page, "imperial")
        await until_text(page, ".value-text", "6.711")
        robot.say("pace", 9.0, alarm="hihi")
        await until_text(page, "[data-alarms]", "pace very high: 20.13 mph")


async def test_the_history_of_a_value_is_the_same_line_in_other_units(new_page: PageMaker) -> None:
    """Its ends change with the unit, and nothing jumps."""
    async with shown(new_page, value("pace", history="60s")) as (robot, page):
        robot.say("pace", 10.0)
        await until_text(page, ".value-most", "11")
        await choose(page, "imperial")
        await until_text(page, ".value-most", "24.61")
        await until_text(page, ".value-least", "20.13")
        robot.say("pace", 11.0)
        await until_text(page, ".value-most", "24.61")
        await until_text(page, ".value-least", "22.37")
