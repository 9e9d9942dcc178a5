"""A robot that moves in steps, in a real browser: nothing stops it, and nothing more goes out."""

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.carts import served
from tests.e2e.motion.driving import STOP, fresh, push

pytestmark = pytest.mark.anyio

PROFILE = """\
commands:
  jog:
    send: "JOG {{ x | round(2) }}"
    args: { x: { unit: mm, min: -5, max: 5, default: 0 } }
    hold: { repeat: 100ms, lease: 1s, step: 100ms }
widgets:
  stick: { use: joystick, bind: { moved: { command: jog, args: { x: x } } } }
interfaces:
  default: { grid: stick }
"""


async def test_steps_end_with_the_hand_and_with_stop_and_nothing_is_sent_for_that(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """STOP is latched, and says so, though the robot hears nothing."""
    async with served(tmp_path, PROFILE) as (cart, address):
        page = await fresh(new_page)
        await page.goto(address)
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        await push(page)
        await until(lambda: len(cart.heard) > 5)
        await page.mouse.up()
        await asyncio.sleep(0.3)
        count = len(cart.heard)
        await asyncio.sleep(0.5)
        assert len(cart.heard) == count
        assert "JOG 0" not in cart.heard[3:], "no useless step"
        await push(page, up=50)
        await until(lambda: len(cart.heard) > count + 3)
        await page.keyboard.press("Escape")
        await expect(page.locator("[data-stop-note]")).to_contain_text("latched")
        await asyncio.sleep(0.3)
        count = len(cart.heard)
        await asyncio.sleep(0.5)
        assert len(cart.heard) == count
        assert await page.locator(STOP).count() == 1
