"""A page of somebody else in a cell, in a real browser: what it shows, and what it cannot reach."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from urllib.parse import urlsplit

import pytest
from playwright.async_api import Frame, Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.ports import free_port
from urc.model.interface import WidgetUse
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

WEB_UI = b"""<!doctype html><title>robot</title><h1>The robot's own page</h1>
<input aria-label=word><p id=said></p>
<script>
const tries = {
  top: () => top.document.title,
  parent: () => parent.document.title,
  stop: () => top.document.querySelector(".urc-stop"),
  leave: () => { top.location = "about:blank"; },
  neighbour: () => { parent.location = "about:blank"; },
};
const said = {};
for (const [name, attempt] of Object.entries(tries)) {
  try { attempt(); said[name] = "reached"; } catch (error) { said[name] = error.name; }
}
said.window = open("about:blank") === null ? "none" : "opened";
said.referrer = document.referrer;
document.getElementById("said").textContent = JSON.stringify(said);
</script>"""
SILENT = "◆ the page does not respond, or does not allow other pages to show it"


class Site:
    """The other server; it answers all paths alike, or, below ``/never``, not at all."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.address = ""

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request."""
        try:
            head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
            path = head.split(" ")[1]
            self.asked.append(path)
            if path.startswith("/never"):
                await reader.read()
                return
            length = f"content-type: text/html\r\ncontent-length: {len(WEB_UI)}\r\n"
            writer.write(f"HTTP/1.1 200 OK\r\n{length}connection: close\r\n\r\n".encode() + WEB_UI)
            await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass  # a connection that the browser opened in advance
        finally:
            writer.close()


@asynccontextmanager
async def running_site() -> AsyncIterator[Site]:
    """Serve it on a free port of this machine."""
    site = Site()
    server = await asyncio.start_server(site.serve, "127.0.0.1", 0)
    site.address = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    try:
        yield site
    finally:
        server.close()


def is_of_the_wall(fault: str) -> bool:
    """Return whether a browser says of what the page tried that it was stopped."""
    signs = ("Unsafe attempt to initiate navigation", "Blocked opening", "status of 404")
    return any(sign in fault for sign in signs)


def shown(slot: str, url: str) -> WidgetUse:
    """Return a slot that shows a page, as a document that names it is read."""
    return WidgetUse(slot, "iframe", options={"url": url}, title=slot, pages={"url": (url,)})


def cell(slot: str) -> str:
    """Return the selector of the widget in a slot."""
    return f'.iframe[aria-labelledby="cell-{["robot", "silent", "mine"].index(slot)}-title"]'


async def inside(page: Page, address: str) -> Frame:
    """Return the frame in which somebody else's page is, once it has said what it tried."""
    await until(lambda: any(frame.url.startswith(address) for frame in page.frames))
    frame = next(frame for frame in page.frames if frame.url.startswith(address))
    await frame.wait_for_function("() => document.querySelector('#said')?.textContent")
    return frame


async def test_a_page_of_somebody_else_is_seen_and_reaches_nothing(new_page: PageMaker) -> None:
    """The dashboard's policy stays as it was; its own pages are refused; silence is told."""
    port = free_port()
    async with running_site() as site:
        uses = [
            shown("robot", f"{site.address}/ui"),
            shown("silent", f"{site.address}/never"),
            shown("mine", f"http://127.0.0.1:{port}/robots/puppet/"),
        ]
        robot = FakeRobot(dashboard_profile(uses=uses))
        async with running_dashboard(robot, port=port) as address:
            page = await new_page(size="desktop")
            new_page.allow(page, is_of_the_wall)
            await page.clock.install()
            answer = await page.goto(f"{address}robots/puppet/")
            assert answer is not None
            assert "frame-src 'self';" in answer.headers["content-security-policy"]

            frame = await inside(page, site.address)
            assert await frame.inner_text("h1") == "The robot's own page"
            said = json.loads(await frame.inner_text("#said"))
            wall = dict.fromkeys(("top", "parent", "stop", "leave", "neighbour"), "SecurityError")
            assert said == {**wall, "window": "none", "referrer": ""}
            await until_attribute(page, cell("robot"), "data-state", "live")
            around = frame.parent_frame
            assert around is not None
            assert await around.locator("script").count() == 0
            assert urlsplit(around.url).path.startswith("/robots/puppet/framed/")
            assert page.url == f"{address}robots/puppet/"

            mine = f"{cell('mine')} .iframe-note"
            await until_text(page, mine, "◆ pages of the dashboard itself cannot be shown here")
            assert await page.locator(f"{cell('mine')} iframe").is_hidden()
            assert not [one.url for one in page.frames[1:] if one.url == page.url]

            note = f"{cell('robot')} .iframe-note"
            await frame.click("input")
            await page.keyboard.type("a b")
            assert await frame.input_value("input") == "a b"
            await until_text(
                page, note, "▲ this page receives all keys, including Space: use STOP on the screen"
            )
            asked = site.asked.count("/ui")
            await page.click(f"{cell('robot')} .iframe-reload")
            await until(lambda: site.asked.count("/ui") > asked)
            await until_text(page, note, "")

            await page.locator(f"{cell('silent')}[data-state=wait]").wait_for()
            await page.clock.fast_forward(11_000)
            await until_text(page, f"{cell('silent')} .iframe-note", SILENT)
