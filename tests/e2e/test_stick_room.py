"""Sticks of plain grids are whole on each screen, and an alarm moves no control."""

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import (
    is_on_top,
    turned,
)
from tests.e2e.motion.driving import (
    CALM_LEASE_S,
    USES,
    Wire,
    commands,
    driven,
    push,
)
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.values import AlarmAttributes, AlarmLimits, Signal
from urc.testing.dashboard import dashboard_profile

pytestmark = pytest.mark.anyio

PHONE, PHONE_LYING, TABLET, DESKTOP = (390, 844), (844, 390), (820, 1180), (1440, 900)


SCREENS_WITH_STICKS = ((1280, 720), (1280, 800), (1440, 900), TABLET, (1180, 820), PHONE_LYING)
BATTERY_LOW = Signal(
    "a", title="Battery of the robot", unit="%", stale_after_s=60,
    limits=AlarmLimits(
        low=20, attributes=(("low", AlarmAttributes("high", "It is used.", "Dock the robot now.")),)
    ),
)  # fmt: skip
PLACES = """() => [...document.querySelectorAll(
    "[data-stop-button], .urc-cell, .joystick-face, .joystick-pad, .hold-button, .urc-speed")]
    .filter((el) => el.checkVisibility()).map((el) => {
        const { x, y, width, height } = el.getBoundingClientRect();
        return [el.className, x, y, width, height].join(" ");
    })"""


def alarming(*rows: str, **options: str) -> Wire:
    """Return a robot with values, sticks `left` and `right` and a button `up`, in a plain grid."""
    robot = Wire(lease_s=CALM_LEASE_S)
    names = sorted({name for line in rows for name in line.split()} - {".", "left", "right", "up"})
    signals = {name: Signal(name, stale_after_s=60) for name in names} | {"a": BATTERY_LOW}
    uses = [*USES, *(WidgetUse(name, "value", {"value": name}) for name in names)]
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands(CALM_LEASE_S))
    interface = Interface("x", "X", {"landscape": drawn(*rows)}, **options)
    robot.profile = profile._replace(interfaces={"x": interface})
    return robot


def drawn(*rows: str) -> Layout:
    """Return the grid of these lines; a name in neighbouring cells is one slot."""
    cells = [line.split() for line in rows]
    places: dict[str, list[tuple[int, int]]] = {}
    for row_number, names in enumerate(cells):
        for column_number, name in enumerate(names):
            if name != ".":
                places.setdefault(name, []).append((row_number, column_number))
    slots = []
    for name, found in places.items():
        (top, start), (bottom, end) = found[0], found[-1]
        slots.append(Slot(name, top, start, bottom - top + 1, end - start + 1))
    return Layout(len(cells), len(cells[0]), tuple(slots))


@pytest.mark.parametrize(
    "rows",
    [
        ("a b c d", "e f . .", ". . left left"),
        ("a b c d", "e f g h", "up . left left"),
        ("a b", "c left"),
        ("a b c", "d e f", "g h i", "right . left"),
        ("a b", "c left", "d left"),
        ("left a right",),
    ],
)
async def test_a_stick_of_a_plain_grid_is_wholly_visible_without_scrolling(
    new_page: PageMaker, rows: tuple[str, ...]
) -> None:
    """It is under no other widget, and above the lower edge, also during an alarm."""
    robot = alarming(*rows)
    async with driven(robot=robot) as (_, address):
        page = await new_page()
        await page.goto(address)
        await expect(page.locator(".joystick").first).to_have_attribute("data-phase", "idle")
        robot.set_reading("a", 10, alarm="low")
        await page.locator("[data-alarm-strip]").wait_for()
        wrong = {}
        for size in SCREENS_WITH_STICKS:
            await turned(page, size)
            wrong[size] = await page.evaluate(STICKS_IN_SIGHT)
        assert not any(wrong.values()), wrong


STICKS_IN_SIGHT = """() => {
    const faults = [];
    const faces = [...document.querySelectorAll(".joystick-face, .hold-button")].filter(
        (el) => el.checkVisibility());
    if (faces.length === 0) faults.push("no stick is shown");
    for (const face of faces) {
        const { left, top, right, bottom, width, height } = face.getBoundingClientRect();
        const isSmall = face.matches(".joystick-face") && Math.min(width, height) < 143;
        if (isSmall) faults.push(`${width} x ${height} px`);
        if (bottom > innerHeight + 1) faults.push(`ends at ${bottom}`);
        const middle = [(left + right) / 2, (top + bottom) / 2];
        for (const [x, y] of [middle, [middle[0], top + 4], [middle[0], bottom - 4],
            [left + 4, middle[1]], [right - 4, middle[1]]]) {
            const met = document.elementFromPoint(x, y)?.closest(
                ".urc-cell, .urc-controls, .urc-alarm-strip");
            if (met === face.closest(".urc-cell")) continue;
            faults.push(`${met?.className} is over ${x}, ${y}`);
        }
    }
    return faults;
}"""


@pytest.mark.parametrize("background", ["", "b"])
async def test_an_alarm_moves_no_control(new_page: PageMaker, background: str) -> None:
    """Its strip appears while a stick is held; its text is whole, and STOP is not covered."""
    robot = alarming("a b c", "up d left", background=background)
    async with driven(robot=robot) as (_, address):
        page = await new_page()
        await page.goto(address)
        await expect(page.locator(".joystick").first).to_have_attribute("data-phase", "idle")
        for size in (PHONE, (320, 568), (1280, 720), PHONE_LYING):
            await turned(page, size)
            # A phone in portrait stacks a plain grid, and scrolls.
            await page.eval_on_selector(
                ".joystick-pad", "(el) => el.scrollIntoView({ block: 'center' })"
            )
            await push(page, ".joystick-pad")
            await robot.until_moving()
            before = await page.evaluate(PLACES)
            robot.set_reading("a", 10, alarm="low")
            await page.locator("[data-alarm-strip]").wait_for()
            assert await page.evaluate(PLACES) == before, size
            assert await is_on_top(page, "[data-stop-button]"), size
            assert await is_on_top(page, "[data-alarm-seen]"), size
            assert await page.evaluate(CUT) == [], size
            await page.mouse.up()
            await robot.until_stopped()
            robot.set_reading("a", 90)
            await page.locator("[data-alarm-seen]").click()
            await page.locator("[data-alarm-strip]").wait_for(state="hidden")
            assert await page.evaluate(PLACES) == before, size


CUT = """() => [...document.querySelectorAll(".urc-alarm-line, .urc-alarm-action")]
    .filter((el) => el.scrollWidth > el.clientWidth + 1 || el.scrollHeight > el.clientHeight + 1)
    .map((el) => el.textContent)"""
