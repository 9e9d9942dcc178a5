"""The dashboard in a real browser: live values, lost lines, keyboard, screens."""

import asyncio
import re
from collections.abc import Callable

import pytest
from playwright.async_api import Page, expect

from tests.e2e.browser import SIZES, Size, choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from urc.model.interface import WidgetUse
from urc.model.profile import Setting
from urc.model.values import Signal
from urc.testing.dashboard import BATTERY, FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

# Its own age makes it old only after a minute: what greys it earlier is the line.
PATIENT = BATTERY._replace(stale_after_s=60)

DIGITS = ".battery-digits"
BADGE = "[data-badge]"
BADGE_TEXT = "[data-badge-text]"

# Counts display frames; notes the frame in which a value arrived and the one in which it was drawn.
PROBE = """
window.probe = { frame: 0, arrived: [], drawn: [] };
const tick = () => { probe.frame += 1; requestAnimationFrame(tick); };
requestAnimationFrame(tick);
window.WebSocket = class extends WebSocket {
  constructor(...args) {
    super(...args);
    this.addEventListener("message", ({ data }) => {
      const message = JSON.parse(data);
      if (message.t === "v") probe.arrived.push([String(message.v[0]), probe.frame]);
    });
  }
};
document.addEventListener("DOMContentLoaded", () => {
  const digits = document.querySelector(".battery-digits");
  new MutationObserver(() => probe.drawn.push([digits.textContent, probe.frame]))
    .observe(digits, { childList: true, characterData: true, subtree: true });
});
"""


def is_about_the_socket(fault: str) -> bool:
    """Whether a fault is the browser's own word on a server that a test has stopped."""
    return "WebSocket connection to" in fault


async def until_at_least(page: Page, level: int) -> None:
    """Wait until the battery shows so much, or more: a slow page may miss a value."""
    await page.wait_for_function(
        "([digits, level]) => Number(document.querySelector(digits)?.textContent) >= level",
        arg=[DIGITS, level],
    )


async def open_robot(page: Page, address: str, robot: FakeRobot) -> None:
    """Go to the robot's page and wait until its session is open."""
    await page.goto(f"{address}robots/{robot.profile.name}/")
    await until(lambda: robot.is_open and robot.hub.revision > 0)


async def test_a_value_is_drawn_within_one_display_frame_of_its_arrival(
    new_page: PageMaker,
) -> None:
    """Between the message and the text on the page lies at most one frame, for every value."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.add_init_script(PROBE)
        await open_robot(page, address, robot)
        robot.set_reading("battery", 0)
        await until_text(page, DIGITS, "0")
        for level in range(1, 101):
            robot.set_reading("battery", level)
            await asyncio.sleep((0.001, 0.01, 0.02, 0.05)[level % 4])
            if level % 3 == 0:  # however slow this machine is, many are drawn
                await until_text(page, DIGITS, str(level))
        await until_text(page, DIGITS, "100")
        probe = await page.evaluate("window.probe")
    arrived = dict(probe["arrived"])
    arrived.pop("0", None)  # the first one may have waited for the widget's module
    late = {text: frame - arrived[text] for text, frame in probe["drawn"] if text in arrived}
    assert len(late) >= 30
    assert max(late.values()) <= 1


async def test_the_puppet_is_lost_and_comes_back(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess]
) -> None:
    """Its server is killed: grey with its age, and the badge says so. It is back: live."""
    level = 41

    async def puppet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal level
        try:
            while await reader.readline() == b"Give me the battery %\n":
                level += 1
                writer.write(b"%d\n" % level)
                await writer.drain()
        except OSError:
            pass
        finally:
            writer.close()

    port = free_port()
    server = await asyncio.start_server(puppet, "127.0.0.1", port)
    process = urc_process("serve", "robots/puppet.yaml", "--set", f"port={port}", "--port", "0")
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    page = await new_page(size="phone")
    await page.goto(address)
    await page.get_by_role("link", name="Connect to Puppet").click()
    await until_at_least(page, 43)
    await until_text(page, BADGE_TEXT, "Live")

    server.close()
    await until_attribute(page, ".battery", "data-state", "stale")
    await until_text(page, BADGE_TEXT, "Robot lost")
    await until_attribute(page, BADGE, "data-state", "bad")
    assert "old" in await page.inner_text(".battery-note")
    assert await page.text_content(DIGITS) == str(level)

    level = 77
    server = await asyncio.start_server(puppet, "127.0.0.1", port)
    await until_attribute(page, ".battery", "data-state", "live")
    await until_text(page, BADGE_TEXT, "Live")
    await until_at_least(page, 78)
    server.close()
    assert process.is_running


async def test_urc_is_lost_and_comes_back(new_page: PageMaker) -> None:
    """Without a server every value is old at once; the page finds it again by itself."""
    robot = FakeRobot(dashboard_profile(signals={"battery": PATIENT}))
    page = await new_page()
    new_page.allow(page, is_about_the_socket)
    port = free_port()
    async with running_dashboard(robot, port=port) as address:
        await open_robot(page, address, robot)
        robot.set_reading("battery", 55)
        await until_text(page, DIGITS, "55")
        await until_attribute(page, ".battery", "data-state", "live")
    await until_attribute(page, ".battery", "data-state", "stale")
    await until_text(page, BADGE_TEXT, "No connection to URC")
    async with running_dashboard(robot, port=port):
        await until(lambda: robot.is_open)
        await until_text(page, BADGE_TEXT, "Live")
        robot.set_reading("battery", 56)
        await until_text(page, DIGITS, "56")
        await until_attribute(page, ".battery", "data-state", "live")
        assert robot.opened == 2


async def test_a_lost_line_greys_at_once_and_a_silent_one_with_time(new_page: PageMaker) -> None:
    """Lost: old at once. Back, and young enough: live. Too old: grey with its age, then a dash."""
    robot = FakeRobot(dashboard_profile(signals={"battery": PATIENT}))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await open_robot(page, address, robot)
        robot.set_reading("battery", 15, alarm="low")
        await until_text(page, ".battery-note", "◆ Low")
        robot.link("lost", "connection refused")
        await until_attribute(page, ".battery", "data-state", "stale")
        await until_text(page, BADGE_TEXT, "Robot lost")
        assert "connection refused" in await page.inner_text("[data-links]")
        robot.link("live")
        await until_attribute(page, ".battery", "data-state", "live")
        robot.set_reading("battery", 15, age_s=70, alarm="low")
        await until_attribute(page, ".battery", "data-state", "stale")
        robot.set_reading("battery", 15, age_s=610, alarm="low")
        await until_attribute(page, ".battery", "data-state", "gone")
        await until_text(page, DIGITS, "—")
        assert "seen 10 min ago" in await page.inner_text(".battery-note")
        assert await page.get_attribute(".battery", "data-alarm") == ""
        # A meter must have a number (WAI-ARIA 1.2); what is spoken in place of it is the text. Both
        # follow what is seen within half a second, so that speech is not begun anew all the time.
        await until_attribute(page, ".battery-meter", "aria-valuenow", "0")
        await until_attribute(page, ".battery-meter", "aria-valuetext", "unknown")


# Reported when the door moves, so it may be as old as it likes; but not once nobody can tell.
DOOR = Signal("door", "boolean", states={"true": "open", "false": "shut"}, stale_after_s=3600)


async def test_the_last_value_of_a_lost_line_stays_with_its_age(new_page: PageMaker) -> None:
    """Grey and hatched at once, however patient its signal is; and live again with the line."""
    use = WidgetUse("door", "value", {"value": "door"})
    robot = FakeRobot(dashboard_profile(signals={"door": DOOR}, uses=[use]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("door", True, age_s=1800)
        await until_text(page, ".value-text", "open")
        await until_attribute(page, ".value", "data-state", "live")
        await expect(page.locator(".urc-cell")).not_to_have_attribute("data-old", re.compile(""))
        robot.link("lost", "connection refused", age_s=600)
        await until_attribute(page, ".value", "data-state", "stale")
        await until_attribute(page, ".urc-cell", "data-old", "30 min old")
        await until_text(page, ".value-text", "open")
        assert "30 min old" in await page.inner_text(".value-note")
        # Another attempt under way is no line yet.
        robot.link("connecting")
        await until_text(page, ".urc-link-state", "◌ connecting")
        await until_attribute(page, ".urc-cell", "data-old", "30 min old")
        robot.link("live")
        await until_attribute(page, ".value", "data-state", "live")
        await expect(page.locator(".urc-cell")).not_to_have_attribute("data-old", re.compile(""))


async def test_a_robot_is_found_by_a_word_on_a_phone(new_page: PageMaker) -> None:
    """The cards without it are gone; without any, that is said."""
    robots = [FakeRobot(dashboard_profile(name=f"bot{number}")) for number in range(7)]
    async with running_dashboard(*robots) as address:
        page = await new_page(size="phone")
        await page.goto(address)
        await page.get_by_role("searchbox", name="Find a robot").fill("bot3")
        await expect(page.locator("[data-robot-card]:visible")).to_have_count(1)
        await page.get_by_role("searchbox", name="Find a robot").fill("xyzzy")
        await expect(page.locator("[data-robot-card]:visible")).to_have_count(0)
        await expect(page.get_by_text("No robot fits.")).to_be_visible()


async def test_from_menu_to_robot_and_back_by_keyboard(new_page: PageMaker) -> None:
    """Everything is reached by Tab and Enter, what has the focus is seen, and Back disconnects."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(address)

        async def tab_to(name: str) -> None:
            for _ in range(12):
                await page.keyboard.press("Tab")
                focused = page.locator(":focus")
                assert await focused.evaluate("el => getComputedStyle(el).outlineStyle") != "none"
                text = await focused.evaluate("el => el.getAttribute('aria-label') ?? el.innerText")
                if name in text:
                    return
            raise AssertionError(f"Tab does not reach {name!r}")

        await tab_to("Skip to the content")
        await tab_to("Connect to Puppet")
        await page.keyboard.press("Enter")
        await page.wait_for_url("**/robots/puppet/")
        await until(lambda: robot.is_open)
        await until_text(page, BADGE_TEXT, "Live")
        await tab_to("Back")
        await page.keyboard.press("Enter")
        await page.wait_for_url(address)
        await until(lambda: not robot.is_open)


async def test_a_robot_is_no_link_until_its_settings_are_complete(new_page: PageMaker) -> None:
    """The menu says what is missing; the robot's page leads back to it."""
    profile = dashboard_profile(settings={"host": Setting("host", "host")})
    async with running_dashboard(FakeRobot(profile)) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        assert page.url == address
        assert await page.get_by_role("link", name="Connect to").count() == 0
        assert "Not set yet: Host." in await page.inner_text("[data-robot-card]")


@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_the_battery_fits_every_screen(new_page: PageMaker, size: Size) -> None:
    """No sideways scrolling, the battery is large and whole, controls are big enough to hit."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page(size=size)
        await open_robot(page, address, robot)
        robot.set_reading("battery", 76)
        await until_text(page, DIGITS, "76")
        view = page.viewport_size
        assert view is not None
        assert await page.evaluate("document.documentElement.scrollWidth") <= view["width"]
        picture = page.locator(".battery-picture:visible")
        assert await picture.count() == 1
        box = await picture.bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["y"] + box["height"] <= view["height"]
        assert max(box["width"], box["height"]) >= 0.4 * min(view["width"], view["height"])
        for control in await page.locator("a:visible, button:visible, select:visible").all():
            area = await control.bounding_box()
            if area and not await control.evaluate("el => el.matches('.urc-skip')"):
                assert min(area["width"], area["height"]) >= 48


@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_nothing_in_the_bar_is_cut_off(new_page: PageMaker, size: Size) -> None:
    """The pages are in the bar, or behind a button; the settings of the device fit the screen."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page(size=size)
        await page.goto(address)
        cut = "el => el.scrollWidth > el.clientWidth"
        assert not await page.locator(".urc-bar-title").evaluate(cut)
        pages = page.get_by_role("link", name="Widgets")
        if size != "desktop":
            await expect(pages).to_be_hidden()
            await page.get_by_role("button", name="Pages of URC").click()
        await expect(pages).to_be_visible()
        await page.keyboard.press("Escape")
        for theme in ("light", "dark", "sunlight", "night"):
            await choose_theme(page, theme)
        await page.get_by_role("button", name="This device").click()
        sheet = await page.locator("#device").bounding_box()
        width, height = SIZES[size]
        assert sheet is not None
        assert sheet["x"] >= 0
        assert sheet["x"] + sheet["width"] <= width
        assert sheet["y"] + sheet["height"] <= height


async def test_the_round_trip_is_not_part_of_what_is_bad(new_page: PageMaker) -> None:
    """A lost robot is bold; the figure beside it is another matter."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        weight = "([selector]) => getComputedStyle(document.querySelector(selector)).fontWeight"
        plain = await page.evaluate(weight, ["[data-badge-trip]"])
        robot.link("lost", "connection refused")
        await until_attribute(page, BADGE, "data-state", "bad")
        assert await page.evaluate(weight, [BADGE_TEXT]) > plain
        assert await page.evaluate(weight, ["[data-badge-trip]"]) == plain


async def test_a_theme_is_kept_on_the_device(new_page: PageMaker) -> None:
    """It is chosen once, holds on every page, and is there before anything is drawn."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page(theme="dark")
        await page.goto(address)
        ground = "getComputedStyle(document.body).backgroundColor"
        colours = {await page.evaluate(ground)}
        for theme in ("light", "sunlight", "night"):
            await choose_theme(page, theme)
            colours.add(await page.evaluate(ground))
        assert len(colours) == 4
        await open_robot(page, address, robot)
        await until_attribute(page, "html", "data-theme", "night")
        assert await page.locator("[data-theme-choice]:checked").input_value() == "night"


async def test_lines_of_the_log_are_shown_once_in_order(new_page: PageMaker) -> None:
    """Also after the line was cut: what is told again is not shown again."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await open_robot(page, address, robot)
        for number in range(3):
            robot.log(f"line {number} <b>not bold</b>")
        lines = page.locator("[data-log] > li")
        await page.locator("[data-badge-why]").click()
        await lines.nth(2).wait_for()
        await page.evaluate("dispatchEvent(new Event('pagehide'))")
        await page.evaluate("dispatchEvent(new PageTransitionEvent('pageshow', {persisted: true}))")
        await until_text(page, BADGE_TEXT, "Live")
        robot.log("line 3")
        await lines.nth(3).wait_for()
        texts = await lines.all_inner_texts()
        assert [text.split("wire: ")[1] for text in texts] == [
            "line 3",
            *(f"line {number} <b>not bold</b>" for number in (2, 1, 0)),
        ]
