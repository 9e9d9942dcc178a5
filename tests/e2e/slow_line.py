"""A real Chromium whose only network is a link with a rate, to a server on the other side."""

from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import ExitStack, asynccontextmanager, contextmanager
from pathlib import Path
from typing import NamedTuple

from playwright.async_api import Page

from bench.rig.programs import SERVER_ADDRESS, Program, Relay, Server
from tests.e2e.browser import running_browser
from tests.e2e.conftest import PageMaker

__all__ = ["SlowLine", "page_on", "slow_line"]


class SlowLine(NamedTuple):
    """A server behind a link."""

    relay: Relay
    server: Server
    folder: Path

    @property
    def address(self) -> str:
        return f"http://{SERVER_ADDRESS}:{self.server.port}/"

    def set_rate(self, kbit: int) -> None:
        """Limit the link in both directions; 0 is no limit."""
        self.relay.do(f"rate {kbit}")


@contextmanager
def slow_line(
    folder: Path, file: Path, cameras: Sequence[Sequence[str]], ready: Callable[[Relay], None]
) -> Iterator[SlowLine]:
    """Serve a robot behind a link, beside the programs that are its cameras.

    `ready` waits until the cameras can be reached.
    """
    with ExitStack() as stack:
        relay = stack.enter_context(Relay())
        there = relay.inside("b")
        for command in cameras:
            stack.enter_context(Program(command, inside=there))
        ready(relay)
        server = Server([file], folder / "data", host=SERVER_ADDRESS, inside=there)
        stack.enter_context(server)
        yield SlowLine(relay, server, folder)


@asynccontextmanager
async def page_on(line: SlowLine) -> AsyncIterator[Page]:
    """Open a page on the near side of the link; the test fails on the faults of a page."""
    # The browser without windows ignores the flag, and decodes videos on secure pages only.
    wrapper = line.folder / "browser"
    secure = f"--unsafely-treat-insecure-origin-as-secure={line.address.rstrip('/')}"
    async with running_browser(
        secure, is_whole=True, inside=line.relay.inside("a"), wrapper=wrapper
    ) as browser:
        maker = PageMaker(browser)
        page = await maker()
        # The page hands in the key itself: nothing else reaches the server.
        await page.goto(f"{line.address}?key={line.server.key}")
        await page.wait_for_url(line.address)
        yield page
        faults = await maker.close()
    assert faults == []
