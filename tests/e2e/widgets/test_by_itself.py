"""What gives commands by itself until somebody ends it: STOP does, and so does a lost line."""

import asyncio
from collections.abc import Mapping
from typing import Any

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_text
from tests.e2e.motion.driving import STOP, centre, driven, fresh
from tests.e2e.widgets.inputs import Inputs, use
from urc.model.driver import Argument, Command
from urc.model.interface import WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Reading
from urc.protocol.events import Replied

pytestmark = pytest.mark.anyio

STICK = use("joystick")
PLAIN = {
    name: Command(name, "wire", WriteSpec("text"), title=name)
    for name in ("unlock", "fire", "ring")
}


class Slow(Inputs):
    """Its first command is under way until the test says that it is done."""

    def __init__(self, *uses: WidgetUse, **commands: Command) -> None:
        super().__init__(*uses, **{**PLAIN, **commands})
        self.done = asyncio.Event()

    async def command(self, name: str, arguments: Mapping[str, Reading], **how: Any) -> Replied:
        """Answer, `unlock` only when it is done."""
        replied = await super().command(name, arguments, **how)
        if name == "unlock":
            await self.done.wait()
        return replied


async def test_stop_ends_a_list_of_steps(new_page: PageMaker) -> None:
    """The step that was given is given; none comes after it, and the reason is told."""
    steps = WidgetUse("list", "sequence", {}, {"step_1": "unlock", "step_2": "fire"})
    slow = Slow(STICK, steps)
    async with driven(robot=slow) as (_, address):
        page = await fresh(new_page)
        await page.goto(address)
        await page.locator(".sequence-start:not([aria-disabled='true'], :disabled)").click()
        await until(lambda: slow.commands == [("unlock", {})])
        await page.click(STOP)
        await until_text(page, "[data-latched-text]", "■ Stopped by you")
        slow.done.set()
        await until_text(page, ".sequence-note", "▲ STOP was pressed")
        assert slow.commands == [("unlock", {})]


TUNE = Command("unlock", "wire", WriteSpec("text"), {"value": Argument("value", min=0, max=9)})


@pytest.mark.parametrize(
    ("widget", "control", "options"),
    [
        ("select", "select.select-list", {"choices": ["1", "2", "3"]}),
        ("slider", ".slider-track", {"step": 1}),
    ],
)
async def test_stop_ends_what_waits_for_the_robot(
    new_page: PageMaker, widget: str, control: str, options: Mapping[str, Any]
) -> None:
    """What was chosen while the robot was asked is not given after STOP; what is chosen then is."""
    key = "ArrowDown" if widget == "select" else "ArrowRight"
    slow = Slow(STICK, WidgetUse("tune", widget, {}, {"change": "unlock"}, options), unlock=TUNE)
    async with driven(robot=slow) as (_, address):
        page = await fresh(new_page)
        await page.goto(address)
        await page.wait_for_selector(f"{control}[aria-disabled='false']")
        await page.focus(control)
        await page.keyboard.press(key)
        await until(lambda: len(slow.commands) == 1)
        await page.keyboard.press(key)
        await asyncio.sleep(0.3)
        await page.keyboard.press("Escape")
        await until_text(page, "[data-latched-text]", "■ Stopped by you")
        slow.done.set()
        await page.wait_for_selector(f".{widget}[data-phase='done']")
        await asyncio.sleep(0.3)
        assert len(slow.commands) == 1
        await page.keyboard.press(key)
        await until(lambda: len(slow.commands) == 2)


async def repeating(new_page: PageMaker, robot: Inputs, address: str) -> Any:
    """Rest a finger on a button that repeats; return its page."""
    page = await fresh(new_page)
    await page.goto(address)
    await page.wait_for_selector(".button-main[aria-disabled='false']")
    await page.mouse.move(*await centre(page, ".button-main"))
    await page.mouse.down()
    await until(lambda: len(robot.commands) >= 3)
    return page


RING = WidgetUse("ring", "button", {}, {"press": "ring"}, {"gesture": "repeat", "repeat_ms": 50})


async def test_stop_ends_a_button_that_repeats(new_page: PageMaker) -> None:
    """However long the finger rests on it."""
    robot = Inputs(STICK, RING, **PLAIN)
    async with driven(robot=robot) as (_, address):
        page = await repeating(new_page, robot, address)
        await page.dispatch_event(STOP, "pointerdown", {"button": 0, "pointerId": 7})
        await until_text(page, "[data-latched-text]", "■ Stopped by you")
        count = len(robot.commands)
        await asyncio.sleep(0.5)
        assert len(robot.commands) == count


async def test_a_button_that_repeats_does_not_go_on_when_the_robot_is_back(
    new_page: PageMaker,
) -> None:
    """That takes a new press."""
    robot = Inputs(STICK, RING, **PLAIN)
    async with driven(robot=robot) as (_, address):
        page = await repeating(new_page, robot, address)
        robot.link("lost", "cable")
        await until_text(page, ".button-note", "◆ the robot is not connected")
        count = len(robot.commands)
        robot.link("live")
        await page.wait_for_selector(".button-main[aria-disabled='false']")
        await asyncio.sleep(0.5)
        assert len(robot.commands) == count
        await page.mouse.up()
        await page.mouse.down()
        await until(lambda: len(robot.commands) > count)


async def test_a_key_that_is_held_down_does_not_slide(new_page: PageMaker) -> None:
    """Its first press is one step; the other steps of the slide need a press each."""
    slide = WidgetUse("ring", "button", {}, {"press": "ring"}, {"gesture": "slide"})
    robot = Inputs(STICK, slide, **PLAIN)
    async with driven(robot=robot) as (_, address):
        page = await fresh(new_page)
        await page.goto(address)
        await page.wait_for_selector(".button-main[aria-disabled='false']")
        await page.focus(".button-main")
        for _ in range(35):
            await page.keyboard.down("ArrowRight")  # from the second on, it repeats
        await page.keyboard.up("ArrowRight")
        await expect(page.locator(".button-main")).to_have_attribute("aria-valuenow", "10")
        assert robot.commands == []
        for _ in range(9):
            await page.keyboard.press("ArrowRight")
        await until_text(page, ".button-note", "✓ sent")
        assert robot.commands == [("ring", {})]
