"""Vectors and paths that are drawn, in a real browser, and what the robot is told of them."""

from collections.abc import Mapping, Sequence
from typing import Literal

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_attribute, until_text
from tests.e2e.motion.driving import (
    SEND,
    fire,
)
from tests.e2e.widgets.inputs import drag, shown, use
from urc.model.driver import Argument, Command
from urc.testing.dashboard import FakeRobot

pytestmark = pytest.mark.anyio


def told(*names: str, kind: Literal["number", "array"] = "number") -> Command:
    """Return a command that takes these arguments, and is not held."""
    return Command("told", "wire", SEND, {name: Argument(name, kind) for name in names})


async def until_told(robot: FakeRobot, *said: Mapping[str, object]) -> None:
    """Wait until exactly these were given, in this order."""
    await until(lambda: [values for _, values in robot.commands] == list(said))


async def test_a_vector_is_sent_when_it_is_let_go_or_by_the_button(new_page: PageMaker) -> None:
    """Cut to the longest; a tap shows it first; what was taken from the hand sends nothing."""
    pad = use("vector-pad", "told", length=4.0)
    async with shown(new_page, pad, told=told("dx", "dy")) as (robot, page):
        await until_attribute(page, ".vector-pad", "data-phase", "idle")
        await drag(page, ".vector-pad-field", 0, 600)
        await until_text(page, ".vector-pad-value", "4.00 m · 0°")
        await page.mouse.up()
        await until_told(robot, {"dx": 4, "dy": 0})
        await until_text(page, ".vector-pad-note", "✓ sent")
        await drag(page, ".vector-pad-field", 50, 0)
        await fire(page, "dispatchEvent(new Event('blur'))")
        await until_attribute(page, ".vector-pad", "data-phase", "idle")
        await page.mouse.up()
        box = await page.locator(".vector-pad-face").bounding_box()
        assert box is not None
        await page.mouse.click(box["x"] + 2, box["y"] + box["height"] / 2)
        await until_text(page, ".vector-pad-value", "4.00 m · 90° to the left")
        assert len(robot.commands) == 1, "a tap shows it only"
        await page.get_by_role("button", name="Go").click()
        await until_told(robot, {"dx": 4, "dy": 0}, {"dx": 0, "dy": 4})
        await until_text(page, ".vector-pad-note", "✓ sent")
        await page.focus(".vector-pad-field")
        await page.keyboard.press("ArrowUp")
        await page.keyboard.press("Enter")
        await until(lambda: robot.commands[-1] == ("told", {"dx": 0.4, "dy": 0}))
    async with shown(new_page, pad, told=told("heading", "distance")) as (robot, page):
        await until_attribute(page, ".vector-pad", "data-phase", "idle")
        await drag(page, ".vector-pad-field", -600, 0)
        await page.mouse.up()
        await until_told(robot, {"heading": 1.5708, "distance": 4})


def points_of(robot: FakeRobot) -> list[float]:
    """Return the path that the robot was told last."""
    points = robot.commands[-1][1]["points"]
    assert isinstance(points, Sequence)
    return [float(one) for one in points if isinstance(one, (int, float))]


async def test_a_path_is_looked_at_before_it_is_sent(new_page: PageMaker) -> None:
    """Drawn or tapped, simplified, and given as the command takes it; cancelled it is gone."""
    pad = use("path-pad", "told", length=10.0)
    async with shown(new_page, pad, told=told("points", kind="array")) as (robot, page):
        await until_attribute(page, ".path-pad", "data-phase", "idle")
        await drag(page, ".path-pad-field", 0, 600)
        await page.mouse.up()
        await until_text(page, ".path-pad-value", "2 points · 10.00 m")
        await page.get_by_role("button", name="Cancel").click()
        await until_attribute(page, ".path-pad", "data-phase", "idle")
        assert robot.commands == []
        await drag(page, ".path-pad-field", 0, 600)
        await page.mouse.up()
        box = await page.locator(".path-pad-face").bounding_box()
        assert box is not None
        await page.mouse.click(box["x"] + box["width"] - 1, box["y"] + 1)
        await page.get_by_role("button", name="Send").click()
        await until(lambda: len(robot.commands) == 1)
        assert points_of(robot) == pytest.approx([0, 0, 10, 0, 10, -10], abs=0.05)
        await until_text(page, ".path-pad-note", "✓ sent")
        await page.focus(".path-pad-field")
        for key in ("ArrowUp", "Enter", "ArrowLeft", "ArrowLeft", "Enter"):
            await page.keyboard.press(key)
        await page.get_by_role("button", name="Send").click()
        await until(lambda: len(robot.commands) == 2)
        assert points_of(robot) == [0.5, 0, 0.5, 1]
