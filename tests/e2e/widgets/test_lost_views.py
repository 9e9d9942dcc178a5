"""What the widgets that look at the world show of what has gone."""

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until_attribute, until_text
from tests.e2e.gallery import coarse
from tests.e2e.widgets.viewing import METRES, RESTED, shown
from urc.model.interface import WidgetUse
from urc.model.values import Signal

pytestmark = pytest.mark.anyio


async def test_a_sensor_that_says_nothing_looks_dead(new_page: PageMaker) -> None:
    """An old distance is no live one, and where nobody looks any more is said."""
    around = Signal("around", "array", unit="m", stale_after_s=60)
    ring = {"view": "ring", "max": 5}
    uses = (
        WidgetUse("r", "range", {"range": "front"}, options=ring, lists={"others": ("rear",)}),
        WidgetUse("a", "range", {"range": "around"}, options=ring, lists={"others": ("rear",)}),
    )
    page = await new_page(size="tablet")
    async with shown(page, {**METRES, "around": around}, *uses) as robot:
        first, second = (f"[data-cell='{place}'] .range" for place in (0, 1))
        robot.set_reading("front", 2.0)
        robot.set_reading("around", (3.0, 2.0, 4.0))  # type: ignore[arg-type]
        robot.set_reading("rear", 0.5, age_s=90)
        await until_text(page, f"{first}-text", "0.50")
        await until_attribute(page, first, "data-state", "stale")
        assert (await page.inner_text(f"{first}-note")).startswith("behind · ")
        walls = page.locator(f"{first}-wall")
        assert [await wall.get_attribute("data-state") for wall in await walls.all()] == [
            "live",
            "stale",
        ]
        robot.set_reading("rear", 3.0, age_s=90)
        await page.locator(f"{first}-note", has_text="ahead · behind: ").wait_for()
        await until_attribute(page, first, "data-state", "live")
        robot.set_reading("rear", 3.0, age_s=700)
        await page.locator(f"{first}-note", has_text="ahead · behind: seen").wait_for()
        await until_text(page, f"{first}-text", "2.00")
        # Its three places stay theirs, so what stands to the right is still there.
        robot.set_reading("rear", 1.0)
        robot.set_reading("around", (3.0, 2.0, 4.0), age_s=700)  # type: ignore[arg-type]
        lost = page.locator(f"{second}-note", has_text="ahead, left, behind: seen")
        await lost.wait_for()
        assert (await lost.inner_text()).startswith("right · ")


def apart(one: list[list[int]], other: list[list[int]]) -> int:
    """Return how far two pictures are apart where they differ most, 0 to 255."""
    pairs = zip(one, other, strict=True)
    return max(abs(a - b) for row, beside in pairs for a, b in zip(row, beside, strict=True))


async def look(page: Page) -> list[list[int]]:
    """Return how the scene looks; in colour whatever its state: only what is drawn differs."""
    await page.wait_for_selector(".scene3d[data-model='box']")
    await page.eval_on_selector(
        ".scene3d-picture", "(el) => (el.style = 'filter: none; opacity: 1')"
    )
    await page.evaluate(RESTED)
    return (await coarse(page, [".scene3d-picture"]))[0]


async def test_points_that_have_gone_are_not_drawn(new_page: PageMaker) -> None:
    """The scene is then as it was before there were any; the next points are drawn."""
    signals = {"seen": Signal("seen", "array", items="number", unit="m", stale_after_s=60)}
    use = WidgetUse("s", "scene3d", {"points": "seen"}, options={"view": "top"})
    steps = [0.004 * place for place in range(-20, 21)]
    plane = tuple(part for x in steps for y in steps for part in (x, y, 1.0))
    page = await new_page(size="desktop")
    async with shown(page, signals, use) as robot:
        before = await look(page)
        robot.set_reading("seen", plane)  # type: ignore[arg-type]
        await until_attribute(page, ".scene3d", "data-state", "live")
        full = await look(page)
        assert apart(before, full) > 20
        robot.set_reading("seen", None)
        await until_attribute(page, ".scene3d", "data-state", "none")
        assert apart(before, await look(page)) < 5
        robot.set_reading("seen", plane)  # type: ignore[arg-type]
        await until_attribute(page, ".scene3d", "data-state", "live")
        assert apart(full, await look(page)) < 5


async def test_a_pose_that_is_not_known_stays_as_it_was_last(new_page: PageMaker) -> None:
    """It does not stand up straight because an angle is missing; its words say nothing then."""
    tilt = {name: Signal(name, "number", unit="rad", stale_after_s=60) for name in ("r", "p")}
    use = WidgetUse("s", "scene3d", {"roll": "r", "pitch": "p"})
    page = await new_page(size="desktop")
    async with shown(page, tilt, use) as robot:
        robot.set_reading("r", 0.0)
        robot.set_reading("p", 0.0)
        await until_text(page, ".scene3d-text", "level")
        level = await look(page)
        robot.set_reading("r", 0.7)
        robot.set_reading("p", -0.4)
        await until_text(page, ".scene3d-text", "right side down 40° · nose up 23°")
        tilted = await look(page)
        assert apart(level, tilted) > 20
        robot.set_reading("p", -0.4, age_s=700)
        await until_text(page, ".scene3d-text", "—")
        await until_attribute(page, ".scene3d", "data-pose", "unknown")
        assert apart(tilted, await look(page)) < 15  # its note has a line more
