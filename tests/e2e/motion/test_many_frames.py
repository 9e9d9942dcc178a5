"""One stick and two controllers on one line, in a real browser and with the guard."""

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
    send: ["M1 {{ speed | round(2) }}", "M2 {{ (0 - speed) | round(2) }}"]
    args: { speed: { min: -1, max: 1, default: 0 } }
    reply: { equals: OK }
    hold: { repeat: 50ms, lease: 1s, release: { speed: 0 }, watchdog: none }
widgets:
  stick: { use: joystick, bind: { moved: { command: drive, args: { x: speed } } } }
interfaces:
  default: { grid: stick }
"""


def value(frame: str) -> float:
    """Return what a controller is told."""
    return float(frame.split()[1])


async def test_one_stick_drives_two_controllers_and_stops_both(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Each frame of one is followed by the other's, also when it is let go, and by STOP."""
    async with served(tmp_path, PROFILE) as (cart, address):
        page = await fresh(new_page)
        await page.goto(address)
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        await push(page)
        await until(lambda: len(cart.heard) > 6 and value(cart.heard[-1]) != 0)
        await page.mouse.up()
        await until(lambda: [value(one) for one in cart.heard[-2:]] == [0, 0])
        await push(page, up=50)
        await until(lambda: value(cart.heard[-1]) != 0)
        await page.keyboard.press("Escape")
        await until(lambda: [value(one) for one in cart.heard[-2:]] == [0, 0])
        firsts, seconds = cart.heard[0::2], cart.heard[1::2]
        assert {one.split()[0] for one in firsts} == {"M1"}
        assert {one.split()[0] for one in seconds} == {"M2"}
        pairs = zip(firsts, seconds, strict=True)
        assert all(value(one) == -value(other) for one, other in pairs)
