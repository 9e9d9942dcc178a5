"""A link that holds things up: the page makes a second line, and drives on over it."""

import asyncio

import pytest
from playwright.async_api import WebSocketRoute

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.driving import calmly_driven, fresh, moved, push

pytestmark = [pytest.mark.anyio, pytest.mark.alone]

FAR_S = 0.1


class Link:
    """The way of the page's own line, which may hold up what is said on it."""

    def __init__(self) -> None:
        self.is_slow = False
        self.held: list[str | bytes] = []
        self.on_spare: list[str | bytes] = []
        """What was said on second lines."""
        self._server: WebSocketRoute | None = None

    async def open(self, line: WebSocketRoute) -> None:
        """Pass on what is said, on a second line at once."""
        server = line.connect_to_server()
        if "/spare" not in line.url:
            self._server = server
            line.on_message(self._pass)
            server.on_message(lambda text: self._answer(line, text))
            return

        def take(text: str | bytes) -> None:
            self.on_spare.append(text)
            server.send(text)

        line.on_message(take)

    def _pass(self, text: str | bytes) -> None:
        assert self._server is not None
        if self.is_slow:
            self.held.append(text)
        else:
            self._server.send(text)

    def _answer(self, line: WebSocketRoute, text: str | bytes) -> None:
        """Let the way there and back seem long: a page that drives then makes a second line."""
        if '"pong"' in str(text):
            asyncio.get_running_loop().call_later(FAR_S, line.send, text)
        else:
            line.send(text)

    def catch_up(self) -> None:
        """Deliver all that was held up, as a connection does that has repeated what it lost."""
        self.is_slow = False
        held, self.held = self.held, []
        for text in held:
            self._pass(text)


async def test_a_line_that_is_held_up_neither_stops_the_robot_nor_moves_it_later(
    new_page: PageMaker,
) -> None:
    """Ticks and the release go over the other; what the first one brings late has no effect."""
    async with calmly_driven() as (robot, address):
        page, link = await fresh(new_page), Link()
        await page.route_web_socket("**/ws**", link.open)
        await page.goto(address)
        await page.wait_for_selector("[data-cell='0'] .joystick[data-phase='idle']")
        await push(page)
        await until(lambda: any(map(is_tick, link.on_spare)))
        link.is_slow = True
        count = len(robot.line.written)
        await until(lambda: len(moved(robot.after(count))) > 5)
        assert "drive stop" not in robot.line.texts
        await page.mouse.up()
        await until(lambda: any('"release"' in str(text) for text in link.held))
        await robot.until_stopped()
        count = len(robot.line.written)
        link.catch_up()
        await asyncio.sleep(0.3)
        assert robot.after(count) == []


def is_tick(text: str | bytes) -> bool:
    """Return whether it is a tick."""
    return '"tick"' in str(text)
