"""The playground on a static web server under some path, in a browser that reaches nothing else."""

import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from playwright.async_api import Browser, BrowserContext, Page, Route, expect

from playground.checker import report
from tests.e2e import axe
from tests.e2e.browser import LOCALE, PageFaults

__all__ = [
    "OFFLINE",
    "WITHIN_MS",
    "all_files",
    "command_report",
    "opened",
    "put",
    "served",
    "shown_report",
    "start",
]

WITHIN_MS = 110_000
"""Limit for the start of Python, in milliseconds."""
OFFLINE = "works offline"
"""What the page says as soon as all its files are kept."""
_COMPARED = ("line", "column", "severity", "code", "message")


class _Files(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""


@contextmanager
def served(root: Path) -> Iterator[str]:
    """Serve the files below `root`; yield the address, which ends with a slash."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Files, directory=root))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


@asynccontextmanager
async def opened(browser: Browser, address: str, fragment: str = "") -> AsyncIterator[Page]:
    """Open the playground at `address`; fail if its pages ask any other host, or show a fault."""
    foreign: list[str] = []

    async def refuse(route: Route) -> None:
        foreign.append(route.request.url)
        await route.abort()

    context: BrowserContext = await browser.new_context(locale=LOCALE)
    context.set_default_timeout(WITHIN_MS)
    origin = "/".join(address.split("/")[:3])
    await context.route(lambda url: not url.startswith((origin, "blob:", "data:")), refuse)
    page = await axe.prepare(await context.new_page())
    faults = PageFaults(page)
    try:
        await page.goto(address + fragment)
        yield page
        assert foreign == []
        assert faults.unexpected() == []
    finally:
        await context.close()


async def start(page: Page) -> Any:
    """Start the robot by its button; return the frame of its dashboard."""
    await page.locator("[data-go]").click()
    frame = page.frame_locator("iframe")
    badge = frame.locator("[data-badge]")
    await expect(badge).to_have_attribute("data-state", "good", timeout=WITHIN_MS)
    return frame


def all_files(folder: Path) -> dict[str, str]:
    """Return all files below a folder as Latin-1 text, by relative path."""
    return {
        file.relative_to(folder).as_posix(): file.read_bytes().decode("latin-1")
        for file in sorted(folder.rglob("*"))
        if file.is_file() and not file.name.endswith(".txt")
    }


async def put(page: Page, files: dict[str, str], documents: list[str]) -> list[dict[str, Any]]:
    """Return the page's reports of documents in a folder with `files`."""
    found: list[dict[str, Any]] = await page.evaluate(
        """async ([files, documents]) => {
          const { report } = await import("./checks.js");
          const bytes = (text) => Uint8Array.from(text, (one) => one.charCodeAt(0));
          const pairs = Object.entries(files).map(([name, text]) => [name, bytes(text)]);
          const given = Object.fromEntries(pairs);
          const found = [];
          for (const [number, document] of documents.entries()) {
            found.push(await report("/broken", document, number ? undefined : given));
          }
          return found;
        }""",
        [files, documents],
    )
    return found


def shown_report(found: dict[str, Any]) -> list[tuple[object, ...]]:
    """Return place, severity, code and message of every problem of a JSON report."""
    return [tuple(one[key] for key in _COMPARED) for one in found["problems"]]


def command_report(folder: Path, document: str) -> dict[str, Any]:
    """Return the JSON report of ``urc validate`` in this Python."""
    import json

    found: dict[str, Any] = json.loads(report(str(folder), document))
    return found
