"""Maps of ROS in a real browser: occupancy grids, paths, goals with a direction."""

import math
from collections.abc import Mapping
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.e2e.browser import choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.gallery import THEMES
from tests.e2e.motion.driving import centre
from tests.e2e.widgets.viewing import shown
from urc.model.driver import Argument, Command
from urc.model.interface import WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Signal
from urc.protocol.values.occupancy_grid import Grid, encode_grid
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

POSE: Mapping[str, Signal] = {
    "px": Signal("px", "number", unit="m", stale_after_s=60),
    "py": Signal("py", "number", unit="m", stale_after_s=60),
    "turned": Signal("turned", "number", unit="rad", stale_after_s=60),
    "floor": Signal("floor", "occupancy_grid", title="Floor", stale_after_s=86400),
}
AT = {"x": "px", "y": "py", "yaw": "turned"}


def told(name: str, *arguments: str) -> Command:
    """Return a command that is given once."""
    return Command(name, "wire", WriteSpec("text"), {each: Argument(each) for each in arguments})


def walls(side: int = 8) -> bytes:
    """Return a grid of 8 by 8 m at -4, -4: the left half is free, the right half is occupied,
    and the upper quarter is unknown."""
    row = bytes(side // 2) + bytes((100,)) * (side // 2)
    cells = row * (side * 3 // 4) + bytes((255,)) * side * (side // 4)
    return encode_grid(Grid(side, side, 8 / side, -4.0, -4.0, 0.0, "map", cells))


async def colours(page: Page, *points: tuple[float, float]) -> list[tuple[int, ...]]:
    """Return the colours of the grid's canvas at shares of its width and height."""
    found = await page.evaluate(
        """(points) => {
          const canvas = document.querySelector(".map-grid");
          const copy = new OffscreenCanvas(canvas.width, canvas.height);
          const pen = copy.getContext("2d");
          pen.drawImage(canvas, 0, 0);
          return points.map(([x, y]) => [
            ...pen.getImageData(x * canvas.width, y * canvas.height, 1, 1).data,
          ]);
        }""",
        points,
    )
    return [tuple(one) for one in found]


async def drag(page: Page, start: tuple[float, float], by: tuple[float, float]) -> None:
    await page.mouse.move(*start)
    await page.mouse.down()
    await page.mouse.move(start[0] + by[0] / 2, start[1] + by[1] / 2)
    await page.mouse.move(start[0] + by[0], start[1] + by[1])
    await page.mouse.up()


async def test_a_page_opened_later_shows_the_map_that_was_sent_once(new_page: PageMaker) -> None:
    """In all themes, free, occupied and unknown cells differ."""
    profile = dashboard_profile(
        signals=POSE, uses=[WidgetUse("m", "map", {}, lists={"grids": ("floor",)})]
    )
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        first = await new_page(size="desktop")
        await first.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("floor", walls(), age_s=3600)
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until_text(page, ".map-text", "8.0 × 8.0 m")
        await until_text(page, ".map-note", "")
        for theme in THEMES:
            await choose_theme(page, theme)

            async def differ() -> bool:
                free, full = await colours(page, (0.43, 0.66), (0.57, 0.66))
                far = sum(abs(one - other) for one, other in zip(free, full, strict=True))
                return free[3] == full[3] == 255 and far > 150

            for _ in range(50):
                if await differ():
                    break
                await page.wait_for_timeout(100)
            assert await differ(), theme
            # An unknown cell has no colour of its own; lines of the hatching cross it.
            points = [(0.40 + step / 1000, 0.131) for step in range(60)]
            opacities = {one[3] for one in await colours(page, *points)}
            assert min(opacities) == 0, theme
            assert max(opacities) > 0, theme


async def test_a_new_map_replaces_the_old_one_and_a_bad_one_is_named(new_page: PageMaker) -> None:
    use = WidgetUse("m", "map", AT, lists={"grids": ("floor",)})
    page = await new_page(size="desktop")
    async with shown(page, POSE, use) as robot:
        for name, value in (("px", 0.0), ("py", 0.0), ("turned", 0.0)):
            robot.set_reading(name, value)
        await until_text(page, ".map-note", "Floor: no value yet")
        robot.set_reading("floor", walls())
        await until_text(page, ".map-note", "")
        robot.set_reading("floor", b"\x89PNG\r\n\x1a\n and no more")
        await until_text(page, ".map-note", "Floor: ▲ this picture cannot be shown")
        robot.set_reading("floor", walls(4))
        await until_text(page, ".map-note", "")
        await page.get_by_role("button", name="Zoom in").click()
        await page.get_by_role("button", name="Show the whole map").click()
        follower = page.get_by_role("button", name="Follow the robot")
        await expect(follower).to_have_attribute("aria-pressed", "false")


async def test_a_goal_has_a_direction(new_page: PageMaker) -> None:
    """Press, drag, let go; nothing is sent before the operator has confirmed it."""
    use = WidgetUse("m", "map", AT, {"goto": "go", "initial_pose": "put"})
    commands = {"go": told("go", "x", "y", "yaw"), "put": told("put", "x", "y", "yaw")}
    page = await new_page(size="desktop")
    async with shown(page, POSE, use, commands=commands) as robot:
        for name, value in (("px", 1.0), ("py", 2.0), ("turned", 0.5)):
            robot.set_reading(name, value)
        await until_text(page, ".map-text", "x 1.00 m, y 2.00 m")
        x, y = await centre(page, ".map-area")
        aim = page.get_by_role("button", name="Goal with a direction")
        await aim.click()
        await until_text(page, ".map-words", "Press on the place, and drag in the direction.")
        await drag(page, (x + 64, y - 32), (0, -100))
        await expect(page.locator(".map-words")).to_contain_text("∠ 90°?")
        await page.get_by_role("button", name="Turn left by 15°").click()
        await expect(page.locator(".map-words")).to_contain_text("∠ 105°")
        await until_text(page, ".map-text", "x 1.00 m, y 2.00 m")
        assert robot.commands == []
        await page.get_by_role("button", name="Go there").click()
        await until(lambda: len(robot.commands) == 1)
        name, given = robot.commands[0]
        goal: Any = given
        assert name == "go"
        assert (goal["x"], goal["y"]) == pytest.approx((3.0, 3.0), abs=0.1)
        assert goal["yaw"] == pytest.approx(math.radians(105), abs=1e-3)
        await until_text(page, ".map-words", "✓ sent")
        await expect(aim).to_have_attribute("aria-pressed", "false")

        await page.get_by_role("button", name="Set the robot's position").click()
        await drag(page, (x, y), (60, 0))
        await expect(page.locator(".map-words")).to_contain_text("Is the robot at x 1.00 m")
        await page.get_by_role("button", name="It is here").click()
        await until(lambda: len(robot.commands) == 2)
        assert robot.commands[1][0] == "put"
        assert robot.commands[1][1]["yaw"] == pytest.approx(0.0, abs=1e-3)  # type: ignore[comparison-overlap]


async def test_a_goal_by_keys_faces_along_the_way_and_escape_sends_nothing(
    new_page: PageMaker,
) -> None:
    use = WidgetUse("m", "map", AT, {"goto": "go"})
    page = await new_page(size="desktop")
    async with shown(page, POSE, use, commands={"go": told("go", "x", "y", "yaw")}) as robot:
        for name, value in (("px", 0.0), ("py", 0.0), ("turned", 3.0)):
            robot.set_reading(name, value)
        await until_text(page, ".map-text", "x 0.00 m, y 0.00 m")
        x, y = await centre(page, ".map-area")
        await page.mouse.click(x, y - 64)
        await expect(page.locator(".map-words")).to_contain_text("∠ 90°")
        await page.locator(".map-area").focus()
        await page.keyboard.press("Escape")
        await until_attribute(page, ".map", "data-mode", "look")
        await page.get_by_role("button", name="Goal with a direction").click()
        await page.locator(".map-area").focus()
        await page.keyboard.press("Escape")
        await expect(page.locator(".map")).not_to_have_attribute("data-aim", "goto")
        # The map moves again under a drag.
        await drag(page, (x, y), (80, 0))
        follower = page.get_by_role("button", name="Follow the robot")
        await expect(follower).to_have_attribute("aria-pressed", "false")
        assert robot.commands == []
