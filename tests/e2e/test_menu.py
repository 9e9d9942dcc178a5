"""The menu in a real browser: states without a reload, order, filters, rows on a phone, sheets."""

import asyncio
import re

import pytest
from playwright.async_api import Page, Route, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import SIZES, Size, choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.test_languages import CUT
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

PATIENCE_MS = 15_000
WIDE = {"width": 1180, "height": 820}
LYING = {"width": 844, "height": 390}

# Cards that are completely on the screen.
WHOLE_ROWS = """() => [...document.querySelectorAll("[data-robot-card]")]
  .filter((card) => card.getBoundingClientRect().bottom <= innerHeight).length"""

# Parts of a card that lie over each other, but for the link, which covers the card, and the marks
# in the corners of the image.
OVERLAPS = """() => [...document.querySelectorAll("[data-robot-card]")].flatMap((card) => {
  const words = [".urc-robot-title", ".urc-robot-kind", ".urc-robot-state", ".urc-robot-facts",
    ".urc-robot-go"];
  const marks = [".urc-sim", ".urc-more-button"];
  const place = (selector) => [...card.querySelectorAll(selector)]
    .map((el) => el.getBoundingClientRect()).filter(({ width }) => width > 0);
  const over = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const isOver = (parts) => parts.some((a, n) => parts.slice(n + 1).some((b) => over(a, b)));
  const here = words.flatMap(place);
  return isOver([...place(".urc-look"), ...here]) || isOver([...marks.flatMap(place), ...here])
    ? [card.dataset.robotCard] : [];
})"""


def fleet(count: int) -> list[FakeRobot]:
    """Return robots whose titles are as long as real ones."""
    return [FakeRobot(dashboard_profile(name=f"salamandra-{number}")) for number in range(count)]


def card(page: Page, number: int) -> str:
    """Return the selector of a card."""
    return f"[data-robot-card='salamandra-{number}']"


async def test_eight_robots_fit_on_the_screen_of_a_phone(new_page: PageMaker) -> None:
    async with running_dashboard(*fleet(12)) as address:
        page = await new_page(size="phone")
        await page.goto(address)
        assert await page.evaluate(WHOLE_ROWS) >= 8
        await expect(page.locator(".urc-robot-kind").first).to_be_visible()
        row = await page.locator(card(page, 0)).bounding_box()
        assert row is not None
        assert row["height"] == pytest.approx(88, abs=1)


async def test_states_come_without_a_reload_and_alarms_come_first(new_page: PageMaker) -> None:
    robots = fleet(8)
    async with running_dashboard(*robots) as address:
        menu, robot_page = await new_page(), await new_page()
        await menu.goto(address)
        state = menu.locator(f"{card(menu, 5)} .urc-robot-state")
        none = menu.get_by_text("No robot is connected")
        await expect(none).to_have_count(1)
        await expect(none).to_be_visible()
        await expect(state).to_have_text("")
        await robot_page.goto(f"{address}robots/salamandra-5/")
        await until(lambda: robots[5].is_open)
        robots[5].set_reading("battery", 42)
        await expect(state).to_contain_text("● Live", timeout=PATIENCE_MS)
        await expect(none).to_be_hidden()
        await expect(state).to_contain_text("Battery 42 %", timeout=PATIENCE_MS)
        robots[5].set_reading("battery", 7, alarm="lolo")
        await expect(state).to_contain_text("▲ 1 alarm", timeout=PATIENCE_MS)
        await expect(menu.locator("[data-robot-card]").first).to_have_attribute(
            "data-robot-card", "salamandra-5", timeout=PATIENCE_MS
        )
        assert await menu.title() == "▲ 1 · URC"
        await menu.get_by_role("button", name="Alarms 1").click()
        await expect(menu.locator("[data-robot-card]:visible")).to_have_count(1)
        await menu.get_by_role("button", name="Connected 1").click()
        await expect(menu.locator("[data-robot-card]:visible")).to_have_count(1)
        await robot_page.close()
        await expect(state).to_contain_text("Last seen just now", timeout=PATIENCE_MS)


async def test_a_card_says_its_state_and_its_action(new_page: PageMaker) -> None:
    """Before the first connection, the profile alone tells it."""
    robots = fleet(2)
    async with running_dashboard(*robots) as address:
        for size in ("phone", "desktop"):
            menu, robot_page = await new_page(size=size), await new_page()
            await menu.goto(address)
            idle, used = (menu.locator(card(menu, number)) for number in (0, 1))
            await expect(idle.locator("[data-link]")).to_be_hidden()
            await expect(menu.locator(".urc-none-on")).to_be_visible()
            await expect(idle.locator(".urc-robot-facts")).to_contain_text("TCP")
            await expect(idle.locator(".urc-robot-go")).to_have_text(re.compile("Connect"))
            action = await idle.locator(".urc-robot-go").bounding_box()
            assert action is not None
            assert action["height"] >= (44 if size == "phone" else 40)
            await robot_page.goto(f"{address}robots/salamandra-1/")
            await expect(used.locator("[data-link]")).to_have_text("● Live", timeout=PATIENCE_MS)
            state = await used.locator("[data-link]").bounding_box()
            assert state is not None
            assert state["width"] > 20
            await expect(used.locator(".urc-robot-open")).to_be_visible()
            await expect(used.locator(".urc-robot-connect")).to_be_hidden()
            await robot_page.close()
            await menu.close()


async def test_a_card_says_what_kind_of_robot_it_is(new_page: PageMaker) -> None:
    """The first clause of the summary; the search finds all of it."""
    robot = dashboard_profile(name="salamandra-0")
    told = robot._replace(summary="Snake robot, controlled by radio. It has no fail-safe.")
    named = dashboard_profile(name="rover")._replace(summary="Rover, with wheels.")
    others = fleet(8)[2:]
    async with running_dashboard(FakeRobot(told), FakeRobot(named), *others) as address:
        page = await new_page()
        await page.goto(address)
        await expect(page.locator(f"{card(page, 0)} .urc-robot-kind")).to_have_text("Snake robot")
        rover = page.locator("[data-robot-card='rover']")
        await expect(rover.locator(".urc-robot-kind")).to_have_count(0)
        await page.get_by_label("Find a robot").fill("radio")
        await expect(page.locator("[data-robot-card]:visible")).to_have_count(1)


async def test_a_hidden_tab_asks_for_nothing(new_page: PageMaker) -> None:
    async with running_dashboard(*fleet(2)) as address:
        page = await new_page()
        await page.goto(address)
        await page.evaluate(
            """() => {
              Object.defineProperty(document, "hidden", { value: true });
              document.dispatchEvent(new Event("visibilitychange"));
            }"""
        )
        await page.wait_for_timeout(500)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        await page.wait_for_timeout(5000)
        assert asked == []


async def test_letters_appear_only_where_the_robot_has_no_picture(new_page: PageMaker) -> None:
    """The cards below the screen are asked too, so that a scroll finds their pictures."""
    asked: set[str] = set()
    gate = asyncio.Event()

    async def answer(route: Route) -> None:
        asked.add(route.request.url)
        await gate.wait()
        await route.fulfill(status=204)

    async with running_dashboard(*fleet(11)) as address:
        page = await new_page(size="phone")
        await page.route("**/robots/*/card", answer)
        await page.goto(address)
        letters = page.locator(f"{card(page, 0)} .urc-look-blank")
        await until(lambda: len(asked) == 1)
        await expect(letters).to_be_hidden()
        gate.set()
        await expect(letters).to_be_visible()
        await until(lambda: len(asked) == 11)


async def test_the_whole_card_is_the_link_and_the_rest_is_behind_a_button(
    new_page: PageMaker,
) -> None:
    async with running_dashboard(*fleet(2)) as address:
        page = await new_page(size="phone")
        await page.emulate_media(reduced_motion="reduce")
        await page.goto(address)
        await page.get_by_role("button", name="More about Salamandra-0").click()
        sheet = page.locator(f"{card(page, 0)} [data-more]")
        await expect(sheet).to_contain_text("salamandra-0.yaml")
        box = await sheet.bounding_box()
        assert box is not None
        assert box["y"] + box["height"] == pytest.approx(SIZES["phone"][1], abs=1)
        await page.keyboard.press("Escape")
        await expect(sheet).to_be_hidden()
        row = await page.locator(card(page, 1)).bounding_box()
        assert row is not None
        await page.mouse.click(row["x"] + 8, row["y"] + row["height"] - 8)
        await page.wait_for_url("**/robots/salamandra-1/")


async def test_a_filter_is_kept_on_the_way_back(new_page: PageMaker) -> None:
    async with running_dashboard(*fleet(8)) as address:
        page = await new_page()
        await page.goto(address)
        await page.get_by_role("button", name="Connected 0").click()
        await expect(page.get_by_text("No robot fits.")).to_be_visible()
        await page.reload()
        await expect(page.get_by_text("No robot fits.")).to_be_visible()


@pytest.mark.needs("axe")
@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_nothing_is_cut_or_overlaps_in_any_theme(new_page: PageMaker, size: Size) -> None:
    async with running_dashboard(*fleet(9)) as address:
        page = await prepare(await new_page(size=size))
        await page.goto(address)
        assert await faults(page) == []
        for theme in ("light", "dark", "sunlight", "night"):
            await choose_theme(page, theme)
            assert await page.evaluate(CUT) == []
            assert await page.evaluate(OVERLAPS) == []
        for screen in (WIDE, LYING, {"width": 320, "height": 568}):
            await page.set_viewport_size(screen)  # type: ignore[arg-type]
            assert await page.evaluate(CUT) == []
            assert await page.evaluate(OVERLAPS) == []


async def test_a_named_screen_is_known_to_others(new_page: PageMaker) -> None:
    """The name is kept on the device, and told at each connection."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(address)
        await page.get_by_role("button", name="This device").click()
        await page.get_by_label("Name of this screen").fill("Tablet in the lab")
        await page.get_by_label("Name of this screen").press("Enter")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await page.get_by_role("button", name="This device").click()
        assert await page.get_by_label("Name of this screen").input_value() == "Tablet in the lab"
