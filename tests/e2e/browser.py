"""A real Chromium for tests: where it is, how it is started, and a page that tells on itself.

Playwright's sync API leaves a running loop in the main thread, which breaks every async test that
follows in the process. So the tests use its async API, on the one loop of the session.
"""

import shlex
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Literal

from playwright.async_api import Browser, ConsoleMessage, Error, Page, Request, async_playwright

from scripts.needs import NEEDS

Size = Literal["phone", "tablet", "desktop"]
Theme = Literal["light", "dark"]

SIZES: dict[Size, tuple[int, int]] = {
    "phone": (390, 844),
    "tablet": (820, 1180),
    "desktop": (1440, 900),
}

PLAIN_HOST = "plain.local"
"""Another name of this machine: over it a page comes as from a local network, without a secure
context."""

# Containers have neither a sandbox nor a GPU; the rest keeps the browser off the network.
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    f"--host-resolver-rules=MAP {PLAIN_HOST} 127.0.0.1",
)

# uPlot asks Intl for the browser's language; without one given it is "en-US@posix", which throws.
LOCALE = "en-GB"

PAGE_TIMEOUT_MS = 30_000

# Runs before any script of the page: the policy's own report is the only sure sign of a violation.
WATCH_POLICY = """
document.addEventListener("securitypolicyviolation", (event) => {
  console.error(`CSP violation: ${event.violatedDirective} blocked ${event.blockedURI}`);
});
"""


_WHOLE, _SHELL = (
    next(need for need in NEEDS if need.name == name) for name in ("chromium", "headless-shell")
)


@asynccontextmanager
async def running_browser(
    *flags: str, is_whole: bool = False, inside: Sequence[str] = (), wrapper: Path | None = None
) -> AsyncIterator[Browser]:
    """Start Chromium headless; it ends with the context.

    Args:
        flags: more of them, if need be.
        is_whole: the one that people have. Else the one without windows, in which a page takes half
            the time, and in which frames have no processes of their own, and devices no sensors.
        inside: command prefix that starts it in another network namespace.
        wrapper: file for the script that does so.
    """
    found = _WHOLE.find() if is_whole else _SHELL.find() or _WHOLE.find()
    if wrapper is not None:
        wrapper.write_text(f'#!/bin/sh\nexec {shlex.join([*inside, str(found)])} "$@"\n', "ascii")
        wrapper.chmod(0o700)
        found = str(wrapper)
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=found, args=[*FLAGS, *flags], timeout=60_000
        )
        try:
            yield browser
        finally:
            await browser.close()


WITHOUT_SERVER = ("ERR_CONNECTION_REFUSED", "WebSocket handshake: net::ERR_CONNECTION_RESET")
"""A test that ends stops its server before its page, which then connects again, or still does."""


class PageFaults:
    """What went wrong in a page that nobody would see: console errors, exceptions, CSP reports."""

    def __init__(self, page: Page) -> None:
        self.found: list[str] = []
        self._allowed: list[Callable[[str], bool]] = []
        self.unanswered: dict[Request, None] = {}
        """What the page asked for and has not got, oldest first: why a load does not end."""
        page.on("console", self._console)
        page.on("pageerror", self._page_error)
        page.on("request", self._asked)
        page.on("requestfinished", self._answered)
        page.on("requestfailed", self._answered)

    def allow(self, is_allowed: Callable[[str], bool]) -> None:
        """Let the faults pass that a test brings about on purpose, as a server that is killed."""
        self._allowed.append(is_allowed)

    def unexpected(self) -> list[str]:
        """Return the faults that no test allowed."""
        return [text for text in self.found if not any(test(text) for test in self._allowed)]

    def _asked(self, request: Request) -> None:
        self.unanswered[request] = None

    def _answered(self, request: Request) -> None:
        self.unanswered.pop(request, None)

    def _console(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            address = message.location.get("url", "")
            if not any(text in message.text for text in WITHOUT_SERVER):
                self.found.append(f"console: {message.text} ({address})")

    def _page_error(self, error: Error) -> None:
        self.found.append(f"exception: {error.stack or error.message}")


async def choose_theme(page: Page, theme: str) -> None:
    """Choose a theme in the settings of the device; "" is the theme of the system."""
    await page.locator("[popovertarget='device']").click()
    await page.locator(f"label:has([data-theme-choice][value='{theme}'])").click()
    await page.locator("[popovertarget='device']").click()


async def choose_language(page: Page, tag: str) -> None:
    """Choose the language in the settings of the device; the page loads again."""
    await page.locator("[popovertarget='device']").click()
    await page.locator("[data-language-choice]").select_option(tag)
