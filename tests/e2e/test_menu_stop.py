"""STOP ALL of the menu in a real browser: one tap stops the shown robots, a scroll stops none."""

import re

import pytest
from playwright.async_api import CDPSession, Locator, Page, Route, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import SIZES, Size, choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard
from tests.e2e.motion.driving import CALM_LEASE_S, Wire
from tests.e2e.test_languages import CUT
from tests.unit.runtime.desks import DRIVER
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.movers import FakeMotionBackend

pytestmark = pytest.mark.anyio

PATIENCE_MS = 15_000
SMALL = {"width": 320, "height": 568}
LYING = {"width": 844, "height": 390}
COVERED = """(button) => {
  const { left, top, right, bottom } = button.getBoundingClientRect();
  const middle = [(left + right) / 2, (top + bottom) / 2];
  const spots = [[left + 8, top + 8], [right - 8, bottom - 8], middle];
  return spots.some(([x, y]) => !button.contains(document.elementFromPoint(x, y)));
}"""
"""Whether anything lies over a button, or a part of it is off the screen."""


def carts(count: int, *, still: int = 0) -> list[FakeRobot]:
    """Return robots that move, with the tag carts, and robots without motion."""
    moving = [
        FakeRobot(dashboard_profile(name=f"cart-{number}")._replace(driver=DRIVER, tags=("carts",)))
        for number in range(1, count + 1)
    ]
    return [*moving, *(FakeRobot(dashboard_profile(name=f"still-{n}")) for n in range(still))]


def card(page: Page, name: str) -> Locator:
    """Return the state on a card."""
    return page.locator(f"[data-robot-card='{name}'] .urc-robot-state")


def stop(page: Page, name: str = "STOP ALL") -> Locator:
    """Return the button."""
    return page.get_by_role("button", name=name, exact=True)


def note(page: Page) -> Locator:
    """Return the text next to the button."""
    return page.locator("[data-stop-all-note]")


async def test_one_tap_stops_all_robots_that_can_move(new_page: PageMaker) -> None:
    """Each card has its result, and the note counts them."""
    async with running_dashboard(*carts(3, still=1)) as address:
        page = await new_page(size="phone")
        await page.goto(address)
        await stop(page).tap()
        await expect(note(page)).to_have_text("✓ 3 of 3 stopped")
        for number in (1, 2, 3):
            await expect(card(page, f"cart-{number}")).to_contain_text("■ Stopped ✓")
        await expect(card(page, "still-0")).not_to_contain_text("Stopped")
        await expect(stop(page)).to_have_attribute("data-phase", "latched", timeout=PATIENCE_MS)


async def test_a_robot_without_a_link_is_named_until_it_has_stopped(new_page: PageMaker) -> None:
    robots = carts(3)
    backend = robots[1].backend
    assert isinstance(backend, FakeMotionBackend)
    backend.is_up = False
    async with running_dashboard(*robots) as address:
        page = await new_page()
        await page.goto(address)
        await stop(page).click()
        await expect(note(page)).to_have_text("2 of 3 stopped · ▲ NO LINK: Cart-2")
        await expect(card(page, "cart-2")).to_contain_text("▲ NO LINK")
        await expect(card(page, "cart-1")).to_contain_text("■ Stopped ✓")
        await expect(stop(page)).to_have_attribute("data-phase", "fault")
        backend.is_up = True
        backend.write_due()
        await expect(note(page)).to_have_text("✓ 3 of 3 stopped", timeout=PATIENCE_MS)
        await expect(card(page, "cart-2")).to_contain_text("■ Stopped ✓")


async def test_stop_is_quiet_until_a_robot_is_connected_and_works_nevertheless(
    new_page: PageMaker,
) -> None:
    """The state without a connection must not be the loudest part of the menu."""
    robots = [Wire(lease_s=CALM_LEASE_S), *carts(1, still=1)]
    async with running_dashboard(*robots) as address:
        menu, other = await new_page(), await new_page()
        await menu.goto(address)
        await expect(stop(menu)).to_have_attribute("data-quiet", "")
        await other.goto(f"{address}robots/still-0/")
        await expect(card(menu, "still-0")).to_contain_text("Live", timeout=PATIENCE_MS)
        await expect(stop(menu)).to_have_attribute("data-quiet", "")
        await other.goto(f"{address}robots/puppet/")
        await expect(stop(menu)).not_to_have_attribute("data-quiet", "", timeout=PATIENCE_MS)
        await other.close()
        await expect(stop(menu)).to_have_attribute("data-quiet", "", timeout=PATIENCE_MS)
        await stop(menu).click()
        await expect(note(menu)).to_have_text("✓ 2 of 2 stopped")
        await expect(stop(menu)).not_to_have_attribute("data-quiet", "")


async def test_a_filter_limits_stop_to_the_shown_robots(new_page: PageMaker) -> None:
    """The label says how many robots and, for a tag alone, which."""
    others = [FakeRobot(dashboard_profile(name=f"arm-{n}")._replace(driver=DRIVER)) for n in (1, 2)]
    async with running_dashboard(*carts(5), *others) as address:
        page = await new_page()
        await page.goto(address)
        await expect(stop(page)).to_be_visible()
        await page.get_by_role("button", name="#carts").click()
        await expect(stop(page, "STOP 5 carts")).to_be_visible()
        await page.get_by_label("Find a robot").fill("cart-4")
        await expect(stop(page, "STOP 1 robot")).to_be_visible()
        await page.get_by_label("Find a robot").fill("nothing")
        await expect(page.locator("[data-stop-all-button]")).to_be_hidden()
        await page.get_by_role("button", name="#carts").click()
        await page.get_by_label("Find a robot").fill("arm")
        await stop(page, "STOP 2 robots").click()
        await expect(note(page)).to_have_text("✓ 2 of 2 stopped")
        await page.get_by_label("Find a robot").fill("")
        await expect(card(page, "arm-1")).to_contain_text("Stopped", timeout=PATIENCE_MS)
        await expect(card(page, "cart-1")).not_to_contain_text("Stopped")


async def touch(session: CDPSession, kind: str, *points: tuple[float, float]) -> None:
    """Send one touch event."""
    await session.send(
        "Input.dispatchTouchEvent",
        {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in points]},
    )


async def centre(button: Locator) -> tuple[float, float]:
    """Return the middle of a button."""
    box = await button.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


async def test_a_scroll_that_begins_on_stop_stops_nothing(new_page: PageMaker) -> None:
    """The finger moves at once, as in a scroll; a finger that rests is a press."""
    asked: list[str] = []
    async with running_dashboard(*carts(12)) as address:
        page = await new_page(size="phone")
        page.on("request", lambda request: asked.append(request.url))
        await page.goto(address)
        await expect(stop(page)).to_be_visible()
        x, y = await centre(stop(page))
        session = await page.context.new_cdp_session(page)
        await touch(session, "touchStart", (x, y))
        for step in range(1, 15):
            await touch(session, "touchMove", (x, y - 20 * step))
        await touch(session, "touchEnd")
        await page.wait_for_timeout(600)
        assert await page.evaluate("scrollY") > 50
        assert not [url for url in asked if url.endswith("/api/v1/stop")]
        await touch(session, "touchStart", (x, y))
        await expect(note(page)).to_have_text("✓ 12 of 12 stopped", timeout=PATIENCE_MS)
        await touch(session, "touchEnd")
        await page.wait_for_timeout(300)
        assert len([url for url in asked if url.endswith("/api/v1/stop")]) == 1


async def test_a_mouse_acts_on_the_press_and_a_key_on_enter(new_page: PageMaker) -> None:
    """STOP is the second stop of the keyboard, after the pages; the note is its description."""
    asked: list[str] = []
    async with running_dashboard(*carts(2)) as address:
        page = await new_page()
        page.on("request", lambda request: asked.append(request.url))
        await page.goto(address)
        await expect(stop(page)).to_be_visible()
        x, y = await centre(stop(page))
        await page.mouse.move(x, y)
        await page.mouse.down()
        await expect(note(page)).to_have_text("✓ 2 of 2 stopped")
        await page.mouse.up()
        assert len([url for url in asked if url.endswith("/api/v1/stop")]) == 1
        await stop(page).focus()
        await page.keyboard.press("Enter")
        await expect(note(page)).to_have_text("✓ 2 of 2 stopped")
        assert len([url for url in asked if url.endswith("/api/v1/stop")]) == 2
        await expect(stop(page)).to_have_accessible_description("✓ 2 of 2 stopped")


async def test_a_press_without_a_server_is_said_and_sent_again(new_page: PageMaker) -> None:
    is_cut = True

    async def answer(route: Route) -> None:
        await (route.abort() if is_cut else route.continue_())

    async with running_dashboard(*carts(2)) as address:
        page = await new_page()
        new_page.allow(page, lambda fault: "/api/v1/stop" in fault)
        await page.goto(address)
        await page.route("**/api/v1/stop", answer)
        await stop(page).click()
        await expect(note(page)).to_have_text("▲ NO LINK: use the robot's own stop switch")
        await expect(stop(page)).to_have_attribute("data-phase", "fault")
        is_cut = False
        await expect(note(page)).to_have_text("✓ 2 of 2 stopped", timeout=PATIENCE_MS)


@pytest.mark.parametrize(("moving", "still"), [(1, 0), (1, 3), (0, 2)])
async def test_without_several_moving_robots_there_is_no_stop_all(
    new_page: PageMaker, moving: int, still: int
) -> None:
    async with running_dashboard(*carts(moving, still=still)) as address:
        page = await new_page()
        await page.goto(address)
        await expect(page.locator("[data-robot-card]").first).to_be_visible()
        assert await page.locator("[data-stop-all]").count() == 0


@pytest.mark.needs("axe")
@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_stop_all_has_one_place_and_is_never_covered(new_page: PageMaker, size: Size) -> None:
    """It is in the middle of the lower edge, as on the page of a robot, whatever is open."""
    async with running_dashboard(*carts(12)) as address:
        page = await prepare(await new_page(size=size))
        await page.emulate_media(reduced_motion="reduce")
        await page.goto(address)
        await stop(page).click()
        await expect(note(page)).to_have_text(re.compile("12 of 12"))
        assert await faults(page) == []
        for theme in ("light", "dark", "sunlight", "night"):
            await choose_theme(page, theme)
            assert await page.evaluate(CUT) == []
        width, height = SIZES[size]
        for screen in ({"width": width, "height": height}, SMALL, LYING):
            await page.set_viewport_size(screen)  # type: ignore[arg-type]
            await page.keyboard.press("Escape")
            for place in ("0", "document.body.scrollHeight"):
                await page.evaluate(f"scrollTo(0, {place})")
                x, _ = await centre(stop(page))
                assert x == pytest.approx(screen["width"] / 2, abs=10)
                box = await stop(page).bounding_box()
                assert box is not None
                assert screen["height"] - 24 <= box["y"] + box["height"] <= screen["height"]
                assert box["height"] >= 48
                assert not await stop(page).evaluate(COVERED)
            assert await page.evaluate(CUT) == []
            await page.get_by_role("button", name="More about Cart-1", exact=True).click()
            assert not await stop(page).evaluate(COVERED)
