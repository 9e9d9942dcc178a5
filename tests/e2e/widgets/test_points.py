"""Point clouds in a real browser: colours, ages, other files, and many points at a steady rate."""

import asyncio
import random
from collections.abc import Mapping

import pytest
from playwright.async_api import expect

from tests.e2e.browser import choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until_text
from tests.e2e.gallery import THEMES
from tests.e2e.widgets.viewing import shown
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.protocol.values.point_cloud import encode_cloud, packed_cloud

pytestmark = pytest.mark.anyio

CLOUD: Mapping[str, Signal] = {
    "cloud": Signal("cloud", "point_cloud", title="Points", stale_after_s=60)
}
MANY = 20_000
PERIOD_S = 0.1
CLOUDS = 20


def use(**options: object) -> WidgetUse:
    return WidgetUse("scene", "scene3d", {"cloud": "cloud"}, options={"view": "top", **options})


def wall(low: float, high: float, count: int = 400) -> bytes:
    """Return a wall across the view, from the left to the right, whose intensity rises with y."""
    share = [at / (count - 1) for at in range(count)]
    columns = {
        "x": [0.5 if at % 2 else 0.4 for at in range(count)],
        "y": [low + (high - low) * one for one in share],
        "z": [1.0 - one for one in share],
        "intensity": [100 * one for one in share],
    }
    return encode_cloud(packed_cloud("base_link", "intensity", count, columns))


async def test_points_are_drawn_in_the_colours_of_each_theme(new_page: PageMaker) -> None:
    page = await new_page(size="desktop")
    async with shown(page, CLOUD, use()) as robot:
        robot.set_reading("cloud", wall(1.0, -1.0))
        scene = page.locator(".scene3d")
        await expect(scene).to_have_attribute("data-points", "400")
        await until_text(page, ".scene3d-text", "points: 400")
        pictures = set()
        for theme in THEMES:
            await choose_theme(page, theme)
            await page.wait_for_timeout(300)
            pictures.add(await page.locator(".scene3d-face").screenshot())
        assert len(pictures) == len(THEMES)


async def test_the_height_can_determine_the_colours(new_page: PageMaker) -> None:
    """The intensity rises where the height falls, so the pictures differ."""
    pictures = []
    for colour in ("field", "height"):
        page = await new_page(size="desktop")
        async with shown(page, CLOUD, use(colour=colour)) as robot:
            robot.set_reading("cloud", wall(1.0, -1.0))
            await expect(page.locator(".scene3d")).to_have_attribute("data-points", "400")
            await page.wait_for_timeout(300)
            pictures.append(await page.locator(".scene3d-face").screenshot())
    assert pictures[0] != pictures[1]


async def test_another_file_is_named_and_removes_the_points(new_page: PageMaker) -> None:
    page = await new_page(size="desktop")
    async with shown(page, CLOUD, use()) as robot:
        scene = page.locator(".scene3d")
        robot.set_reading("cloud", wall(1.0, -1.0))
        await expect(scene).to_have_attribute("data-points", "400")
        robot.set_reading("cloud", b"no cloud")
        await until_text(page, ".scene3d-note", "▲ not a point cloud")
        assert await scene.get_attribute("data-points") is None
        robot.set_reading("cloud", wall(1.0, -1.0, 100))
        await expect(scene).to_have_attribute("data-points", "100")
        robot.set_reading("cloud", wall(1.0, -1.0), age_s=3600)
        await expect(scene).not_to_have_attribute("data-points", "100")


async def test_twenty_thousand_points_ten_times_a_second_are_drawn_without_a_backlog(
    new_page: PageMaker,
) -> None:
    dice = random.Random(3)  # noqa: S311 - the same points in every run
    columns = {name: [dice.uniform(-2, 2) for _ in range(MANY)] for name in ("x", "y", "z", "i")}
    clouds = [
        encode_cloud(packed_cloud("base_link", "i", MANY, {**columns, "x": columns[name]}))
        for name in ("x", "y")
    ]
    page = await new_page(size="desktop")
    async with shown(page, CLOUD, use(view="orbit")) as robot:
        robot.set_reading("cloud", clouds[0])
        await expect(page.locator(".scene3d")).to_have_attribute("data-points", str(MANY))
        drawn = "Number(document.querySelector('.scene3d-picture').dataset.frames)"
        before = await page.evaluate(drawn)
        for count in range(CLOUDS):
            robot.set_reading("cloud", clouds[count % 2])
            await asyncio.sleep(PERIOD_S)
        robot.set_reading("cloud", wall(1.0, -1.0, 100))
        await expect(page.locator(".scene3d")).to_have_attribute("data-points", "100")
        assert await page.evaluate(drawn) > before
