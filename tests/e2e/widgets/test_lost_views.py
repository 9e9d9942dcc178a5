"""What the widgets that look at the world show of what has gone."""

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until_attribute, until_text
from tests.e2e.widgets.viewing import METRES, shown
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
        robot.say("front", 2.0)
        robot.say("around", (3.0, 2.0, 4.0))  # type: ignore[arg-type]
        robot.say("rear", 0.5, age_s=90)
        await until_text(page, f"{first}-text", "0.50")
        await until_attribute(page, first, "data-state", "stale")
        assert (await page.inner_text(f"{first}-note")).startswith("behind · ")
        walls = page.locator(f"{first}-wall")
        assert [await wall.get_attribute("data-state") for wall in await walls.all()] == [
            "live",
            "stale",
        ]
        robot.say("rear", 3.0, age_s=90)
        await page.locator(f"{first}-note", has_text="ahead · behind: ").wait_for()
        await until_attribute(page, first, "data-state", "live")
        robot.say("rear", 3.0, age_s=700)
        await page.locator(f"{first}-note", has_text="ahead · behind: last seen").wait_for()
        await until_text(page, f"{first}-text", "2.00")
        # Its three places stay theirs, so what stands to the right is still there.
        robot.say("rear", 1.0)
        robot.say("around", (3.0, 2.0, 4.0), age_s=700)  # type: ignore[arg-type]
        lost = page.locator(f"{second}-note", has_text="ahead, left, behind: last seen")
        await lost.wait_for()
        assert (await lost.inner_text()).startswith("right · ")
