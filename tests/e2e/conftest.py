"""Fixtures of the tests over real sockets: the browser, its pages, and URC as a process."""

import logging
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import pytest
from playwright.async_api import Browser, BrowserContext, Page, expect
from xdist.remote import Producer

from tests.e2e.browser import (
    LOCALE,
    PAGE_TIMEOUT_MS,
    SIZES,
    WATCH_POLICY,
    PageFaults,
    Size,
    Theme,
    running_browser,
)
from tests.e2e.command_line import BOT
from tests.e2e.keys import entering, known_here
from tests.e2e.processes import UrcProcess
from tests.e2e.together import Together
from tests.e2e.transports.packets import sweep
from tests.e2e.unhurried import LONGEST_S, unhurried

LOG = logging.getLogger(__name__)

expect.set_options(timeout=PAGE_TIMEOUT_MS)


@pytest.hookimpl(optionalhook=True)
@pytest.fixture
def calm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no pause of a busy machine end the motion of a program in this process.

    For tests that are about something else; a program that is silent for a second still stops.
    """
    monkeypatch.setattr("urc.client.stick.HELD_UP_S", LONGEST_S)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Together | None:
    """Keep what belongs together in one process."""
    return Together(config, log) if config.getvalue("dist") == "loadgroup" else None


@pytest.fixture(scope="session", autouse=True)
def no_ports_of_the_dead() -> None:
    """Let no run that was killed lose the packets of this one."""
    sweep()


@pytest.fixture(scope="session", autouse=True)
def no_hurry() -> Iterator[None]:
    """Let no pause of this machine end a gesture, but where its lease does."""
    with unhurried():
        yield


@pytest.fixture(scope="session")
async def browser(anyio_backend: str) -> AsyncIterator[Browser]:
    """One Chromium for the whole session, the one without windows."""
    async with running_browser() as started:
        yield started


@pytest.fixture(scope="session")
async def whole_browser(anyio_backend: str) -> AsyncIterator[Browser]:
    """One Chromium as people have it: a module that needs it lets its `browser` be this one."""
    async with running_browser(is_whole=True) as started:
        yield started


HINTS_SEEN = "try { localStorage.setItem('urc-hints', 'seen'); } catch {}"
"""The hints of a first visit lie over a page until they are read."""


class PageMaker:
    """Opens pages for one test; call it as ``await new_page(size="phone", theme="dark")``."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._contexts: list[BrowserContext] = []
        self._faults: dict[Page, PageFaults] = {}

    async def __call__(
        self,
        size: Size = "desktop",
        theme: Theme = "light",
        *,
        is_kept: bool = False,
        is_first: bool = False,
    ) -> Page:
        """Return an empty page of its own browser context, so that nothing is shared.

        `is_kept`: the pages may install their service worker, as they do for people.
        `is_first`: the device has not seen the hints of a first visit.
        """
        width, height = SIZES[size]
        context = await self._browser.new_context(
            viewport={"width": width, "height": height},
            color_scheme=theme,
            locale=LOCALE,
            has_touch=size != "desktop",
            service_workers="allow" if is_kept else "block",
        )
        self._contexts.append(context)
        await context.add_init_script(WATCH_POLICY)
        if not is_first:
            await context.add_init_script(HINTS_SEEN)
        await known_here(context)
        page = await context.new_page()
        entering(page)
        page.set_default_timeout(PAGE_TIMEOUT_MS)
        self._faults[page] = PageFaults(page)
        return page

    def allow(self, page: Page, is_allowed: Callable[[str], bool]) -> None:
        """Let those faults of `page` pass that the test brings about on purpose."""
        self._faults[page].allow(is_allowed)

    async def close(self) -> list[str]:
        """Close every page; return the faults that no test allowed.

        What a page still waits for is logged: pytest shows it when the test has failed.
        """
        for page, faults in self._faults.items():
            for request in faults.unanswered:
                LOG.warning("%s still waits for %s %s", page.url, request.method, request.url)
        for context in self._contexts:
            await context.close()
        return [fault for faults in self._faults.values() for fault in faults.unexpected()]


@pytest.fixture
async def new_page(browser: Browser) -> AsyncIterator[PageMaker]:
    """Open pages; the test fails on console errors, page exceptions and CSP violations."""
    maker = PageMaker(browser)
    yield maker
    faults = await maker.close()
    assert not faults, "the page complained:\n" + "\n".join(faults)


@pytest.fixture
def urc_process() -> Iterator[Callable[..., UrcProcess]]:
    """Start ``urc …`` as a process of its own; whatever happens, it is gone after the test."""
    started: list[UrcProcess] = []

    def start(*arguments: str, **environment: str) -> UrcProcess:
        process = UrcProcess(arguments, environment)
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()


@pytest.fixture
def bot(tmp_path: Path) -> str:
    """Return the file of a robot with a line that stays open, commands, and no defaults."""
    file = tmp_path / "bot.yaml"
    file.write_text(BOT, encoding="utf-8")
    return str(file)
