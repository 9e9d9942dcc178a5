"""A cart on a real line with a guard of URC, which hears what it is told and may refuse it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from tests.e2e.dashboards import WAIT_S
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, Robot, build_app, serve

__all__ = ["Cart", "served"]

HEAD = """\
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
async def served(folder: Path, profile: str) -> AsyncIterator[tuple[Cart, str]]:
    """Serve a cart, whose profile goes on after its transport; give it, and its page's address."""
    cart = Cart()
    listener = await asyncio.start_server(cart.serve, "127.0.0.1", 0)
    file = folder / "cart.yaml"
    port = listener.sockets[0].getsockname()[1]
    file.write_text((HEAD + profile).replace("PORT", str(port)), "utf-8")
    catalog = built_in_catalog()
    known = load_profile(file, catalog)
    robot = Robot(known, {}, lambda: Session(known, {}, catalog.transports, motion="guarded"))
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app({"cart": robot}, DashboardOptions(access=ACCESS, linger_s=0.2))
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        async with asyncio.timeout(WAIT_S):
            address = await ready
        yield cart, f"{address}robots/cart/"
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)
        listener.close()
