"""The drill of the block list: a robot stops while its operator still holds the stick."""

import asyncio
import time
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.managing import running_managed
from tests.e2e.motion.carts import Cart
from tests.e2e.motion.driving import fresh, push
from tests.e2e.processes import UrcProcess
from tests.unit.packages.made import install, keep_settings, package, write_package
from urc.packages.store import Store

pytestmark = pytest.mark.anyio

WHY = "It turns the wrong way."
CART = """\
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, required: true }
transports:
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
    stale_after: 60s
commands:
  drive:
    send: "V {{ speed | round(2) }}"
    args: { speed: { min: -1, max: 1, default: 0 } }
    reply: { equals: OK }
    hold: { repeat: 50ms, lease: 1s, release: {}, watchdog: none }
widgets:
  stick: { use: joystick, bind: { moved: { command: drive, args: { x: speed } } } }
interfaces:
  default: { grid: stick }
"""
STOPPED = ("V 0", "V 0.0")
STOP_MOST_S = 10.0
"""Maximum time from the end of the import to the stop, on a busy machine, in seconds."""


async def urc(data: Path, *words: str) -> str:
    """Run `urc` in a process of its own; return its last line."""
    process = UrcProcess(list(words), {"URC_DATA_DIR": str(data)})
    try:
        assert await process.wait_async() == 0
        return process.output[-1]
    finally:
        process.kill()


async def test_a_block_list_from_a_file_stops_the_robot_and_disables_its_package(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Without any network: the robot stops, stays stopped, and its package can't be used."""
    data, keeper, lab = tmp_path / "data", tmp_path / "keeper", tmp_path / "lab"
    entry = (str(lab), "robots/cart", "<2")
    write_package(lab, "widget", "dial")
    await urc(keeper, "repo", "key", "new", "Keeper")
    fingerprint = (await urc(keeper, "repo", "key", "show")).partition("(")[2].rstrip(")")
    await urc(keeper, "repo", "index", str(lab))
    await urc(keeper, "repo", "block", *entry, "--why", WHY)
    await urc(keeper, "repo", "blocks", "export", str(lab), str(tmp_path / "blocked.json"))
    await urc(keeper, "repo", "unblock", *entry)
    await urc(keeper, "repo", "blocks", "export", str(lab), str(tmp_path / "withdrawn.json"))

    install(Store(data / "packages"), package("robot", "cart", text=CART))
    cart = Cart()
    listener = await asyncio.start_server(cart.serve, "127.0.0.1", 0)
    keep_settings(data, "cart", {"port": str(listener.sockets[0].getsockname()[1])})
    async with listener, running_managed(data) as address:
        page = await fresh(new_page)
        new_page.allow(page, lambda text: "404" in text)
        await page.goto(f"{address}robots/cart/")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        await push(page)
        await until(lambda: any(one not in STOPPED for one in cart.heard))
        said = "blocks", "import", str(tmp_path / "blocked.json")
        told = await urc(data, "repo", *said, "--signed-by", fingerprint)
        assert told.endswith(f"robots/cart 1.0.0 is blocked by Keeper: {WHY}")
        began_s = time.monotonic()
        await until(lambda: cart.heard[-1] in STOPPED)
        assert time.monotonic() - began_s < STOP_MOST_S
        latch = data / "latches/cart.latch.json"
        await until(lambda: latch.is_file() and WHY in latch.read_text("utf-8"))
        count = len(cart.heard)
        await asyncio.sleep(1)
        assert [one for one in cart.heard[count:] if one not in STOPPED] == []
        await page.mouse.up()
        await page.goto(address)
        await expect(page.locator("main")).to_contain_text(f"is blocked by Keeper: {WHY}")
        assert (await page.goto(f"{address}robots/cart/")).status == 404  # type: ignore[union-attr]
        await urc(data, "repo", "blocks", "import", str(tmp_path / "withdrawn.json"))
        open_again = page.get_by_role("link", name="Connect to Cart", exact=True)
        async with asyncio.timeout(STOP_MOST_S):
            while await open_again.count() == 0:
                await page.goto(address)
        answer = await page.goto(f"{address}robots/cart/")
        assert answer is not None
        assert answer.status == 200, await page.inner_text("body")
        who = page.locator("[data-latched-text]")
        await expect(who).to_contain_text("Stopped by URC: robots/cart 1.0.0 is blocked by Keeper")
        assert [one for one in cart.heard[count:] if one not in STOPPED] == []
