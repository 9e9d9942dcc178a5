"""Widgets that show what the page knows beside signals, in a real browser: log, alerts, links."""

from pathlib import Path

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from urc.model.interface import WidgetUse
from urc.model.values import AlarmLimits, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio


async def test_what_the_page_knows_is_shown_and_acted_upon(new_page: PageMaker) -> None:
    """Lines by level and words; alerts until somebody has seen them; the controls of the robot."""
    uses = [
        WidgetUse("log", "log", title="Messages"),
        WidgetUse("alerts", "alerts"),
        WidgetUse("link", "link"),
    ]
    limits = AlarmLimits(low=10, lolo=9.5)
    volts = Signal("volts", title="Battery", unit="V", limits=limits, stale_after_s=60)
    robot = FakeRobot(dashboard_profile(uses=uses, signals={"volts": volts}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.log("<b>one</b>")
        robot.log("two")
        lines = page.locator(".log-lines > li")
        await lines.nth(1).wait_for()
        assert "<b>one</b>" in await lines.nth(0).inner_text()
        await page.fill(".log-filter", "TWO wire")
        await until_text(page, ".log-lines > li:only-child > .log-sign", "")
        await page.fill(".log-filter", "")
        await page.click(".log-pause")
        robot.log("three")
        await page.locator(".log-note", has_text="paused; 1 newer").wait_for()
        assert await lines.count() == 2
        await page.click(".log-pause")
        await lines.nth(2).wait_for()
        async with page.expect_download() as saving:
            await page.click(".log-save")
        saved = Path(await (await saving.value).path()).read_text("utf-8").splitlines()
        assert saved[-1].split("\t")[1:] == ["info", "transport wire", "three"]

        robot.set_reading("volts", 9.8, alarm="low")
        await until_text(page, ".alerts-note", "1 not acknowledged")
        await until_text(page, "[data-alarms]", "Battery: Low, 9.8 V")
        await page.click(".alerts-seen")
        await until_text(page, ".alerts-note", "0 not acknowledged")
        robot.set_reading("volts", 9.0, alarm="lolo")  # worse is new
        await until_text(page, ".alerts-note", "1 not acknowledged")
        await page.click(".alerts-later")
        await page.locator(".alerts-note", has_text="1 shelved").wait_for()
        robot.set_reading("volts", 12.0)
        await until_text(page, ".alerts-note", "0 not acknowledged · 1 shelved")

        await page.locator(".link-now", has_text="Live").wait_for()
        await page.locator(".link-facts dd", has_text="tcp 127.0.0.1:6789").wait_for()
        robot.link("lost", "pulled")
        await page.locator(".link-now", has_text="▲ Robot lost").wait_for()
        await page.locator(".link-facts dd", has_text="pulled").wait_for()


async def test_no_alert_is_said_only_of_what_is_known(new_page: PageMaker) -> None:
    """Before a value came, while it is old, and without URC nobody knows whether all is well."""
    volts = Signal("volts", title="Battery", limits=AlarmLimits(low=11), stale_after_s=60)
    uses = [WidgetUse("alerts", "alerts")]
    robot = FakeRobot(dashboard_profile(uses=uses, signals={"volts": volts}))
    page = await new_page(size="desktop")
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await until_text(page, ".alerts-note", "— unknown values: 1 of 1")
        robot.set_reading("volts", 9.0, alarm="low", age_s=90)
        old = page.locator(".alerts-line[data-old='true'] .alerts-words", has_text="old")
        await old.wait_for()
        note = "1 not acknowledged · unknown values: 1 of 1"
        await until_text(page, ".alerts-note", note)
        robot.set_reading("volts", 12.0)
        await until_text(page, ".alerts-note", "1 not acknowledged")
        await page.locator(".alerts-more", has_text="back to normal").wait_for()
        await page.click(".alerts-seen")
        await until_text(page, ".alerts-note", "— ✓ no alert")
    await until_text(page, ".alerts-note", "— no connection to URC")


async def test_what_was_acknowledged_stays_so_when_the_page_is_opened_anew(
    new_page: PageMaker,
) -> None:
    """Before a value came nothing is over; one that is over is new the next time."""
    volts = Signal("volts", title="Battery", limits=AlarmLimits(low=11), stale_after_s=60)
    robot = FakeRobot(
        dashboard_profile(uses=[WidgetUse("alerts", "alerts")], signals={"volts": volts})
    )
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("volts", 9.8, alarm="low")
        await until_text(page, ".alerts-note", "1 not acknowledged")
        await page.click(".alerts-seen")
        await until_text(page, ".alerts-note", "0 not acknowledged")
        await page.goto("about:blank")
        await until(lambda: not robot.is_open)
        await page.goto(f"{address}robots/puppet/")
        note = "0 not acknowledged · unknown values: 1 of 1"
        await until_text(page, ".alerts-note", note)
        robot.set_reading("volts", 9.7, alarm="low")
        await until_text(page, ".alerts-note", "0 not acknowledged")
        robot.set_reading("volts", 12.0)
        await until_text(page, ".alerts-note", "— ✓ no alert")
        robot.set_reading("volts", 9.7, alarm="low")
        await until_text(page, ".alerts-note", "1 not acknowledged")
