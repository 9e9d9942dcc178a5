"""A robot with sticks and buttons for tests in a real browser, and hands that hold them."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path

from playwright.async_api import CDPSession, Locator, Page

from tests.e2e.browser import PLAIN_HOST, SIZES
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import WAIT_S, until
from urc.model.driver import Argument, Command
from urc.model.exchange import Hold
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.payload import WriteSpec
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS
from urc.testing.movers import FakeMotionBackend
from urc.web.app import DashboardOptions, Robot, build_app, serve

SEND = WriteSpec("text", {})
LEASE_S = 0.25
PUSH_S = 3.0
"""Time for the effect of one push, in seconds."""
CALM_LEASE_S = 120.0
"""For tests that are not about the lease: no pause of a busy machine ends a gesture. No document
may have one so long; see `unhurried`."""


def number(name: str, least: float = -1.0, most: float = 1.0) -> Argument:
    """Return an argument that is 0 when nobody says anything."""
    return Argument(name, min=least, max=most, default=0.0, is_required=False)


def held(name: str, *arguments: Argument, lease_s: float = LEASE_S) -> Command:
    """Return a held command; all zeros stop it."""
    release = {one.name: 0.0 for one in arguments}
    named = {one.name: one for one in arguments}
    return Command(name, "wire", SEND, named, hold=Hold(0.02, release, lease_s))


def commands(lease_s: float) -> dict[str, Command]:
    """Return what the robot can be told."""
    return {
        "drive": held("drive", number("speed", -2.0, 2.0), number("turn"), lease_s=lease_s),
        "lift": held("lift", number("rate", -0.5, 0.5), lease_s=lease_s),
    }


USES = (
    WidgetUse(
        "left", "joystick", {}, {"moved": "drive"}, {"axes": "x", "expo": 0.0, "dead_zone": 0.0},
        title="Throttle", given={"moved": OutputBinding({"speed": "x"})},
    ),
    WidgetUse(
        "right", "joystick", {}, {"moved": "drive"}, {"axes": "y", "expo": 0.0, "dead_zone": 0.0},
        title="Steering", given={"moved": OutputBinding({"turn": "y"})},
    ),
    WidgetUse(
        "up", "hold-button", {}, {"held": "lift"}, {"label": "Lift"},
        given={"held": OutputBinding({"rate": "level"})},
    ),
)  # fmt: skip
LEFT, RIGHT, UP = "[data-cell='0'] .joystick-pad", "[data-cell='1'] .joystick-pad", "#cell-2-main"
STOP = "[data-stop-button]"


class Wire(FakeRobot):
    """A robot whose line keeps what was written, with the time of each."""

    def __init__(self, *changed: WidgetUse, lease_s: float = LEASE_S) -> None:
        """Make a robot; `changed` take the place of what fills their slots."""
        uses = {use.slot: use for use in (*USES, *changed)}
        super().__init__(dashboard_profile(uses=tuple(uses.values()), commands=commands(lease_s)))

    @property
    def line(self) -> FakeMotionBackend:
        """What was written."""
        assert isinstance(self.backend, FakeMotionBackend)
        return self.backend

    def after(self, count: int) -> list[str]:
        """Return what was written after the first `count`."""
        return self.line.texts[count:]

    async def until_moving(self, command: str = "drive") -> None:
        """Wait for motion that is more than nothing."""
        await until(lambda: self.is_moving(command))

    def is_moving(self, command: str = "drive") -> bool:
        """Return whether one of the newest frames moves."""
        return any(is_motion(text, command) for text in self.line.texts[-3:])

    async def until_stopped(self, command: str = "drive") -> float:
        """Wait until the newest word about `command` is its stop; return when it was written."""
        await until(lambda: self.newest(command) == f"{command} stop")
        return next(at for at, text in reversed(self.line.written) if text.startswith(command))

    def newest(self, command: str) -> str:
        """Return the newest word about `command`."""
        return next((text for text in reversed(self.line.texts) if text.startswith(command)), "")

    def values(self, command: str) -> dict[str, float]:
        """Return the arguments of the newest motion."""
        pairs = (word.split("=") for word in self.newest(command).split()[1:] if "=" in word)
        return {name: float(value) for name, value in pairs}


def is_motion(text: str, command: str) -> bool:
    """Return whether a frame moves: any of its values is not nought."""
    return text.startswith(command) and any(
        float(word.split("=")[1]) != 0 for word in text.split()[1:] if "=" in word
    )


@asynccontextmanager
async def driven(
    data: Path | None = None, robot: Wire | None = None
) -> AsyncIterator[tuple[Wire, str]]:
    """Serve a robot that moves; give it and the address of its page."""
    wire = robot or Wire()
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app(
        {"puppet": Robot(wire.profile, {}, wire.open)},
        DashboardOptions(access=ACCESS, allowed_hosts=[PLAIN_HOST], linger_s=0.2, data=data),
    )
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        async with asyncio.timeout(WAIT_S):
            await asyncio.wait((ready, task), return_when=asyncio.FIRST_COMPLETED)
        yield wire, f"{await ready}robots/puppet/"
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)


def calmly_driven(data: Path | None = None) -> AbstractAsyncContextManager[tuple[Wire, str]]:
    """Serve a robot as `driven` does, for tests that are not about the lease."""
    return driven(data, Wire(lease_s=CALM_LEASE_S))


async def fresh(new_page: PageMaker, size: str = "desktop") -> Page:
    """Return an empty page, which may outlive the server by a moment."""
    page = await new_page(size=size)  # type: ignore[arg-type]
    # Refused, or reset while it was being let in.
    new_page.allow(page, lambda text: "WebSocket" in text and "ERR_CONNECTION_RE" in text)
    return page


async def opened(new_page: PageMaker, address: str, size: str = "desktop") -> Page:
    """Open the robot's page and wait until it can be driven."""
    page = await fresh(new_page, size)
    await page.goto(address)
    await page.wait_for_function(
        "() => document.querySelector('[data-who]').textContent.match(/driv/)"
        " && document.querySelector('[data-cell=\"0\"] .joystick')?.dataset.phase === 'idle'"
    )
    return page


async def centre(page: Page, selector: str) -> tuple[float, float]:
    """Return the middle of an element, in pixels of the window."""
    await page.locator(selector).scroll_into_view_if_needed()
    box = await page.locator(selector).bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


async def push(page: Page, selector: str = LEFT, right: float = 0, up: float = 60) -> None:
    """Press the mouse on a stick, and move it by so many pixels; it stays down."""
    x, y = await centre(page, selector)
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x + right, y - up, steps=3)


async def push_until(is_driven: Callable[[], bool], page: Page, selector: str = LEFT) -> None:
    """Push a stick until it drives; push again if a busy machine has ended the gesture."""
    end_s = asyncio.get_running_loop().time() + WAIT_S
    while True:
        await push(page, selector)
        try:
            async with asyncio.timeout(PUSH_S):
                await until(is_driven)
            return
        except TimeoutError:
            assert asyncio.get_running_loop().time() < end_s, "no push drove the robot"
            await page.mouse.up()


async def fire(page: Page, script: str) -> None:
    """Let something happen in the page."""
    await page.evaluate(script)


async def drawn(page: Page) -> None:
    """Wait until the page has drawn a frame that began after this."""
    await page.evaluate(
        "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )


class Fingers:
    """Several fingers on one screen."""

    def __init__(self, page: Page, session: CDPSession) -> None:
        self._page = page
        self._session = session
        self._down: dict[int, tuple[float, float]] = {}

    async def put(self, finger: int, x: float, y: float) -> None:
        """Put a finger down, or move it."""
        kind = "touchMove" if finger in self._down else "touchStart"
        self._down[finger] = (x, y)
        await self._send(kind, self._down)

    async def lift(self, finger: int) -> None:
        """Lift a finger."""
        await self._send("touchEnd", {finger: self._down.pop(finger)})

    async def turn(self, *, is_landscape: bool) -> None:
        """Turn a phone with its fingers on it; return after the page has its new size."""
        width, height = sorted(SIZES["phone"], reverse=is_landscape)
        orientation = {"type": "landscapePrimary", "angle": 90} if is_landscape else {
            "type": "portraitPrimary", "angle": 0
        }  # fmt: skip
        await self._session.send(
            "Emulation.setDeviceMetricsOverride",
            {
                "width": width,
                "height": height,
                "deviceScaleFactor": 0,
                "mobile": False,
                "screenOrientation": orientation,
            },
        )
        await self._page.wait_for_function("(width) => innerWidth === width", arg=width)

    async def _send(self, kind: str, which: Mapping[int, tuple[float, float]]) -> None:
        points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in which.items()]
        await self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


async def fingers_on(page: Page) -> Fingers:
    """Return fingers for a page."""
    return Fingers(page, await page.context.new_cdp_session(page))


def text_of(page: Page, selector: str) -> Locator:
    """Return an element, to ask for its text."""
    return page.locator(selector)


def silence(wire: Wire) -> Callable[[], bool]:
    """Return whether nothing was written since now."""
    count = len(wire.line.written)
    return lambda: len(wire.line.written) == count


def moved(texts: list[str], command: str = "drive") -> Mapping[int, str]:
    """Return the frames among `texts` that move, by their place."""
    return {place: text for place, text in enumerate(texts) if is_motion(text, command)}


class Lateness:
    """How late this loop itself was, at worst: what no bound on a robot can leave out."""

    def __init__(self) -> None:
        self.most_s = 0.0

    async def watch(self) -> None:
        """Look every 10 ms, until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            due_s = loop.time() + 0.01
            await asyncio.sleep(0.01)
            self.most_s = max(self.most_s, loop.time() - due_s)


@asynccontextmanager
async def lateness() -> AsyncIterator[Lateness]:
    """Measure it for as long as the block lasts."""
    found = Lateness()
    task = asyncio.create_task(found.watch())
    try:
        yield found
    finally:
        task.cancel()
