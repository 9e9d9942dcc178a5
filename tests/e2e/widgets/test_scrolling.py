"""A finger that scrolls a phone's page begins on controls, and sets none of them."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_text
from tests.e2e.motion.driving import SEND, Fingers, centre, drawn, driven, fingers_on, fire, fresh
from tests.e2e.verdict import judged
from tests.e2e.widgets.inputs import Inputs
from urc.model.driver import Argument, Command
from urc.model.interface import WidgetUse

pytestmark = pytest.mark.anyio

TO_10 = Argument("value", min=0.0, max=10.0)
PUT = Command("put", "wire", SEND, {"value": TO_10})
RING = Command("ring", "wire", SEND)
STAGE = "document.querySelector('[data-stage]')"
"""The part of the page that scrolls."""
HIGH = """
const sheet = new CSSStyleSheet();
sheet.replaceSync(".urc-cell { min-height: 20rem !important }");
document.adoptedStyleSheets.push(sheet);
"""
"""Room for all of a control: only the page is to be scrolled."""
REST_MS = 500
"""So long a finger rests that means the knob under it."""
QUICK_MS = 90
"""One that rests for longer presses a button that repeats."""
TOUCHES = """
window.times = [];
for (const name of ["pointerdown", "pointermove", "pointercancel"]) {
  addEventListener(name, () => times.push(performance.now()), { capture: true });
}
"""
"""The browser cancels a touch as soon as the page scrolls with it."""


@asynccontextmanager
async def phone(
    new_page: PageMaker, widget: str, output: str, **options: Any
) -> AsyncIterator[tuple[Inputs, Page, Fingers]]:
    """Show a control on a phone, with more below it than there is room for."""
    command = PUT if output == "change" else RING
    one = WidgetUse("one", widget, {}, {output: command.name}, options)
    rest = [WidgetUse(f"log{place}", "log") for place in range(4)]
    robot = Inputs(one, *rest, put=PUT, ring=RING)
    async with driven(robot=robot) as (_, address):
        page = await fresh(new_page, "phone")
        page.set_default_timeout(8000)
        await page.goto(address)
        await ready(page)
        yield robot, page, await fingers_on(page)


async def ready(page: Page) -> None:
    """Wait until the page can be scrolled, and its control can be used."""
    await fire(page, HIGH)
    await page.wait_for_function(
        f"() => {STAGE}.scrollHeight > {STAGE}.clientHeight"
        " && document.querySelector('[data-cell=\"0\"] [aria-disabled=false]')"
    )


class Swipe(NamedTuple):
    """Result of one swipe over a control."""

    rested_ms: float
    is_same: bool
    """Whether the control shows the same value as before."""
    commands: list[Any]
    """Commands that the robot got."""

    @property
    def is_good(self) -> bool:
        """Whether nothing was set."""
        return self.is_same and not self.commands

    @property
    def is_excused(self) -> bool:
        """Whether a busy machine was so slow with the swipe that the finger rested."""
        return self.rested_ms >= QUICK_MS


async def swipe(page: Page, hands: Fingers, selector: str, right: float, up: float) -> float:
    """Put a finger on an element, draw it so far, and lift it.

    Returns:
        How long the page took it for one that may rest there, in ms.
    """
    x, y = await centre(page, selector)
    await fire(page, TOUCHES)
    await hands.put(0, x, y)
    for step in range(1, 11):
        await hands.put(0, x + right * step / 10, y - up * step / 10)
    await hands.lift(0)
    rested_ms: float = await page.evaluate("times[times.length - 1] - times[0]")
    return rested_ms


@pytest.mark.parametrize(
    ("widget", "output", "selector", "options"),
    [
        ("slider", "change", ".slider-track", {}),
        ("knob", "change", ".knob-dial", {}),
        ("button", "press", ".button-main", {"gesture": "repeat"}),
        ("button", "press", ".button-main", {"gesture": "hold"}),
    ],
    ids=["slider", "knob", "repeat", "hold"],
)
async def test_a_swipe_scrolls_the_page_and_sets_nothing(
    new_page: PageMaker, widget: str, output: str, selector: str, options: dict[str, Any]
) -> None:
    """Neither is anything shown as if it had been set."""
    async with phone(new_page, widget, output, **options) as (robot, page, hands):
        before = await page.inner_text(f".{widget}")
        swipes: list[Swipe] = []
        while not judged(swipes, 1):
            if swipes:
                await page.reload()
                await ready(page)
                robot.commands.clear()
            rested_ms = await swipe(page, hands, selector, 5, 150)
            if rested_ms < QUICK_MS:
                await page.wait_for_function(f"() => {STAGE}.scrollTop > 50")
            is_same = await page.inner_text(f".{widget}") == before
            swipes.append(Swipe(rested_ms, is_same, list(robot.commands)))
        await hands.put(0, *await centre(page, selector))
        if output == "change":
            await hands.lift(0)
        await until(lambda: robot.commands != [])


async def test_a_finger_sets_a_slider_by_a_tap_and_along_its_axis(new_page: PageMaker) -> None:
    """The page stays where it is, also when the finger leaves the axis on its way."""
    async with phone(new_page, "slider", "change", step=1) as (robot, page, hands):
        box = await page.locator(".slider-track").bounding_box()
        assert box is not None
        middle = box["y"] + box["height"] / 2
        await hands.put(0, box["x"] + 0.3 * box["width"], middle)
        await drawn(page)
        assert robot.commands == [], "nobody knows yet what the finger wants"
        await hands.lift(0)
        await until(lambda: robot.commands == [("put", {"value": 3})])
        await hands.put(0, box["x"] + 0.3 * box["width"], middle)
        for step in range(4, 8):
            await hands.put(0, box["x"] + step / 10 * box["width"], middle)
        await until_text(page, ".slider-text", "7")
        await hands.put(0, box["x"] + 0.8 * box["width"], middle - 100)
        await until_text(page, ".slider-text", "8")
        await hands.lift(0)
        await until(lambda: robot.commands[-1] == ("put", {"value": 8}))
        assert await page.evaluate(f"{STAGE}.scrollTop") == 0


async def test_a_finger_turns_a_knob_that_it_began_sideways_or_had_rested_on(
    new_page: PageMaker,
) -> None:
    """Then it goes any way, and the page stays where it is."""
    async with phone(new_page, "knob", "change", step=1) as (robot, page, hands):
        x, y = await centre(page, ".knob-dial")
        await hands.put(0, x, y)
        await hands.put(0, x + 30, y)
        await hands.put(0, x + 30, y - 100)
        await hands.lift(0)
        await until(lambda: ("put", {"value": 6}) in robot.commands[-1:])
        count = len(robot.commands)
        await hands.put(0, x + 60, y + 20)
        await fire(page, f"new Promise((done) => setTimeout(done, {REST_MS}))")
        await hands.put(0, x + 60, y - 30)
        await hands.put(0, x + 60, y - 60)
        await hands.lift(0)
        await until(lambda: len(robot.commands) > count)
        assert await page.evaluate(f"{STAGE}.scrollTop") == 0
