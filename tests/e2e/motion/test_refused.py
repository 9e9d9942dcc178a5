"""A robot that refuses to move, in a real browser: its words at the stick, and its stop first."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import WAIT_S, until
from tests.e2e.motion.driving import fresh, push
from urc.config.load import load_profile
from urc.runtime.catalog import built_in_catalog
from urc.runtime.session import Session
from urc.web.app import Robot, build_app, serve

pytestmark = pytest.mark.anyio

PROFILE = """\
urc: 1
kind: robot
name: cart
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
    stale_after: 60s
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


class Cart:
    """Answers every frame, and refuses motion once its guard is open."""

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.is_open = False

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Talk until the line ends."""
        while line := await reader.readline():
            self.heard.append(line.decode().strip())
            is_refused = self.is_open and self.heard[-1] != "V 0"
            writer.write(b"ERR the guard is open\n" if is_refused else b"OK\n")
        writer.close()


@asynccontextmanager
async def served(folder: Path) -> AsyncIterator[tuple[Cart, str]]:
    """Serve a cart with a guard of URC; give it, and the address of its page."""
    cart = Cart()
    listener = await asyncio.start_server(cart.serve, "127.0.0.1", 0)
    file = folder / "cart.yaml"
    port = listener.sockets[0].getsockname()[1]
    file.write_text(PROFILE.replace("PORT", str(port)), "utf-8")
    catalog = built_in_catalog()
    known = load_profile(file, catalog)
    robot = Robot(known, {}, lambda: Session(known, {}, catalog.transports, motion="guarded"))
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app({"cart": robot}, linger_s=0.2)
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        async with asyncio.timeout(WAIT_S):
            yield cart, f"{await ready}robots/cart/"
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)
        listener.close()


async def test_a_refusal_stops_the_robot_and_its_words_stand_at_the_stick(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The stick is still held, and moves nothing before it was let go."""
    async with served(tmp_path) as (cart, address):
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
