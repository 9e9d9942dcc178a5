"""Trials of the driving lock in which the whole server stands still, or the whole page.

Both also stop the ticks of the held control, so the robot stops even earlier than for an old image.
The server has a process of its own, behind whose back its guard stops the robot.
"""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.carts import HEAD, Cart
from tests.e2e.motion.driving import fresh, push_until
from tests.e2e.motion.test_driving_lock import PROFILE, moves
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.test_video_page import H264, test_card
from tests.e2e.transports.programs import program

__all__ = ["Stage", "separate_cart"]

PAD: Final = ".joystick-pad"
LIVE: Final = """
() => document.querySelector("[data-badge]")?.dataset.state === "good"
  && document.querySelector(".camera")?.dataset.state === "live"
  && document.querySelector(".camera").dataset.frozen !== "yes"
"""


class Stage:
    """A cart, its server in another process, and its page."""

    def __init__(self, cart: Cart, server: UrcProcess, page: Page) -> None:
        self.cart = cart
        self.page = page
        self._server = server

    async def drive(self) -> None:
        """Wait until the page shows the present, and push the stick until the cart moves."""
        await self.page.wait_for_function(LIVE)
        await push_until(lambda: moves(self.cart), self.page, PAD)

    async def until_stopped(self) -> None:
        """Wait for the cart's stop."""
        await until(lambda: not moves(self.cart))

    async def stand(self, kind: str) -> None:
        """Freeze the process of the server or that of the page, as of a suspended tab."""
        await self._signal(kind, signal.SIGSTOP)

    async def go_on(self, kind: str) -> None:
        """Let the process go on, and let go of the stick."""
        await self._signal(kind, signal.SIGCONT)
        await self.page.mouse.up()

    async def _signal(self, kind: str, number: signal.Signals) -> None:
        for process in (self._server.pid,) if kind == "server" else await self._tabs():
            os.kill(process, number)

    async def _tabs(self) -> list[int]:
        """Return the processes of the browser's pages."""
        browser = self.page.context.browser
        assert browser is not None
        line = await browser.new_browser_cdp_session()
        told = await line.send("SystemInfo.getProcessInfo")
        await line.detach()
        return [one["id"] for one in told["processInfo"] if one["type"] == "renderer"]


@asynccontextmanager
async def separate_cart(maker: PageMaker, folder: Path) -> AsyncIterator[Stage]:
    """Serve a cart with a video in a process of its own."""
    cart, eye = Cart(), free_port()
    listener = await asyncio.start_server(cart.serve, "127.0.0.1", 0)
    file, port = folder / "cart.yaml", listener.sockets[0].getsockname()[1]
    text = (HEAD + PROFILE).replace("PORT", str(port)).replace("EYE", str(eye))
    file.write_text(text, "utf-8")
    arguments = ("serve", str(file), "--port", "0", "--data-dir", str(folder / "data"))
    async with program(*test_card(eye, *H264)):
        server = UrcProcess(arguments, {})
        try:
            found = await server.wait_for_async(r"(http://\S+)")
            page = await fresh(maker)
            await page.goto(f"{found[1]}robots/cart/")
            await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
            yield Stage(cart, server, page)
        finally:
            os.kill(server.pid, signal.SIGCONT)
            server.kill()
            listener.close()
