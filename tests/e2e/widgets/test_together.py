"""Two controls of one command, under two fingers."""

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until_attribute, until_text
from tests.e2e.motion.driving import centre, fingers_on, fire
from tests.e2e.widgets.inputs import PLAIN, shown, until_values, use
from urc.model.interface import OutputBinding

pytestmark = pytest.mark.anyio

SMALL = """
const sheet = new CSSStyleSheet();
sheet.replaceSync(".urc-cell { width: WIDTHpx; height: 13rem; min-height: 0 !important }");
document.adoptedStyleSheets.push(sheet);
"""
LEFT, RIGHT = "[data-cell='0'] .joystick-pad", "[data-cell='1'] .joystick-pad"


async def test_a_stick_of_one_axis_gives_nothing_for_the_other(new_page: PageMaker) -> None:
    """Also where that is bound by its name: the other stick goes on, and says what it gives."""
    left = use("joystick", axes="x", **PLAIN)
    right = use("joystick", axes="y", **PLAIN)
    right = right._replace(slot="right", given={"moved": OutputBinding({"turn": "y"})})
    async with shown(new_page, left, right, size="tablet") as (robot, page):
        hands = await fingers_on(page)
        (x, y), (other_x, other_y) = [await centre(page, one) for one in (LEFT, RIGHT)]
        await hands.put(0, x, y)
        await hands.put(0, x, y - 300)
        await until_values(robot, x=1.0)
        count = len(robot.line.texts)
        await hands.put(1, other_x, other_y)
        await hands.put(1, other_x - 300, other_y)
        await until_values(robot, x=1.0, turn=1.0)
        assert all("x=1" in text for text in robot.after(count)), robot.after(count)
        await until_text(page, "[data-cell='0'] .joystick-x", "forward 100 %")
        await hands.lift(0)
        await until_values(robot, turn=1.0)
        await hands.lift(1)
        await robot.until_stopped("go")


async def test_a_second_stick_on_the_same_command_changes_nothing_by_a_touch(
    new_page: PageMaker,
) -> None:
    """What one pushes is its own until it is let go; the other says that it gives nothing."""
    first = use("joystick", **PLAIN)
    second = use("joystick", **PLAIN)._replace(slot="second")
    async with shown(new_page, first, second, size="tablet") as (robot, page):
        hands = await fingers_on(page)
        (x, y), (other_x, other_y) = [await centre(page, one) for one in (LEFT, RIGHT)]
        await hands.put(0, x, y)
        await hands.put(0, x, y - 300)
        await until_values(robot, x=1.0)
        count = len(robot.line.texts)
        await hands.put(1, other_x, other_y)
        await hands.put(1, other_x - 300, other_y + 300)
        await until_values(robot, x=1.0, y=0.707)
        assert all("x=1" in text for text in robot.after(count)), robot.after(count)
        await until_text(page, "[data-cell='1'] .joystick-x", "")
        await until_text(page, "[data-cell='1'] .joystick-y", "left 71 %")
        await hands.lift(0)
        await until_values(robot, y=0.707)


@pytest.mark.parametrize("width", [170, 200])
async def test_a_reason_leaves_a_small_stick_where_it_is(new_page: PageMaker, width: int) -> None:
    """The thumb is still on it: its field neither shrinks nor moves."""
    stick = use("joystick", **PLAIN)
    async with shown(new_page, stick, size="phone") as (_, page):
        await fire(page, SMALL.replace("WIDTH", str(width)))
        await page.wait_for_function(
            f"() => document.querySelector('.urc-cell').clientWidth <= {width}"
        )
        hands = await fingers_on(page)
        await hands.put(0, *await centre(page, LEFT))
        await until_attribute(page, ".joystick", "data-phase", "held")
        before = await page.locator(LEFT).bounding_box()
        await fire(page, "window.dispatchEvent(new Event('blur'))")
        await until_text(page, ".joystick-note", "◆ the window lost focus")
        assert await page.locator(LEFT).bounding_box() == before
