"""Five tasks of an operator in a real browser, with upper limits for taps and keys.

The limits are the point: a task that needs one more tap is a fault of the page.
"""

from pathlib import Path

import pytest
from playwright.async_api import Page

from tests.e2e.browser import Size
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.motion.driving import CALM_LEASE_S, commands, fingers_on, fresh
from tests.e2e.operator_input import OperatorInput, Told
from tests.e2e.operator_tasks import Hand, Keys, Touch
from tests.e2e.robots.recording import alive
from urc.model.interface import WidgetUse
from urc.model.world import PlanSpec, Wall
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

DEVICES: tuple[tuple[Size, type[Hand]], ...] = (
    ("phone", Touch),
    ("tablet", Touch),
    ("desktop", Keys),
)
ON_EACH = pytest.mark.parametrize(("size", "kind"), DEVICES)
FLEET = 12
BATTERY = WidgetUse("battery", "battery", {"level": "battery"})


async def hand_on(new_page: PageMaker, size: Size, kind: type[Hand]) -> Hand:
    """Return an operator with an empty page."""
    page = await fresh(new_page, size)
    await page.emulate_media(reduced_motion="reduce")
    told = Told(page)
    return kind(OperatorInput(page, await fingers_on(page)), told)


async def until_live(page: Page) -> None:
    """Wait until the robot can be driven."""
    await page.wait_for_function(
        "() => document.querySelector('.joystick')?.dataset.phase === 'idle'"
    )


def within(hand: Hand, *, touches: int, keys: int) -> None:
    """Check the counts of the last task."""
    done = hand.input
    assert done.swipes == 0
    if isinstance(hand, Keys):
        assert (done.touches, done.keys <= keys) == (0, True), done.account()
    else:
        assert (done.keys, done.touches <= touches) == (0, True), done.account()


YARD = PlanSpec(walls=(Wall(90, -90, 90, 90), Wall(-90, -90, -90, 90)))
"""A busy machine takes a minute for the tasks: the robot would meet a wall of the usual room."""


@ON_EACH
async def test_a_robot_with_an_alarm_is_found_and_stopped(
    size: Size, kind: type[Hand], new_page: PageMaker
) -> None:
    """The last robot of the list has the alarm; a page of another operator keeps it connected."""
    robots = [
        FakeRobot(
            dashboard_profile(
                name=f"rover-{number:02}", uses=(BATTERY,), commands=commands(CALM_LEASE_S)
            )
        )
        for number in range(FLEET)
    ]
    async with running_dashboard(*robots) as address:
        other, hand = await fresh(new_page), await hand_on(new_page, size, kind)
        await other.goto(f"{address}robots/{robots[-1].profile.name}/")
        await until(lambda: robots[-1].is_open)
        robots[-1].set_reading("battery", 7, alarm="lolo")
        await other.locator("[data-alarm-strip]").locator("visible=true").wait_for()
        await hand.page.goto(address)
        await hand.stop_the_robot_with_an_alarm()
        within(hand, touches=2, keys=9)
        assert hand.page.url.endswith(f"/{robots[-1].profile.name}/")


@ON_EACH
async def test_views_speeds_stop_and_control_while_driving(
    size: Size,
    kind: type[Hand],
    new_page: PageMaker,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The emulated TurtleBot 4 measures its own speed."""
    monkeypatch.setattr("urc.simulator.world.world.ROOM", YARD)
    async with alive("turtlebot4", tmp_path, monkeypatch, lease_s=CALM_LEASE_S) as robot:
        hand = await hand_on(new_page, size, kind)
        address = f"{robot.address}robots/turtlebot4/"
        await hand.page.goto(address)
        await until_live(hand.page)
        await hand.swap_the_camera()
        within(hand, touches=2, keys=6)
        await hand.slow_down()
        within(hand, touches=2, keys=2)
        await hand.drive_after_stop()
        within(hand, touches=3, keys=4)

        away = await fresh(new_page)
        await away.goto(address)
        await away.locator("[data-verb='force']").click()
        await hand.page.reload()
        await hand.take_over()
        within(hand, touches=2, keys=6)
