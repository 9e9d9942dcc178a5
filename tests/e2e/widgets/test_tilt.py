"""A device that is tilted, in a real browser, and what then reaches the robot."""

import pytest
from playwright.async_api import Browser

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_text
from tests.e2e.motion.driving import fire
from tests.e2e.widgets.inputs import PLAIN, drag, shown, until_values, use

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="session")
def browser(whole_browser: Browser) -> Browser:
    """Let the device have sensors."""
    return whole_browser


TILT = (
    "dispatchEvent(new DeviceOrientationEvent('deviceorientation',"
    " {{ alpha: 0, beta: {beta}, gamma: {gamma} }}))"
)


async def test_tilt_drives_while_the_pad_is_held_and_so_does_dragging(new_page: PageMaker) -> None:
    """How it was held when the pad was touched is the middle, anew at each press."""
    async with shown(new_page, use("tilt", range=20.0, **PLAIN)) as (robot, page):
        await fire(page, TILT.format(beta=40, gamma=0))
        await drag(page, ".tilt-pad", 0, 400)
        await until_values(robot, x=1.0)
        await page.mouse.up()
        await robot.until_stopped("go")
        await page.get_by_role("button", name="Use tilt").click()
        await until_text(page, ".tilt-state", "Hold the pad and tilt the device.")
        await fire(page, TILT.format(beta=60, gamma=0))
        count = len(robot.line.written)
        await drag(page, ".tilt-pad", 0, 50)
        await until(lambda: len(robot.after(count)) > 3)
        assert not any(robot.values("go").values()), "the middle is where it is"
        await fire(page, TILT.format(beta=50, gamma=-10))
        await until_values(robot, x=0.5, y=0.5)
        await page.mouse.up()
        await robot.until_stopped("go")
