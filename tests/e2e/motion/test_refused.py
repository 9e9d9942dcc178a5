"""A robot that refuses to move, in a real browser: its words at the stick, and its stop first."""

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.carts import served
from tests.e2e.motion.driving import fresh, push

pytestmark = pytest.mark.anyio

PROFILE = """\
commands:
  drive:
    send: "V {{ speed | round(2) }}"
    args: { speed: { min: -1, max: 1, default: 0 } }
    reply: { equals: OK, errors: [{ regex: '^ERR (?P<_why>.+)$', text: "It says {{ _why }}." }] }
    hold: { repeat: 50ms, lease: 1s, release: {}, watchdog: none }
widgets:
  stick: { use: joystick, bind: { moved: { command: drive, args: { x: speed } } } }
interfaces:
  default: { grid: stick }
"""


async def test_a_refusal_stops_the_robot_and_its_words_stand_at_the_stick(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The stick is still held, and moves nothing before it was let go."""
    async with served(tmp_path, PROFILE) as (cart, address):
        page = await fresh(new_page)
        await page.goto(address)
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        await push(page)
        await until(lambda: any(one not in ("V 0", "V 0.0") for one in cart.heard))
        await until(lambda: len(cart.heard) > 10)
        cart.is_open = True
        note = page.locator(".joystick-note")
        await expect(note).to_contain_text("It says the guard is open.")
        await until(lambda: cart.heard[-1] == "V 0")
        count = len(cart.heard)
        await asyncio.sleep(0.5)
        assert cart.heard[count:] == [], "the hand that held on moves nothing"
        cart.is_open = False
        await page.mouse.up()
        await push(page, up=50)
        await until(lambda: any(one != "V 0" for one in cart.heard[count:]))
        await page.mouse.up()
        await until(lambda: cart.heard[-1] == "V 0")
