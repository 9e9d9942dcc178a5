"""The tree of coordinate frames on a page: ages, old transforms, and a second publisher."""

from typing import Any

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

SIGNALS = {"frames": Signal("frames", "transform_tree", title="Transforms", stale_after_s=60)}
TREE = WidgetUse("tree", "transforms", {"tree": "frames"}, {}, {"filter": True})
FLAT = (0.0, 0.0, 0.0, 1.0)


def frame(name: str, parent: str, depth: int, age: float | None, **more: Any) -> dict[str, Any]:
    place = {"translation": (1.0, 2.0, 0.0), "rotation": FLAT}
    return {"name": name, "parent": parent, "depth": depth, "age": age, **place, **more}


def value(age: float, **more: Any) -> dict[str, Any]:
    return {
        "frames": (
            {"name": "map", "parent": "", "depth": 0},
            frame("odom", "map", 1, age),
            frame("base_link", "odom", 2, 0.1, **more),
            frame("laser", "base_link", 3, None),
        )
    }


async def test_old_transforms_are_marked_and_live_ones_are_not(new_page: PageMaker) -> None:
    robot = FakeRobot(dashboard_profile(signals=SIGNALS, uses=(TREE,)))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("frames", value(0.2))
        row = ".transforms-body tr:nth-child({})"
        await until_text(page, f"{row.format(4)} td:nth-child(2)", "static")
        await until_text(page, f"{row.format(2)} td:nth-child(2)", "< 1 s")
        await until_attribute(page, row.format(2), "data-age", "live")
        await until_text(page, ".transforms-count", "")
        robot.set_reading("frames", value(7.5))
        await until_text(page, f"{row.format(2)} td:nth-child(2)", "◌ 7 s")
        await until_attribute(page, row.format(2), "data-age", "old")
        await until_attribute(page, row.format(3), "data-age", "live")
        await until_text(page, ".transforms-count", "1 old")
        robot.set_reading("frames", value(0.2, other_parent="map"))
        await until_text(page, f"{row.format(3)} td:nth-child(1)", "base_link ◆ also below map")
        await until_text(page, ".transforms-count", "◆ 1 with two parents")
        await page.fill(".transforms-filter", "laser")
        await page.wait_for_function(
            "() => document.querySelectorAll('.transforms-body tr').length === 1"
        )
        await page.fill(".transforms-filter", "nothing has this")
        await until_text(page, ".transforms-body td", "no row matches the filter")
