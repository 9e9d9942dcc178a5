"""A robot at rest: equal readings change nothing on its page, and cost hardly any frames."""

import asyncio

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until_text
from tests.e2e.widgets.viewing import shown
from urc.model.interface import WidgetUse
from urc.model.values import Signal

pytestmark = pytest.mark.anyio

SIGNALS = {
    name: Signal(name, "number", unit=unit, stale_after_s=60)
    for name, unit in (("x", "m"), ("y", "m"), ("yaw", "rad"), ("pace", "m/s"), ("hidden", "m"))
}
USES = (
    WidgetUse("map", "map", {"x": "x", "y": "y", "yaw": "yaw"}),
    WidgetUse("speed", "speed", {"measured": "pace"}),
)
READINGS, INTERVAL_S = 40, 0.05
FRAMES_HZ = 8
"""The page draws ages four times a second; one frame more for each may come from Chromium."""
WATCH = """
() => {
  window.changes = [];
  window.frames = 0;
  new MutationObserver((list) => window.changes.push(...list.map(({ target, attributeName }) =>
    `${target.className ?? target.nodeName} ${attributeName}`))).observe(
    document.querySelector(".urc-grid"),
    { subtree: true, childList: true, characterData: true, attributes: true });
  const ask = window.requestAnimationFrame;
  window.requestAnimationFrame = (act) => { window.frames += 1; return ask(act); };
}
"""


async def test_equal_readings_change_nothing_and_others_are_not_drawn(new_page: PageMaker) -> None:
    """Twenty equal readings a second of shown signals, and changing ones of a hidden signal."""
    page = await new_page(size="tablet")
    async with shown(page, SIGNALS, *USES) as robot:
        for name in SIGNALS:
            robot.set_reading(name, 1.0)
        await until_text(page, ".speed-text", "1.00")
        await page.wait_for_selector(".map[data-state='live']")
        await asyncio.sleep(0.5)
        await page.evaluate(WATCH)
        for number in range(READINGS):
            for name in SIGNALS:
                robot.set_reading(name, float(number) if name == "hidden" else 1.0)
            await asyncio.sleep(INTERVAL_S)
        assert await page.evaluate("window.changes") == []
        assert await page.evaluate("window.frames") <= FRAMES_HZ * READINGS * INTERVAL_S
        robot.set_reading("pace", 2.0)
        await until_text(page, ".speed-text", "2.00")
