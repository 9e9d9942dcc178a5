"""Pages for everybody: by axe's rules, by Tab alone, without motion, in a system's own colours."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.axe import CONTRAST, faults, prepare
from tests.e2e.browser import Size
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard
from tests.e2e.dev_pages import served
from tests.e2e.gallery import THEMES, groups
from tests.e2e.motion.driving import CALM_LEASE_S, USES, Wire, commands
from tests.e2e.processes import UrcProcess
from urc.model.driver import Command
from urc.model.exchange import Confirm
from urc.model.interface import Interface, Layout, Slot, Tab, WidgetUse
from urc.model.payload import WriteSpec
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = [pytest.mark.anyio, pytest.mark.needs("axe")]

SCREENS: tuple[Size, ...] = ("phone", "desktop")
GALLERY = ["+".join(groups()[start : start + 2]) for start in range(0, len(groups()), 2)]
ASKED = "[data-cell='3']"

# Counts the stops of Tab while it is pressed, and notes those where nothing shows the focus.
WATCH_TAB = """
() => {
  const all = [...document.querySelectorAll(
    "a[href], button, select, input, textarea, summary, [tabindex]")];
  const radios = new Set();
  const wanted = all.filter((el) => {
    if (el.tabIndex < 0 || el.disabled) return false;
    if (!el.checkVisibility({ visibilityProperty: true })) return false;
    if (el.type !== "radio") return true;
    return !radios.has(el.name) && radios.add(el.name);
  });
  const met = new Set();
  const dull = [];
  addEventListener("focusin", ({ target }) => {
    if (met.has(target)) return;
    met.add(target.type === "radio" ? wanted.find((el) => el.name === target.name) : target);
    const shows = [target, ...target.querySelectorAll("*"), target.parentElement].some((el) =>
      ["", "::after", "::before"].some((part) => {
        const { outlineStyle, outlineWidth } = getComputedStyle(el, part);
        return outlineStyle !== "none" && parseFloat(outlineWidth) >= 2;
      }));
    if (!shows) dull.push(`${name(target)} does not show that it has the focus`);
  });
  const name = (el) =>
    `${el.closest("[data-widget]")?.dataset.widget ?? ""} ${el.outerHTML.slice(0, 90)}`;
  globalThis.urcTab = () => [
    ...dull,
    ...wanted.filter((el) => !met.has(el) && el.isConnected)
      .map((el) => `${name(el)} is not reached`),
  ];
  document.activeElement?.blur();
  return wanted.length;
}
"""

# What can be worked with and has, in the system's few colours, neither words nor a line around it;
# or words of the colour that the browser then lays behind words.
UNSEEN = """
() => {
const behind = document.createElement("i");
behind.style.color = "Canvas";
document.body.append(behind);
const canvas = getComputedStyle(behind).color;
behind.remove();
const WORKED_WITH = "button, select, input, [role='slider'], [role='application']";
return [...document.querySelectorAll(WORKED_WITH)]
  .filter((el) => el.checkVisibility({ visibilityProperty: true }) && !el.closest(".urc-hidden"))
  .filter((el) => {
    const style = getComputedStyle(el);
    if (style.appearance !== "none" && el.matches("[type=radio], [type=checkbox], [type=range]")) {
      return false; // drawn by the browser
    }
    const isLined = [el, ...el.querySelectorAll("*")].some((part) => {
      const { borderTopStyle, borderTopWidth } = getComputedStyle(part);
      return borderTopStyle !== "none" && parseFloat(borderTopWidth) > 0;
    });
    const isSaid = el.textContent.trim() !== "" && style.color !== style.backgroundColor;
    const isLost = style.forcedColorAdjust !== "none" && style.color === canvas;
    return (isSaid && isLost) || (!isLined && !isSaid && !el.querySelector("svg, canvas"));
  })
  .map((el) => el.outerHTML.slice(0, 120));
}
"""

MOVING = """
() => document.getAnimations()
  .map(({ effect }) => `${effect.target.className} ${effect.getTiming().duration} ms`)
"""


def row(*names: str) -> Layout:
    """Return a grid of one row."""
    return Layout(1, len(names), tuple(Slot(name, 0, place) for place, name in enumerate(names)))


def asking() -> Wire:
    """Return a robot that moves, and asks before it melts; its other interface has tabs."""
    robot = Wire(lease_s=CALM_LEASE_S)
    melt = Command("melt", "wire", WriteSpec("text", {}), confirm=Confirm(text="Melt it?"))
    uses = (*USES, WidgetUse("melt", "button", {}, {"press": "melt"}, title="Melt"))
    told = {**commands(CALM_LEASE_S), "melt": melt}
    profile = dashboard_profile(uses=uses, commands=told)
    pages = {
        name: Tab(name, name.title(), {"landscape": row(name, "melt")}) for name in ("left", "up")
    }
    both = {**profile.interfaces, "tabs": Interface("tabs", "In tabs", tabs=pages)}
    robot.profile = profile._replace(interfaces=both)
    return robot


async def themed(page: Page, theme: str) -> None:
    """Show the page in a theme."""
    await page.evaluate("(theme) => (document.documentElement.dataset.theme = theme)", theme)


async def check(page: Page, where: str, *themes: str) -> None:
    """Fail on any fault that axe finds, and on any contrast in `themes`."""
    if themes:
        await themed(page, themes[0])
    found = [f"{where}: {line}" for line in await faults(page)]
    for theme in themes[1:]:
        await themed(page, theme)
        found += [f"{where}, {theme}: {line}" for line in await faults(page, CONTRAST)]
    assert not found, "\n".join(found)


async def check_tab(page: Page, where: str) -> None:
    """Press Tab until all was met; fail on what is not reached, or does not show it."""
    stops = await page.evaluate(WATCH_TAB)
    # A browser has stops of its own, such as what can be scrolled.
    for pressed in range(2 * stops + 20):
        await page.keyboard.press("Tab")
        if pressed >= stops and pressed % 10 == 0 and not await page.evaluate("urcTab()"):
            break
    found = [f"{where}: {line}" for line in await page.evaluate("urcTab()")]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("size", SCREENS)
async def test_pages_have_none_of_the_faults_that_axe_knows(
    new_page: PageMaker, size: Size
) -> None:
    """The menu, a page that is not there, the gallery, and a robot's page in each of its kinds."""
    page = await prepare(await new_page(size=size))
    new_page.allow(page, lambda text: "404" in text)
    themes = THEMES if size == "desktop" else ()
    async with running_dashboard(asking()) as address:
        for path in ("", "nowhere", "widgets"):
            await page.goto(f"{address}{path}")
            await check(page, path or "menu", *themes)
        for kind in ("tabs", "debug"):
            await page.goto(f"{address}robots/puppet/?interface={kind}")
            await until_ready(page)
            await check(page, kind, *themes)


async def until_ready(page: Page) -> None:
    """Wait until the robot of a page can be driven."""
    await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
    await expect(page.locator("[data-verb='take']")).to_be_visible()


@pytest.mark.parametrize("size", SCREENS)
async def test_a_robot_that_is_driven_asks_stops_and_is_lost_without_such_faults(
    new_page: PageMaker, size: Size
) -> None:
    """In each state that matters most, in each theme."""
    page = await prepare(await new_page(size=size))
    new_page.allow(page, lambda text: "ERR_CONNECTION_REFUSED" in text)
    robot = asking()
    themes = THEMES if size == "desktop" else ()
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until_ready(page)
        await check(page, "idle", *THEMES)
        await page.locator("[data-verb='take']").click()
        await expect(page.locator("[data-controls]")).to_have_attribute("data-state", "mine")
        await page.get_by_role("button", name="Melt").first.click()
        await expect(page.locator(f"{ASKED} .urc-ask")).to_be_visible()
        await expect(page.locator(f"{ASKED} .urc-ask button").last).to_be_enabled()
        await check(page, "driving, and asked", *themes)
        await page.locator("[data-stop-button]").click()
        await expect(page.locator("[data-controls]")).to_have_attribute("data-state", "latched")
        await check(page, "latched", *themes)
        robot.link("lost", "no answer")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "bad")
        await check(page, "the robot is lost")
    await expect(page.locator("[data-who]")).to_have_text("Not connected to URC")
    await check(page, "URC is lost", *themes)


@pytest.mark.parametrize("group", GALLERY)
async def test_every_widget_is_for_everybody_in_every_state(
    new_page: PageMaker, group: str
) -> None:
    """By axe, in each theme; by Tab; without any motion; in a system's own colours."""
    page = await prepare(await new_page())
    await page.emulate_media(reduced_motion="reduce")
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        await page.goto(f"{address}widgets/{group}/")
        await page.wait_for_selector("[data-gallery][data-ready]")
        await check(page, "widgets", *THEMES)
        assert await page.evaluate(MOVING) == []
        await page.emulate_media(forced_colors="active", reduced_motion="reduce")
        unseen = await page.evaluate(UNSEEN)
        assert not unseen, "\n".join(unseen)
        await check_tab(page, "widgets")


async def test_everything_on_a_page_is_reached_by_tab(new_page: PageMaker) -> None:
    """And seen in the system's own colours, without motion; nothing holds the focus fast."""
    page = await new_page(size="phone")
    await page.emulate_media(forced_colors="active", reduced_motion="reduce")
    async with running_dashboard(asking()) as address:
        for path in ("", "widgets", "robots/puppet/?interface=tabs", "robots/puppet/"):
            await page.goto(f"{address}{path}")
            if path.startswith("robots"):
                await until_ready(page)
            assert await page.evaluate(UNSEEN) == [], path
            assert await page.evaluate(MOVING) == [], path
            await check_tab(page, path)


async def test_the_dev_page_has_none_of_these_faults(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """With traffic, signals and commands."""
    page = await prepare(await new_page())
    async with served(page, urc_process, tmp_path):
        await expect(page.locator("[data-signals] tr")).to_contain_text("12 %")
        await check(page, "dev page", *THEMES)
