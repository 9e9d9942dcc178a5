"""A dashboard in the test's own loop, so that the test can play the robot's part."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from pathlib import Path

from playwright.async_api import Page
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from tests.e2e.browser import PLAIN_HOST
from urc.testing.dashboard import FakeRobot
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, Robot, build_app, serve
from urc.web.serve.access import Access
from urc.web.serve.certificates import Certificates
from urc.web.serve.connection import CONNECTIONS, REQUEST_S
from urc.web.serve.tls_listener import Handshakes

WAIT_S = 30.0


@asynccontextmanager
async def running_dashboard(
    *robots: FakeRobot,
    port: int = 0,
    request_s: float = REQUEST_S,
    connections: int = CONNECTIONS,
    trusted: Iterable[str] = (),
    access: Access = ACCESS,
    certificates: Certificates | None = None,
    handshakes: Handshakes | None = None,
    data: Path | None = None,
) -> AsyncIterator[str]:
    """Serve the robots on this machine; give the address, and end cleanly.

    With `data`, alarms, latches and the audit log are kept in this folder.
    Foreign widgets live in frames, but for those whose names are `trusted`. With `certificates`,
    the address is one of HTTPS.
    """
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app(
        {robot.profile.name: Robot(robot.profile, {}, robot.open) for robot in robots},
        DashboardOptions(
            access=access,
            allowed_hosts=[PLAIN_HOST],
            linger_s=0.2,
            trusted=trusted,
            certificates=certificates,
            data=data,
        ),
    )
    task = asyncio.create_task(
        serve(
            app,
            port=port,
            on_ready=ready.set_result,
            request_s=request_s,
            connections=connections,
            certificates=certificates,
            handshakes=handshakes,
        )
    )
    try:
        async with asyncio.timeout(WAIT_S):
            await asyncio.wait((ready, task), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield await ready
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)


async def until(is_true: Callable[[], bool]) -> None:
    """Wait for something on the server's side."""
    loop = asyncio.get_running_loop()
    end_s = loop.time() + WAIT_S
    while not is_true():
        assert loop.time() < end_s, "it did not come true"
        await asyncio.sleep(0.01)


async def until_closed(line: ClientConnection) -> int | None:
    """Read until the server closes; return the code."""
    async with asyncio.timeout(WAIT_S):
        try:
            while True:
                await line.recv()
        except ConnectionClosed:
            return line.close_code


async def until_text(page: Page, selector: str, text: str) -> None:
    """Wait until an element of the page says exactly `text`, wherever its lines may break."""
    await page.wait_for_function(
        "([selector, text]) => document.querySelector(selector)?.textContent"
        ".trim().replaceAll('\u00a0', ' ') === text",
        arg=[selector, text],
    )


async def until_attribute(page: Page, selector: str, name: str, value: str) -> None:
    """Wait until an attribute of an element of the page has `value`."""
    await page.wait_for_function(
        "([selector, name, value]) =>"
        " document.querySelector(selector)?.getAttribute(name) === value",
        arg=[selector, name, value],
    )


async def turned(page: Page, size: tuple[int, int]) -> None:
    """Set the width and height of the screen, and wait until the page is laid out for them."""
    width, height = size
    await page.set_viewport_size({"width": width, "height": height})
    await page.wait_for_function(
        "([width, height]) => innerWidth === width && innerHeight === height", arg=[width, height]
    )
    await page.evaluate(
        "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )


async def is_on_top(page: Page, selector: str) -> bool:
    """Return whether a finger on the middle of an element meets it, and nothing above it."""
    return bool(
        await page.evaluate(
            """(selector) => {
                const el = document.querySelector(selector);
                const { left, top, width, height } = el.getBoundingClientRect();
                const met = document.elementFromPoint(left + width / 2, top + height / 2);
                return el.contains(met);
            }""",
            selector,
        )
    )
