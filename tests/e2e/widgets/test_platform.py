"""What the page does for every widget: images, lists, units, and what a slow one may cost."""

from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.test_dashboard_widgets import made_widget
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.model.widget import Widget, WidgetPort
from urc.testing.dashboard import BATTERY, FakeRobot, dashboard_profile, plain_widget
from urc.web.show.demos import colour_bars

pytestmark = pytest.mark.anyio

EYE = """
import { shown } from "./shown.js";
export default {
  mount({ el, picture, follow }) {
    picture("eye", (bitmap, reading) => {
      el.dataset.size = shown(bitmap.width, bitmap.height);
      el.dataset.type = reading.image.type;
      el.dataset.count = String(Number(el.dataset.count ?? 0) + 1);
    });
    follow("links", ({ isUp, links }) => { el.dataset.links = `${isUp} ${links[0]?.state}`; });
  },
};
"""
LINES = """
import { many } from "urc/kit";
export default {
  mount: ({ el, unit, t }) => ({
    update({ series, turned }) {
      el.dataset.series = many(series).map(({ text }) => text).join(" ");
      const whole = turned.value?.map((each) => (each === null ? null : Math.round(each)));
      el.dataset.turned = JSON.stringify(whole);
      const lines = t("{n} lines", { n: many(series).length });
      el.dataset.unit = `${turned.signal.unit} ${unit("turned").symbol} ${lines}`;
    },
  }),
};
"""
SLOW = """
export default {
  mount: ({ el }) => ({
    update() {
      const end = performance.now() + 60;
      while (performance.now() < end);
      el.dataset.calls = String(Number(el.dataset.calls ?? 0) + 1);
    },
  }),
};
"""
ENDLESS_MOUNT = "export default { mount: () => new Promise(() => {}) };"


async def test_images_go_to_cells_that_can_be_seen(new_page: PageMaker, tmp_path: Path) -> None:
    """As they came, the newest, and none to a cell that is out of sight."""
    folder = made_widget(tmp_path, "eye", EYE)
    (folder / "shown.js").write_text("export const shown = (a, b) => `${a}x${b}`;", "utf-8")
    uses = [
        *(WidgetUse(f"gap{n}", "battery", {"level": "battery"}) for n in range(12)),
        WidgetUse("eye", "eye", {"eye": "cam"}),
    ]
    widget = plain_widget("eye", ["eye"], folder)
    signals = {"battery": BATTERY, "cam": Signal("cam", "image", stale_after_s=60)}
    robot = FakeRobot(dashboard_profile(signals=signals, uses=uses, widgets=[widget]))
    async with running_dashboard(robot, trusted=robot.profile.widgets) as address:
        page = await new_page(size="phone")
        came: list[int] = []
        page.on(
            "websocket",
            lambda line: line.on(
                "framereceived",
                lambda data: came.append(len(data)) if isinstance(data, bytes) else None,
            ),
        )
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("cam", colour_bars(8, 4))
        robot.set_reading("battery", 42)
        await until_text(page, "[data-cell='0'] .battery-digits", "42")
        robot.set_reading("battery", 43)
        await until_text(page, "[data-cell='0'] .battery-digits", "43")
        assert came == []
        cell = page.locator("[data-cell='12']")
        await cell.scroll_into_view_if_needed()
        await until_attribute(page, "[data-cell='12']", "data-size", "8x4")
        await until_attribute(page, "[data-cell='12']", "data-type", "image/png")
        await until_attribute(page, "[data-cell='12']", "data-links", "true live")
        robot.set_reading("cam", b"this is no image")
        robot.set_reading("cam", colour_bars(6, 3))
        await until_attribute(page, "[data-cell='12']", "data-size", "6x3")


async def test_lists_arrays_and_units_reach_a_widget(new_page: PageMaker, tmp_path: Path) -> None:
    """In the order of the binding; elements in the unit that the input asks for."""
    folder = made_widget(tmp_path, "lines", LINES)
    ports = {
        "series": WidgetPort("series", is_multiple=True),
        "turned": WidgetPort("turned", ("array",), unit="deg"),
    }
    use = WidgetUse("lines", "lines", {"turned": "turned"}, lists={"series": ("b", "a")})
    signals = {
        "a": Signal("a", stale_after_s=60),
        "b": Signal("b", stale_after_s=60),
        "turned": Signal("turned", "array", unit="rad", stale_after_s=60),
    }
    widget = Widget("lines", "Lines", folder, ports)
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[use], widgets=[widget]))
    async with running_dashboard(robot, trusted=robot.profile.widgets) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("a", 1)
        robot.set_reading("b", 2)
        robot.set_reading("turned", (3.14159265, None, -1.57079633))
        await until_attribute(page, "[data-cell='0']", "data-series", "2 1")
        await until_attribute(page, "[data-cell='0']", "data-turned", "[180,null,-90]")
        await until_attribute(page, "[data-cell='0']", "data-unit", "deg ° 2 lines")


async def test_people_choose_in_which_units_they_read(new_page: PageMaker) -> None:
    """It changes at once, and is kept on the device; the robot hears nothing of it."""
    uses = [WidgetUse("speed", "value", {"value": "speed"})]
    speed = Signal("speed", "number", unit="m/s", precision=1, stale_after_s=60)
    robot = FakeRobot(dashboard_profile(signals={"speed": speed}, uses=uses))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("speed", 10)
        cell = page.locator("[data-cell='0']")
        await expect(cell).to_contain_text("10.0 m/s")
        await page.get_by_role("button", name="This device").click()
        for system, shown in (
            ("everyday", "36.0 km/h"),
            ("imperial", "22.4 mph"),
            ("nautical", "19.4 kn"),
        ):
            await page.get_by_label("Units").select_option(system)
            await expect(cell).to_contain_text(shown)
        await page.reload()
        await until(lambda: robot.is_open)
        robot.set_reading("speed", 10)
        await expect(cell).to_contain_text("19.4 kn")
        assert robot.commands == []


async def test_a_slow_widget_says_so_and_leaves_the_page_to_the_others(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Twenty long calls, and it is called once a second; its neighbour shows every value."""
    slow = plain_widget("slow", ["level"], made_widget(tmp_path, "slow", SLOW))
    late = plain_widget("late", ["level"], made_widget(tmp_path, "late", ENDLESS_MOUNT))
    uses = [
        WidgetUse(name, widget, {"level": "battery"})
        for name, widget in (("slow", "slow"), ("good", "battery"), ("late", "late"))
    ]
    robot = FakeRobot(dashboard_profile(uses=uses, widgets=[slow, late]))
    async with running_dashboard(robot, trusted=robot.profile.widgets) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        remark = page.locator("[data-cell='0'] .urc-remark")
        for level in range(60):
            robot.set_reading("battery", level)
            await until_text(page, "[data-cell='1'] .battery-digits", str(level))
            if await remark.count():
                break
        assert "slow" in await remark.inner_text()
        calls = int(await page.locator("[data-cell='0']").get_attribute("data-calls") or "0")
        assert 20 <= calls <= 61
        await page.locator("[data-cell='2'] .urc-remark", has_text="still loading").wait_for()
        assert await page.locator(".urc-fault").count() == 0
