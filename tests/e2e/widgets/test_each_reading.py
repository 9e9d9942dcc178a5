"""Widgets that hear each reading, in a real browser: out of sight, at once, and after a cut."""

from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from urc.model.interface import WidgetUse
from urc.model.values import Sample, Signal
from urc.testing.dashboard import BATTERY, FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

KEPT_LINES = """
window.lines = [];
window.WebSocket = class extends WebSocket {
  constructor(...given) { super(...given); window.lines.push(this); }
};
"""
NOTE = ".recorder-note"


def robot_of(*uses: WidgetUse) -> FakeRobot:
    """Return a robot with a number, a line of text and a battery."""
    signals = {
        "speed": Signal("speed", "number", stale_after_s=60),
        "said": Signal("said", "string", stale_after_s=60),
        "battery": BATTERY,
    }
    return FakeRobot(dashboard_profile(signals=signals, uses=uses))


async def cut_off(page: Page, robot: FakeRobot, signal: str, *values: float | str) -> None:
    """Cut the page off, let the robot say something meanwhile, and wait until it is back."""
    await page.context.set_offline(True)
    await page.evaluate("lines.forEach((line) => line.close())")
    await expect(page.locator("[data-badge-text]")).to_have_text("No connection to URC")
    for value in values:
        robot.set_reading(signal, value)
    await page.context.set_offline(False)
    await expect(page.locator("[data-badge-text]")).to_have_text("Live")


async def test_a_recording_goes_on_out_of_sight_and_after_a_cut(new_page: PageMaker) -> None:
    """Each reading is one row, none is from before; what was lost meanwhile is counted."""
    batteries = (WidgetUse(f"gap{n}", "battery", {"level": "battery"}) for n in range(12))
    recorder = WidgetUse("rec", "recorder", lists={"values": ("speed",)})
    robot = robot_of(recorder, *batteries)
    async with running_dashboard(robot) as address:
        page, other = await new_page(size="phone"), await new_page(size="phone")
        new_page.allow(page, lambda text: "ERR_INTERNET_DISCONNECTED" in text)
        await page.add_init_script(KEPT_LINES)
        await page.goto(f"{address}robots/puppet/")
        await other.goto(f"{address}robots/puppet/")  # so that the robot stays connected
        await until(lambda: robot.is_open)
        robot.set_reading("speed", 1)
        await until_text(page, NOTE, "nothing recorded")
        await page.get_by_role("button", name="Record", exact=True).click()
        await until_text(page, NOTE, "● recording: 0 rows")
        await page.locator("[data-cell='12']").scroll_into_view_if_needed()
        await expect(page.locator(".recorder")).not_to_be_in_viewport()
        for value in range(2, 12):
            robot.set_reading("speed", value)
            robot.set_reading("battery", value)
            await until_text(page, "[data-cell='12'] .battery-digits", str(value))
        await until_text(page, NOTE, "● recording: 10 rows")
        await cut_off(page, robot, "speed")
        robot.hub.publish([Sample("speed", value, robot.clock.now()) for value in (12, 13, 14)])
        await until_text(page, NOTE, "● recording: 13 rows")
        await cut_off(page, robot, "speed", 15, 16, 17)
        await until_text(page, NOTE, "● recording: 14 rows · ▲ 2 lost")
        async with page.expect_download() as saving:
            await page.locator(".recorder-save").click()
        saved = Path(await (await saving.value).path()).read_text("utf-8").splitlines()
        values = [int(line.split(",")[2]) for line in saved[1:]]
        assert values == [*range(2, 15), 17]


async def test_a_terminal_shows_each_line_once(new_page: PageMaker) -> None:
    """Many at once, none again after a cut; what was said meanwhile is shown or counted."""
    robot = robot_of(WidgetUse("console", "terminal", {"line": "said"}))
    async with running_dashboard(robot) as address:
        page, other = await new_page(), await new_page()
        new_page.allow(page, lambda text: "ERR_INTERNET_DISCONNECTED" in text)
        await page.add_init_script(KEPT_LINES)
        await page.goto(f"{address}robots/puppet/")
        await other.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        lines = page.locator(".terminal-list > li")
        robot.set_reading("said", "hello")
        await expect(lines).to_have_text(["< hello"])
        burst = [f"burst {number}" for number in range(20)]
        robot.hub.publish([Sample("said", text, robot.clock.now()) for text in burst])
        shown = ["< hello", *(f"< {text}" for text in burst)]
        await expect(lines).to_have_text(shown)
        await cut_off(page, robot, "said")
        robot.set_reading("said", "burst 19")
        shown += ["< burst 19"]
        await expect(lines).to_have_text(shown)
        await cut_off(page, robot, "said", "one", "two", "three")
        shown += ["… lines omitted: 2", "< three"]
        await expect(lines).to_have_text(shown)
