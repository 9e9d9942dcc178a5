"""What a robot says, on the widgets that show it: needles, bars, tapes, traces and pictures."""

import csv
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.e2e.browser import Size
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.drawn import PIXELS_OF
from tests.e2e.ports import free_port
from urc.model.driver import Argument, Command
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import AlarmLimits, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.show.demos import colour_bars as made_picture

pytestmark = pytest.mark.anyio

SIGNALS = {
    signal.name: signal
    for signal in (
        Signal("amps", unit="A", min=0, max=30, precision=1, limits=AlarmLimits(high=20, hihi=25)),
        Signal("goal", unit="A"),
        Signal("pace", unit="m/s", min=-2, max=2),
        Signal("height", unit="m"),
        Signal("yaw", unit="rad"),
        Signal("way", unit="rad"),
        Signal("roll", unit="deg", stale_after_s=60),
        Signal("pitch", unit="deg", stale_after_s=60),
        Signal("turned", "array", items="number", size=4),
        Signal("rssi", "integer", unit="dBm"),
        Signal("cells", "array", items="number", unit="V", precision=2),
        Signal("volts", unit="V", precision=1, limits=AlarmLimits(low=11)),
        Signal("mode", "string"),
        Signal("report", "object"),
        Signal("seen", "image"),
    )
}
WHOLE_ROWS = """() => {
  const scroll = document.querySelector(".table-scroll").getBoundingClientRect();
  const rows = [...document.querySelectorAll(".table-body tr")]
    .map((row) => row.getBoundingClientRect()).filter(({ top }) => top < scroll.bottom - 1);
  return {
    whole: rows.length,
    cut: rows.filter(({ bottom }) => bottom > scroll.bottom + 1).map(({ bottom }) => bottom),
  };
}"""
NO_EASING = """
(selectors) => selectors.map((selector) => {
  const { transitionDuration, animationName } = getComputedStyle(document.querySelector(selector));
  return `${transitionDuration} ${animationName}`;
})
"""


def use(widget: str, inputs: dict[str, str], slot: str = "", **options: Any) -> WidgetUse:
    """Return a widget with inputs and options."""
    return WidgetUse(slot or widget, widget, inputs, {}, options)


@asynccontextmanager
async def shown(
    new_page: PageMaker,
    *uses: WidgetUse,
    columns: int = 4,
    size: Size = "desktop",
    **commands: Command,
) -> AsyncIterator[tuple[FakeRobot, Page]]:
    """Show widgets on one page, in a grid."""
    profile = dashboard_profile(signals=SIGNALS, uses=uses, commands=commands)
    slots = tuple(
        Slot(each.slot, place // columns, place % columns) for place, each in enumerate(uses)
    )
    grid = Layout(-(-len(uses) // columns), columns, slots)
    robot = FakeRobot(
        profile._replace(interfaces={"default": Interface("default", "", {"landscape": grid})})
    )
    async with running_dashboard(robot) as address:
        page = await new_page(size=size)
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        yield robot, page


async def transform(page: Page, selector: str) -> str:
    """Return what moves an element."""
    found: str = await page.eval_on_selector(selector, "(el) => el.style.transform")
    return found


async def corners(page: Page, selector: str) -> list[list[float]]:
    """Return the first two points of a polygon as x and y, to a tenth."""
    rounded = "[x, y].map((at) => Math.round(at * 10) / 10)"
    js = f"(el) => [...el.points].slice(0, 2).map(({{ x, y }}) => {rounded})"
    found: list[list[float]] = await page.eval_on_selector(selector, js)
    return found


SIZE_AND_FIT = """(el) => {
  const [box, cell] = [el, el.closest("[data-cell]")].map((one) => one.getBoundingClientRect());
  const [own, facts] = [el, document.querySelector(".battery-facts")]
    .map((one) => parseFloat(getComputedStyle(one).fontSize));
  return [own / facts, box.right <= cell.right && box.left >= cell.left];
}"""


@pytest.mark.parametrize("size", ["phone", "desktop"])
async def test_a_battery_with_only_a_voltage_shows_it_large(
    new_page: PageMaker, size: Size
) -> None:
    """Not as an empty battery with the voltage below."""
    uses = (
        use("battery", {"voltage": "volts", "current": "amps"}),
        use("gauge", {"value": "volts"}),
    )
    async with shown(new_page, *uses, columns=2, size=size) as (robot, page):
        await expect(page.locator(".battery-digits")).to_have_text("—")
        robot.set_reading("volts", 12.34)
        robot.set_reading("amps", 1.5)
        await until_text(page, ".battery-digits", "12.3")
        await until_text(page, ".battery-unit", "V")
        await expect(page.locator(".battery-facts")).to_have_text("1.5 A")
        await expect(
            page.locator(".battery svg, .battery-level, .battery [role=meter]")
        ).to_have_count(0)
        ratio, is_inside = await page.eval_on_selector(".battery-number", SIZE_AND_FIT)
        assert ratio > 1.4
        assert is_inside
        robot.set_reading("volts", 10.5, alarm="low")
        await until_text(page, ".battery-note", "◆ Low")


TEXT_LINES = """(el) => {
  const range = document.createRange();
  range.selectNodeContents(el);
  return new Set([...range.getClientRects()].map(({ top }) => Math.round(top))).size;
}"""


async def test_the_buttons_of_an_alert_do_not_break_within_a_word(new_page: PageMaker) -> None:
    """In a narrow cell, they are below one another."""
    others = (use("gauge", {"value": "amps"}, f"gauge{place}") for place in range(4))
    async with shown(new_page, use("alerts", {}), *others, columns=5) as (robot, page):
        robot.set_reading("amps", 26.0, alarm="hihi")
        await expect(page.locator(".alerts-seen")).to_be_visible()
        cell = await page.locator("[data-cell]").first.bounding_box()
        assert cell is not None
        assert 200 < cell["width"] < 330
        for name in ("seen", "later"):
            assert await page.eval_on_selector(f".alerts-{name}", TEXT_LINES) == 1


async def test_needles_bars_and_tapes_stand_where_the_value_is(new_page: PageMaker) -> None:
    """Each at once and without easing, in the frame that writes the number."""
    uses = (
        use("gauge", {"value": "amps", "target": "goal"}, extremes=True),
        use("bar", {"value": "pace"}, origin=0),
        use("speed", {"measured": "pace"}, unit="km/h"),
        use("altitude", {"altitude": "height"}, reference="home"),
        use("compass", {"heading": "yaw", "target": "way"}, convention="yaw"),
        use("attitude", {"orientation": "turned"}, axes="FLU", roll_limit=30),
        use("state", {"value": "mode"}, meanings={"leak": "alarm"}),
        use("battery", {"cells": "cells"}, imbalance=0.2),
    )
    async with shown(new_page, *uses) as (robot, page):
        robot.set_reading("amps", 20.0)
        await until_text(page, ".gauge-text", "20.0")
        robot.set_reading("amps", 15.0)
        robot.set_reading("goal", 30)
        robot.set_reading("pace", -1.0)
        robot.set_reading("height", 31.25)
        robot.set_reading("yaw", 0.0)  # east
        robot.set_reading("way", 1.5707963)  # north
        robot.set_reading("turned", (0.17364818, 0.0, 0.0, 0.98480775))  # 20 degrees about x
        robot.set_reading("mode", "leak")
        robot.set_reading("cells", (3.9, 3.5, None))
        await until_text(page, ".gauge-text", "15.0")
        assert await corners(page, ".gauge-needle polygon") == [[-4, 0], [-1.5, -74]]
        await until_attribute(page, ".gauge-target", "visibility", "visible")
        assert await transform(page, ".gauge-target") == "rotate(135deg)"
        marks = await page.locator(".gauge-extremes path").evaluate_all(
            "(all) => all.map((el) => el.style.transform)"
        )
        assert marks == ["rotate(0deg)", "rotate(45deg)"]

        await until_text(page, ".bar-text", "-1")
        fill = "(el) => ['--bar-from', '--bar-long'].map((name) => el.style.getPropertyValue(name))"
        assert await page.eval_on_selector(".bar-fill", fill) == ["0.2500", "0.2500"]
        await until_text(page, ".speed-text", "-3.6")
        await until_text(page, ".altitude-text", "31.3")  # half up, as JavaScript rounds 31.25
        assert await transform(page, ".altitude-tape") == "translateY(-87.5px)"
        await until_text(page, ".altitude-reference", "above home")

        await until_text(page, ".compass-note", "target 90° left")
        await until_text(page, ".compass-text", "090")
        assert await corners(page, ".compass-needle polygon") == [[52, 0], [-36, 24]]
        await until_text(page, ".attitude-words", "right side down 20°")
        assert await transform(page, ".attitude-sphere") == "rotate(-20deg)"
        assert await transform(page, ".attitude-world") == "translateY(0px)"
        await until_text(page, ".state-shape", "▲")
        await until_text(page, ".battery-note", "◆ Cells differ by 0.40 V")
        figures = await page.locator(".battery-figure").all_text_contents()
        assert figures == ["3.90", "3.50", "—"]

        moved = (".gauge-needle", ".bar-fill", ".altitude-tape", ".compass-needle")
        assert await page.evaluate(NO_EASING, list(moved)) == ["0s none"] * len(moved)

        robot.set_reading("turned", (0.5, 0.0, 0.0, 0.8660254))  # 60 degrees
        await until_text(page, ".attitude-note", "▲ Leans too far")
        robot.set_reading("turned", (0.0, 0.0, 0.0, 0.0))  # no orientation at all
        await until_text(page, ".attitude-words", "—")
        await until_attribute(page, ".attitude", "data-missing", "bank nose")


async def test_the_height_next_to_a_horizon_moves_its_tape(new_page: PageMaker) -> None:
    """In the displayed unit; an unknown height draws no tape."""
    angles = {"roll": "roll", "pitch": "pitch", "height": "height"}
    async with shown(new_page, use("attitude", angles, height_span=40)) as (robot, page):
        for name, value in (("roll", 0.0), ("pitch", 0.0), ("height", 31.25)):
            robot.set_reading(name, value)
        await until_text(page, ".attitude-height-text", "31.25")
        await until_text(page, ".attitude-height-unit", "m")
        assert await transform(page, ".attitude-heights") == "translateY(-43.75px)"
        await until_text(page, ".attitude-words", "level")
        robot.set_reading("height", None)
        await until_text(page, ".attitude-height-text", "—")
        assert not await page.is_visible(".attitude-heights")
        await until_text(page, ".attitude-words", "level")


async def test_an_attitude_without_one_of_its_angles_is_not_level(new_page: PageMaker) -> None:
    """What is bound and not known is named, and whatever would be drawn of it is hidden."""
    angles = {"roll": "roll", "pitch": "pitch"}
    uses = (
        use("attitude", angles, "horizon", view="horizon"),
        use("attitude", angles, "vehicle", view="vehicle"),
        use("attitude", angles, "outline", view="outline", roll_limit=30),
        use("attitude", {"roll": "roll"}, "alone", view="horizon"),
    )
    async with shown(new_page, *uses) as (robot, page):
        robot.set_reading("roll", 0.2)
        robot.set_reading("pitch", 20.0)
        await until_text(page, "[data-cell='0'] .attitude-words", "nose down 20°")
        robot.set_reading("pitch", 20.0, age_s=700)
        for cell, hidden, seen in (
            (0, "world", "symbol"),
            (1, "world", "symbol"),
            (2, "side", "rear"),
        ):
            note = page.locator(f"[data-cell='{cell}'] .attitude-note")
            await note.filter(has_text="pitch: seen").wait_for()
            await until_text(page, f"[data-cell='{cell}'] .attitude-words", "—")
            assert not await page.is_visible(f"[data-cell='{cell}'] .attitude-{hidden}")
            assert await page.is_visible(f"[data-cell='{cell}'] .attitude-{seen}")
        await until_text(page, "[data-cell='3'] .attitude-words", "level")
        assert await page.is_visible("[data-cell='3'] .attitude-world")
        # What is known is told, and in colour.
        robot.set_reading("roll", 40.0)
        await until_text(page, "[data-cell='2'] .attitude-words", "right side down 40°")
        await until_attribute(page, "[data-cell='2'] .attitude", "data-state", "live")
        await until_attribute(page, "[data-cell='2'] .attitude", "data-alarm", "hihi")


async def test_a_table_puts_the_gravest_first_and_filters(new_page: PageMaker) -> None:
    """Diagnostics of the robot and signals of any kind stand in one list."""
    uses = (WidgetUse("table", "table", {"report": "report"}, lists={"values": ("amps", "mode")}),)
    async with shown(new_page, *uses) as (robot, page):
        robot.set_reading("amps", 22.0, alarm="high")
        robot.set_reading("mode", "docked")
        robot.set_reading("report", {"lid": {"level": 2, "message": "open"}, "radio": "ok"})
        await until_text(page, ".table-count", "2 not OK")
        names = "(rows) => rows.map((row) => row.children[1].textContent)"
        rows = page.locator(".table-body tr")
        assert await rows.evaluate_all(names) == ["lid", "amps", "radio", "mode"]
        await page.fill(".table-filter", "WARN")
        await page.wait_for_function(
            "() => document.querySelectorAll('.table-body tr').length === 1"
        )
        assert await rows.evaluate_all(names) == ["amps"]
        await page.fill(".table-filter", "nothing has this")
        await until_text(page, ".table-body td:nth-child(2)", "no row matches the filter")


async def test_a_table_shows_whole_rows_and_how_many_follow(new_page: PageMaker) -> None:
    """The last visible row is never cut, at the start and at the end of the list."""
    uses = (WidgetUse("table", "table", {"report": "report"}),)
    async with shown(new_page, *uses) as (robot, page):
        robot.set_reading("report", {f"part {number}": "ok" for number in range(40)})
        for height in (420, 433, 446, 900):
            await page.set_viewport_size({"width": 1000, "height": height})
            await page.wait_for_function(
                f"() => document.querySelector('.table-more').textContent"
                f" === `▾ ${{40 - ({WHOLE_ROWS})().whole}} more rows`"
            )
            assert (await page.evaluate(WHOLE_ROWS))["cut"] == []
        await page.eval_on_selector(".table-scroll", "(el) => el.scrollTo(0, el.scrollHeight)")
        await until_text(page, ".table-more", "")
        robot.set_reading("report", {"part 1": "ok"})
        await page.locator(".table-more").wait_for(state="hidden")


async def test_diagnostics_of_several_programs_are_one_tree(new_page: PageMaker) -> None:
    """A report in the same frame as another one is not lost; branches open by mouse and by keys."""
    use = WidgetUse("table", "table", {"report": "report"}, options={"view": "tree"})
    async with shown(new_page, use) as (robot, page):
        # A page that comes later receives only the newest report.
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        wrist = {"level": 2, "name": "/arm/wrist", "message": "hot"}
        robot.set_reading("report", {"status": [wrist, {"level": 0, "name": "/arm/elbow"}]})
        values = [{"key": "rate", "value": "10 Hz"}]
        robot.set_reading("report", {"status": [{"level": 0, "name": "lidar", "values": values}]})
        await until_text(page, ".table-count", "1 not OK")
        names = "(rows) => rows.map((row) => row.children[1].textContent)"
        rows = page.locator(".table-body tr")
        await expect(rows).to_have_count(4)
        assert await rows.evaluate_all(names) == ["▾ arm", "wrist", "elbow", "▸ lidar"]
        await page.click("text=▾ arm")
        await expect(rows).to_have_count(2)
        assert await rows.evaluate_all(names) == ["▸ arm", "▸ lidar"]
        assert await rows.nth(0).get_attribute("data-level") == "error"
        await page.focus("text=▸ lidar")
        await page.keyboard.press("Enter")
        await expect(rows).to_have_count(3)
        assert await rows.evaluate_all(names) == ["▸ arm", "▾ lidar", "rate"]
        assert await rows.nth(2).locator("td").nth(2).text_content() == "10 Hz"
        # The next report leaves what the operator has opened and closed.
        robot.set_reading("report", {"status": [{**wrist, "message": "very hot"}]})
        await page.click("text=▸ arm")
        await until_text(page, ".table-body tr:nth-child(2) td:nth-child(3)", "very hot")
        await expect(rows).to_have_count(5)


async def test_a_heading_is_chosen_and_then_sent(new_page: PageMaker) -> None:
    """A tap on the rose chooses, the keys turn it, and only the button sends it."""
    compass = WidgetUse("compass", "compass", {"heading": "yaw"}, {"set_heading": "turn_to"})
    compass = compass._replace(options={"convention": "bearing"})
    command = Command("turn_to", "wire", WriteSpec("text"), {"value": Argument("value")})
    async with shown(new_page, compass, columns=1, turn_to=command) as (robot, page):
        robot.on_command = lambda name, arguments: {}
        robot.set_reading("yaw", 0.0)
        await until_text(page, ".compass-text", "000")
        assert await page.is_disabled(".compass-set")
        box = await page.locator(".compass-body").bounding_box()
        assert box is not None
        middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        await page.mouse.click(middle[0] + box["height"] / 3, middle[1])
        await until_text(page, ".compass-set", "Set 090°")
        await page.keyboard.press("ArrowRight")
        await until_text(page, ".compass-set", "Set 091°")
        assert robot.commands == []
        await page.click(".compass-set")
        await until(lambda: bool(robot.commands))
        (name, arguments), *more = robot.commands
        assert (name, more) == ("turn_to", [])
        assert arguments["value"] == pytest.approx(1.5882496)  # 91 degrees in the robot's rad
        await until_text(page, ".compass-set", "Set heading")


LINES = 10
LAST_VALUE_IS = """
(text) => document.querySelector("li:last-child .plot-value")?.textContent === text
"""
COLOURS = f"""
() => {{
  const found = new Set();
  for (const canvas of document.querySelectorAll(".plot-strip")) {{
    const {{ data }} = ({PIXELS_OF})(canvas);
    for (let place = 0; place < data.length; place += 4) {{
      if (data[place + 3] === 255) found.add(data.slice(place, place + 3).join());
    }}
  }}
  return found.size;
}}
"""


async def test_a_plot_draws_each_signal_and_can_be_looked_at(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Lines as they come; paused, a cursor reads them; what is seen is saved."""
    names = [f"m{place}" for place in range(LINES)]
    signals = {name: Signal(name, unit="A", precision=1, stale_after_s=60) for name in names}
    plot = WidgetUse("plot", "plot", {}, {}, {"window": "10s"}, "Currents")
    plot = plot._replace(lists={"series": tuple(names)})
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[plot]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for step in range(6):
            for place, name in enumerate(names):
                robot.set_reading(name, place + step % 2 / 2, age_s=(6 - step) / 5)
            value = f"{9 + step % 2 / 2:.1f} A"
            await page.wait_for_function(
                LAST_VALUE_IS,
                arg=value,
            )
        # Six colours, and the rest of the ten lines in the same with dashes.
        await page.wait_for_function(f"() => ({COLOURS})() >= 6")
        await page.click(".plot-entry >> nth=0")
        await until_attribute(page, ".plot-entry", "aria-pressed", "false")
        await page.click(".plot-entry >> nth=0")

        await page.click(".plot-pause")
        await page.wait_for_selector(".plot-history .u-over")
        await until_attribute(page, ".plot-pause", "aria-pressed", "true")
        await page.focus(".plot-history")
        for _ in range(3):
            await page.keyboard.press("ArrowRight")
        await page.wait_for_function(
            "() => /\\d:\\d\\d/.test(document.querySelector('.plot-note').textContent)"
        )
        async with page.expect_download() as download:
            await page.click(".plot-save")
        file = tmp_path / "plot.csv"
        await (await download.value).save_as(file)
        rows = list(csv.reader(file.read_text("utf-8").splitlines()))
        assert rows[0] == ["time", *(f"{name} (A)" for name in names)]
        assert sorted(float(row[10]) for row in rows[1:] if row[10]) == [9.0] * 3 + [9.5] * 3

        await page.click(".plot-pause")
        await page.wait_for_selector(".plot-picture", state="visible")
        assert await page.locator(".plot-history .u-over").count() == 0
        robot.set_reading("m0", 40.0)  # far above the scale, which grows at once
        await page.wait_for_function(
            "() => Number([...document.querySelectorAll('.plot-figure')].at(-1).textContent) >= 40"
        )


async def test_a_line_that_was_hidden_stays_hidden_after_a_cut(new_page: PageMaker) -> None:
    """What somebody chose is not undone by a new connection."""
    use = WidgetUse("plot", "plot", {}, {}, {})._replace(lists={"series": ("amps", "goal")})
    robot = FakeRobot(dashboard_profile(signals=SIGNALS, uses=[use]))
    page = await new_page()
    new_page.allow(page, lambda fault: "WebSocket connection to" in fault)
    port = free_port()
    async with running_dashboard(robot, port=port) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("goal", 3)
        await page.wait_for_function(LAST_VALUE_IS, arg="3 A")
        await page.click(".plot-entry >> nth=0")
        await until_attribute(page, ".plot-entry", "aria-pressed", "false")
    async with running_dashboard(robot, port=port):
        await until(lambda: robot.is_open)
        robot.set_reading("goal", 4)
        await page.wait_for_function(LAST_VALUE_IS, arg="4 A")
        pressed = "(all) => all.map((el) => el.ariaPressed)"
        assert await page.eval_on_selector_all(".plot-entry", pressed) == ["false", "true"]


async def test_a_paused_plot_in_a_narrow_cell_shows_all_its_buttons(new_page: PageMaker) -> None:
    """They go on in the next line, and none is cut off."""
    bound = use("plot", {})._replace(lists={"series": ("amps",)})
    async with shown(new_page, bound) as (_, page):
        await page.eval_on_selector("[data-cell]", "(el) => { el.style.width = '280px'; }")
        await page.click(".plot-pause")
        await until_text(page, ".plot-pause", "Resume")
        beyond = """(all) => all.filter((el) =>
          el.getBoundingClientRect().right > el.closest("[data-cell]").getBoundingClientRect().right
        ).length"""
        assert await page.locator(".plot-tools button:visible").count() == 4
        assert await page.eval_on_selector_all(".plot-tools button", beyond) == 0


async def test_the_newest_picture_is_shown(new_page: PageMaker) -> None:
    """In its own size, fitted by the style sheet; a picture of the options stands there before."""
    source = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/%3E"
    async with shown(new_page, use("image", {"picture": "seen"}, source=source)) as (robot, page):
        await page.wait_for_selector(".image-place img")
        robot.set_reading("seen", made_picture(40, 30))
        await page.wait_for_selector(".image-place canvas")
        await page.wait_for_function(
            "() => document.querySelector('.image-place canvas').width === 40"
        )
        assert await page.locator(".image-place img").count() == 0
        assert await page.get_attribute(".image-place canvas", "role") == "img"


async def test_a_note_is_rendered_without_markup_of_its_own(new_page: PageMaker) -> None:
    """Markdown is; HTML in it is text, links lead elsewhere, and there are no pictures."""
    text = "# Go\n\n**now** <b>x</b> ![p](/x.png) [a](https://example.org) [b](javascript:alert(1))"
    async with shown(new_page, use("markdown", {}, text=text)) as (_, page):
        note = page.locator(".markdown-text")
        assert await note.locator("h4").inner_text() == "Go"
        assert await note.locator("strong").inner_text() == "now"
        assert await note.locator("b, img, script").count() == 0
        links = note.locator("a")
        assert await links.count() == 2  # the picture's address is one, too
        assert await links.last.get_attribute("rel") == "noopener noreferrer"
        assert await links.last.get_attribute("href") == "https://example.org"


async def test_a_recording_is_saved_as_a_table(new_page: PageMaker, tmp_path: Path) -> None:
    """From one press to the next, each value once; what was there before is not in it."""
    bound = use("recorder", {})._replace(lists={"values": ("amps", "mode")})
    async with shown(new_page, bound) as (robot, page):
        robot.set_reading("amps", 1.0)
        await until_attribute(page, ".recorder", "data-state", "live")
        assert await page.is_disabled(".recorder-save")
        await page.click(".recorder-main")
        for count, (name, value) in enumerate((("amps", 2.5), ("mode", "=go,1"), ("amps", 3.5)), 1):
            robot.set_reading(name, value)
            await until_text(page, ".recorder-note", f"● recording: {count} rows")
        await page.click(".recorder-main")
        robot.set_reading("amps", 4.5)
        async with page.expect_download() as download:
            await page.click(".recorder-save")
        file = tmp_path / "recording.csv"
        await (await download.value).save_as(file)
        rows = list(csv.reader(file.read_text("utf-8").splitlines()))
        assert rows[0] == ["time", "signal", "value"]
        assert [row[1:] for row in rows[1:]] == [
            ["amps", "2.5"],
            ["mode", "'=go,1"],
            ["amps", "3.5"],
        ]
