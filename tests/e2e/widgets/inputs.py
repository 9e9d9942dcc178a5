"""Inputs on a page of their own, and what hands do there."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.driving import CALM_LEASE_S, Wire, centre, driven, fresh, held, number
from urc.model.driver import Command
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

__all__ = ["COMMANDS", "PLAIN", "Inputs", "drag", "shown", "until_values", "use"]

PLAIN: dict[str, Any] = {"dead_zone": 0.0, "expo": 0.0}
"""Pushes arrive as they are."""
COMMANDS = {
    "go": held("go", number("x"), number("y"), number("turn"), lease_s=CALM_LEASE_S),
    "level": held("level", number("value"), lease_s=CALM_LEASE_S),
}


class Inputs(Wire):
    """A robot with the widgets of one test, each in a cell of its own."""

    def __init__(self, *uses: WidgetUse, **commands: Command) -> None:
        signals = {"at": Signal("at", "number")}
        known = {**COMMANDS, **commands}
        FakeRobot.__init__(self, dashboard_profile(uses=uses, commands=known, signals=signals))


def use(widget: str, command: str = "go", **options: Any) -> WidgetUse:
    """Return a widget that is bound to a command."""
    output = "go" if widget.endswith("-pad") else "moved"
    bound = {} if widget == "deadman" else {output: command}
    return WidgetUse(widget.replace("-", "_"), widget, {}, bound, options, title=widget)


@asynccontextmanager
async def shown(
    new_page: PageMaker,
    *uses: WidgetUse,
    size: str = "desktop",
    host: str = "127.0.0.1",
    **commands: Command,
) -> AsyncIterator[tuple[Inputs, Page]]:
    """Show widgets on a page of their own, ready to drive."""
    robot = Inputs(*uses, **commands)
    async with driven(robot=robot) as (_, address):
        page = await fresh(new_page, size)
        await page.goto(address.replace("127.0.0.1", host))
        await page.wait_for_function(
            "() => document.querySelector('[data-who]')?.textContent.match(/driv/)"
            " && [...document.querySelectorAll('.urc-cell [data-phase]')]"
            ".every((el) => el.dataset.phase === 'idle' || el.dataset.phase === 'locked')"
        )
        yield robot, page


async def until_values(robot: Wire, command: str = "go", **values: float) -> None:
    """Wait until the robot is told exactly this."""
    known = dict.fromkeys(robot.profile.driver.commands[command].arguments, 0.0)
    await until(lambda: robot.values(command) == {**known, **values})


async def drag(page: Page, selector: str, right: float, up: float) -> None:
    """Press the mouse on an element and move it; it stays down."""
    x, y = await centre(page, selector)
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x + right, y - up, steps=3)
