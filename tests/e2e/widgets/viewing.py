"""A page with the widgets of one test that look at the world."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

from playwright.async_api import Page

from tests.e2e.dashboards import running_dashboard, until
from urc.model.driver import Command
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

__all__ = ["METRES", "RESTED", "shown"]

METRES = {name: Signal(name, "number", unit="m", stale_after_s=60) for name in ("front", "rear")}
RESTED = """
async () => {
  const drawn = () => document.querySelector(".scene3d-picture").dataset.frames;
  for (let attempt = 0; attempt < 50; attempt += 1) {
    const before = drawn();
    for (let n = 0; n < 20; n += 1) await new Promise((done) => requestAnimationFrame(done));
    if (drawn() === before) return before;
  }
  return "it never rests";
}
"""
"""Resolves when a scene draws no more, with how often it has drawn."""


@asynccontextmanager
async def shown(
    page: Page,
    signals: Mapping[str, Signal],
    *uses: WidgetUse,
    commands: Mapping[str, Command] | None = None,
) -> AsyncIterator[FakeRobot]:
    """Show widgets on a page, and give their robot once it is connected."""
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands or {})
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        yield robot
