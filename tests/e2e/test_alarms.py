"""Alarms on a real page: a flood stays quiet and loses none, and actions hold on every screen."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from tests.e2e.motion.driving import CALM_LEASE_S, USES, commands
from urc.model.driver import Command
from urc.model.exchange import Confirm
from urc.model.interface import WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import AlarmAttributes, AlarmLimits, Signal
from urc.runtime.alarm_table import AlarmQuery, search_alarms
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

LOW = AlarmAttributes("high", "It is used.", "Dock now.")
BATTERY = Signal(
    "battery", title="Battery", unit="%", stale_after_s=60,
    limits=AlarmLimits(low=20, attributes=(("low", LOW),)),
)  # fmt: skip
MODE = Signal(
    "mode", "string", title="Mode", stale_after_s=60,
    limits=AlarmLimits(states=("stuck",), attributes=(("stuck", AlarmAttributes("medium")),)),
)  # fmt: skip
COUNT = 200
NARROW = """(cell) => {
  Object.assign(cell.style, { width: "104px", height: "58px", minHeight: "0", alignSelf: "start" });
}"""
LINES = """(el) => {
  const range = new Range();
  range.selectNodeContents(el);
  return new Set([...range.getClientRects()].map(({ top }) => Math.round(top))).size;
}"""
IS_WHOLE = "(el) => el.scrollWidth <= el.clientWidth && el.scrollHeight <= el.clientHeight"
WATCH = """() => {
  window.seen = { tones: 0, said: [], longest: 0, flips: 0, shifted: [] };
  const real = OscillatorNode.prototype.start;
  OscillatorNode.prototype.start = function (...args) {
    seen.tones += 1;
    return real.apply(this, args);
  };
  const said = document.querySelector('[data-alarms]');
  new MutationObserver(() => seen.said.push(said.textContent)).observe(said, { childList: true });
  const strip = document.querySelector('[data-alarm-strip]');
  new MutationObserver(() => { seen.flips += 1; }).observe(strip, { attributeFilter: ['hidden'] });
  new PerformanceObserver((list) => {
    for (const { node } of list.getEntries().flatMap(({ sources }) => sources)) {
      const moved = node instanceof Element ? node : node?.parentElement;
      // The badge tells a late link, and is as wide as its words.
      const isExpected = moved?.closest(".alerts, [data-alarm-strip], .urc-badge");
      if (moved && !isExpected) seen.shifted.push(moved.outerHTML);
    }
  }).observe({ type: "layout-shift" });
  let last = performance.now();
  const frame = (now) => {
    seen.longest = Math.max(seen.longest, now - last);
    last = now;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}"""


def robot_of(*signals: Signal) -> FakeRobot:
    """Return a robot with sticks and a list of alarms."""
    profile = dashboard_profile(
        uses=[*USES, WidgetUse("alerts", "alerts")],
        signals={one.name: one for one in signals},
        commands=commands(CALM_LEASE_S),
    )
    return FakeRobot(profile)


async def opened(new_page: PageMaker, robot: FakeRobot, address: str) -> Page:
    page = await new_page(size="desktop")
    await page.goto(f"{address}robots/puppet/")
    await until_text(page, "[data-badge-text]", "Live")  # the bar moves no more
    await until(lambda: robot.is_open)
    await page.locator(".alerts-note", has_text="unknown values").wait_for()
    return page


async def test_a_strip_shows_the_worst_alarm_and_is_gone_with_it(new_page: PageMaker) -> None:
    """With its action, a count in the title, and a list that opens by a tap."""
    robot = robot_of(BATTERY, MODE)
    async with running_dashboard(robot) as address:
        page = await opened(new_page, robot, address)
        strip = page.locator("[data-alarm-strip]")
        title = await page.title()
        assert await strip.is_hidden()
        robot.set_reading("mode", "stuck", alarm="minor")
        await until_text(page, "[data-alarm-strip] .urc-alarm-line", "Mode: stuck")
        robot.set_reading("battery", 15, alarm="low")
        await until_text(page, "[data-alarm-strip] .urc-alarm-line", "Battery: Low, 15 %")
        await until_text(page, "[data-alarm-strip] .urc-alarm-action", "Dock now.")
        await until_text(page, "[data-alarm-strip] .urc-alarm-more", "1 more alarm")
        assert await page.title() == f"▲ 2 · {title}"
        assert await strip.get_attribute("data-priority") == "high"
        assert await strip.get_attribute("data-flash") == "true"
        await page.click("[data-alarm-open]")
        items = page.locator("[data-alarm-list] > li")
        await items.nth(1).wait_for()
        assert "Battery: Low, 15 %" in await items.first.inner_text()
        await page.click("[data-key=order]")
        await page.locator("[data-alarm-list] > li:first-child", has_text="Mode").wait_for()
        await page.click("[data-key=see-battery]")
        await page.locator("[data-alarm=battery][data-state=acknowledged]").wait_for()
        await page.select_option("[data-key=shelve-mode]", "60")
        shelved = page.locator("[data-alarm-hidden] [data-alarm=mode]")
        await shelved.locator("[data-alarm-left]", has_text="min left").wait_for()
        assert await strip.get_attribute("data-flash") is None
        await page.click("[data-key=back-mode]")
        await page.locator("[data-alarm-list] [data-alarm=mode]").wait_for()
        robot.set_reading("mode", "ready")
        robot.set_reading("battery", 80)
        await page.locator("[data-alarm-list] [data-alarm=mode][data-state=returned]").wait_for()
        await page.click("[data-key=see-mode]")
        await strip.wait_for(state="hidden")
        assert await page.title() == title
        await page.click("[data-key=close]")
        assert await page.locator("[data-alarm-sheet]").is_hidden()


async def test_a_small_value_shows_its_name_and_its_alarm_whole(new_page: PageMaker) -> None:
    """In a cell as narrow as on a phone, the name stays one word on one line."""
    use = WidgetUse("level", "battery", {"level": "battery"})
    robot = FakeRobot(dashboard_profile(uses=[use], signals={"battery": BATTERY}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("battery", 15, alarm="low")
        await page.locator("[data-cell='0'] .battery-note", has_text="Low").wait_for()
        await page.locator("[data-cell='0']").evaluate(NARROW)
        assert await page.locator(".battery-title").evaluate(LINES) == 1
        assert await page.locator(".battery-note").evaluate(IS_WHOLE)


async def test_an_acknowledgement_holds_on_every_screen(new_page: PageMaker) -> None:
    """The other screen learns of it without a reload, and who it was."""
    robot = robot_of(BATTERY)
    async with running_dashboard(robot) as address:
        one = await opened(new_page, robot, address)
        other = await opened(new_page, robot, address)
        robot.set_reading("battery", 15, alarm="low")
        for page in (one, other):
            await until_text(page, ".alerts-note", "1 not acknowledged")
        await one.click("[data-alarm-seen]")
        for page in (one, other):
            await until_text(page, ".alerts-note", "0 not acknowledged")
            await page.locator(".alerts-more", has_text="✓ acknowledged by").wait_for()


async def test_the_strip_presses_the_button_of_the_page_that_carries_out_the_action(
    new_page: PageMaker,
) -> None:
    """The button asks as usual; while it may not be pressed, the strip does not offer it."""
    dock = Command(
        "dock", "wire", WriteSpec("text", {}), confirm=Confirm(level="normal", text="It drives.")
    )
    told = LOW._replace(command="dock")
    battery = BATTERY._replace(limits=AlarmLimits(low=20, attributes=(("low", told),)))
    profile = dashboard_profile(
        uses=[*USES, WidgetUse("home", "button", {}, {"press": "dock"}, title="Dock")],
        signals={"battery": battery},
        commands=commands(CALM_LEASE_S) | {"dock": dock},
    )
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("battery", 15, alarm="low")
        help_button = page.locator("[data-alarm-help]")
        await until_text(page, "[data-alarm-help]", "Dock")
        await help_button.click()
        await page.locator(".urc-asking", has_text="It drives.").wait_for()
        assert robot.commands == []
        await help_button.wait_for(state="hidden")  # its button asks already
        await page.get_by_role("button", name="Yes").click()
        await until(lambda: robot.commands == [("dock", {})])
        await help_button.wait_for()
        robot.link("lost")
        await help_button.wait_for(state="hidden")


async def test_the_strip_offers_no_button_that_must_be_held_and_takes_a_held_key_once(
    new_page: PageMaker,
) -> None:
    """A tap on the strip cannot hold a button; a held Enter repeats its clicks."""
    low = AlarmLimits(low=20, attributes=(("low", LOW._replace(command="beep")),))
    dock = AlarmLimits(low=20, attributes=(("low", LOW._replace(command="dock")),))
    profile = dashboard_profile(
        uses=[
            *USES,
            WidgetUse("horn", "button", {}, {"press": "beep"}, title="Beep"),
            WidgetUse("home", "button", {}, {"press": "dock"}, {"gesture": "hold"}, title="Dock"),
        ],
        signals={
            "battery": BATTERY._replace(limits=low),
            "cell": BATTERY._replace(name="cell", title="Cell", limits=dock),
        },
        commands=commands(CALM_LEASE_S)
        | {name: Command(name, "wire", WriteSpec("text", {})) for name in ("beep", "dock")},
    )
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("cell", 15, alarm="low")
        await until_text(page, "[data-alarm-strip] .urc-alarm-line", "Cell: Low, 15 %")
        assert await page.locator("[data-alarm-help]").is_hidden()
        robot.set_reading("cell", 90)
        robot.set_reading("battery", 15, alarm="low")
        await until_text(page, "[data-alarm-help]", "Beep")
        await page.locator("[data-alarm-help]").focus()
        for _ in range(5):
            await page.keyboard.down("Enter")
            await page.wait_for_timeout(60)
        await page.keyboard.up("Enter")
        assert robot.commands == [("beep", {})]


async def test_a_watching_page_shows_alarms_and_offers_no_action(new_page: PageMaker) -> None:
    robot = robot_of(BATTERY)
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/?watch")
        await until(lambda: robot.is_open)
        robot.set_reading("battery", 15, alarm="low")
        await page.locator("[data-alarm-strip]", has_text="Battery").wait_for()
        assert await page.locator("[data-alarm-seen]").is_hidden()
        assert await page.locator(".alerts-seen").is_hidden()


async def test_200_alarms_in_10_s_stay_quiet_and_none_is_lost(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The page groups them, plays one sound, announces few lines, and the history has them all."""
    signals = [
        Signal(f"s{at}", title=f"Signal {at}", limits=AlarmLimits(high=1), stale_after_s=60)
        for at in range(COUNT)
    ]
    robot = robot_of(*signals)
    async with running_dashboard(robot, data=tmp_path) as address:
        page = await opened(new_page, robot, address)
        await page.click("h1")  # browsers allow sound after a touch
        await page.evaluate(WATCH)
        loop = asyncio.get_running_loop()
        began = loop.time()
        for at in range(COUNT):
            robot.set_reading(f"s{at}", 2, alarm="high")
            await asyncio.sleep(max(0.0, began + (at + 1) * 10 / COUNT - loop.time()))
        await until_text(page, ".alerts-note", f"{COUNT} not acknowledged · 150 more alarms")
        seen: dict[str, Any] = await page.evaluate("() => ({ ...seen })")
        assert seen["tones"] <= 3, seen
        assert len(seen["said"]) <= 6, seen
        assert seen["flips"] == 1, "the strip comes once, and stays"
        assert seen["longest"] < 500, seen
        assert seen["shifted"] == [], "sticks and other widgets stay where they are"
        assert await page.title() == f"◆ {COUNT} · Puppet · URC"
        await page.click("[data-alarm-open]")
        bursts = page.locator("[data-alarm-list] > li")
        await page.locator("[data-burst]").first.wait_for()
        assert await bursts.count() <= 12, "a flood is a few lines"
        texts = await page.locator("[data-alarm-list] .urc-alarm-line").all_inner_texts()
        grouped = sum(int(text.split()[0]) if "burst" in text else 1 for text in texts)
        assert grouped == COUNT, "every alarm is in one group"
        await page.click("[data-key=all]")
        await until_text(page, ".alerts-note", "0 not acknowledged · 150 more alarms")
        answer = await page.request.get(f"{address}api/v1/robots/puppet/alarms")
        listed = await answer.json()
        assert listed["flood"]
        assert {one["state"] for one in listed["alarms"]} == {"acknowledged"}
        assert len(listed["alarms"]) == COUNT
    raised = search_alarms(
        tmp_path / "alarms.sqlite", AlarmQuery("puppet", kinds=("raised",), last=1000)
    )
    assert {row.event.signal for row in raised} == {one.name for one in signals}


async def test_the_history_is_searched_on_the_page(new_page: PageMaker, tmp_path: Path) -> None:
    robot = robot_of(BATTERY, MODE)
    async with running_dashboard(robot, data=tmp_path) as address:
        page = await opened(new_page, robot, address)
        robot.set_reading("mode", "stuck", alarm="minor")
        robot.set_reading("battery", 15, alarm="low")
        await page.click("[data-alarm-open]")
        await page.click(".urc-alarm-history > summary")
        events = page.locator("[data-alarm-events] > li")
        await events.nth(1).wait_for()
        await page.fill(".urc-alarm-history input", "Batt")
        await page.locator("[data-alarm-events] > li:only-child", has_text="Battery").wait_for()
