"""One cart, opened by a Python program in each way: in its process, and over a server."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Literal

import urc
import urc.client
from tests.e2e.dashboards import WAIT_S
from urc.client.robot import RobotInterface
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.testing.entry import ACCESS, KEY
from urc.web.app import DashboardOptions, Robot, build_app, serve
from urc.web.serve.access import Access
from urc.web.serve.certificates import Certificates

__all__ = ["Cart", "Opening", "cart_file", "carted", "opened", "served_robot", "until"]

Opening = Literal["here", "server"]

PROFILE = """\
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
signals:
  level: { type: integer, unit: "%" }
  note: { type: string }
  odometer: { type: integer }
messages:
  levels: { regex: '^level (?P<level>\\d+)$' }
  notes: { regex: '^note (?P<note>.*)$' }
  odometers: { regex: '^odometer (?P<odometer>\\d+)$' }
commands:
  ask: { send: "level?", reply: { regex: '^is (?P<level>\\d+)$', errors: ['^ERR.*'] } }
  say: { send: "say {{ word }}", args: { word: { type: string } }, reply: { equals: OK } }
  silent: { send: "silent", reply: { equals: never, timeout: 200ms } }
  erase: { send: "erase", reply: { equals: OK }, confirm: { text: "Erase everything?" } }
  fold: { send: "fold", moves: true }
  drive:
    send: "V {{ speed | round(2) }} {{ turn | round(2) }}"
    args: { speed: { min: -1, max: 1, default: 0 }, turn: { min: -1, max: 1, default: 0 } }
    hold: { repeat: 50ms, lease: LEASE, release: {}, watchdog: none }
MORE
widgets:
  level: { use: bar, bind: { value: level } }
interfaces:
  default: { grid: level }
"""
LIFT = """\
  lift:
    send: "L {{ rate | round(2) }}"
    args: { rate: { min: -1, max: 1, default: 0 } }
    hold: { repeat: 50ms, lease: LEASE, release: {}, watchdog: none }
"""
STOPPED = "V 0 0"
CALM_LEASE = "1s"
"""The longest lease: a shorter pause of a busy machine ends no gesture."""


class Cart:
    """A robot on a line: hears frames with their times, and says what the test tells it to."""

    def __init__(self) -> None:
        self.heard: list[tuple[float, str]] = []
        self.level = 7
        self.is_broken = False
        self._writers: set[asyncio.StreamWriter] = set()

    @property
    def lines(self) -> list[str]:
        """Every frame so far."""
        return [line for _, line in self.heard]

    @property
    def is_moving(self) -> bool:
        """Whether the newest motion frame moves."""
        return self.newest("V") not in ("", "V 0 0", "V 0.0 0.0")

    @property
    def has_line(self) -> bool:
        """Whether URC has connected."""
        return bool(self._writers)

    def newest(self, word: str) -> str:
        """Return the newest frame that begins with `word`."""
        return next((line for line in reversed(self.lines) if line.split()[0] == word), "")

    def stopped_s(self) -> float:
        """Return when the newest stop was heard."""
        return next(at for at, line in reversed(self.heard) if line == self.newest("V"))

    def say(self, *lines: str) -> None:
        """Send lines to URC."""
        for writer in self._writers:
            writer.write("".join(f"{line}\n" for line in lines).encode())

    def cut(self) -> None:
        """Cut the line."""
        for writer in self._writers:
            writer.transport.abort()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Talk until the line ends."""
        self._writers.add(writer)
        try:
            while data := await reader.readline():
                line = data.decode().strip()
                self.heard.append((time.monotonic(), line))
                if line == "level?":
                    said = "ERR broken" if self.is_broken else f"is {self.level}"
                    writer.write(f"{said}\n".encode())
                elif line.startswith(("say", "erase")):
                    writer.write(b"OK\n")
        except OSError:
            pass
        finally:
            self._writers.discard(writer)
            writer.close()


def cart_file(folder: Path, port: int, more: str = "", lease: str = CALM_LEASE) -> Path:
    """Write the cart's profile, with `more` commands, and a lease for all held commands."""
    file = folder / "cart.yaml"
    text = PROFILE.replace("PORT", str(port)).replace("MORE\n", more).replace("LEASE", lease)
    file.write_text(text, "utf-8")
    return file


@asynccontextmanager
async def carted(
    folder: Path, more: str = "", lease: str = CALM_LEASE
) -> AsyncIterator[tuple[Cart, Path]]:
    """Run a cart; give it, and the file of its profile."""
    cart = Cart()
    listener = await asyncio.start_server(cart.serve, "127.0.0.1", 0)
    try:
        yield cart, cart_file(folder, listener.sockets[0].getsockname()[1], more, lease)
    finally:
        listener.close()
        cart.cut()


@asynccontextmanager
async def served_robot(
    file: Path,
    *,
    port: int = 0,
    access: Access = ACCESS,
    certificates: Certificates | None = None,
) -> AsyncIterator[str]:
    """Serve the robot of a profile; give the server's address."""
    catalog = built_in_catalog()
    known = load_profile(file, catalog)
    robot = Robot(known, {}, lambda: Session(known, {}, catalog.transports, motion="guarded"))
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app(
        {known.name: robot},
        DashboardOptions(access=access, linger_s=0.2, certificates=certificates),
    )
    serving = serve(app, port=port, on_ready=ready.set_result, certificates=certificates)
    task = asyncio.create_task(serving)
    try:
        async with asyncio.timeout(WAIT_S):
            await asyncio.wait((ready, task), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield (await ready).rstrip("/")
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)


@asynccontextmanager
async def opened(
    opening: Opening, folder: Path, more: str = ""
) -> AsyncIterator[tuple[Cart, RobotInterface]]:
    """Open a cart in one of the ways; give the cart, and the program's robot."""
    async with AsyncExitStack() as stack:
        cart, file = await stack.enter_async_context(carted(folder, more))
        robot: RobotInterface
        if opening == "here":
            robot = await stack.enter_async_context(urc.connect(file))
        else:
            address = await stack.enter_async_context(served_robot(file))
            robot = await stack.enter_async_context(urc.client.open(address, token=KEY))
        async with asyncio.timeout(WAIT_S):
            await until(lambda: cart.has_line)
            cart.say("note hello")
            await robot.wait_for("note")
        yield cart, robot


async def until(is_true: Callable[[], bool]) -> None:
    """Wait for something on the robot's side."""
    async with asyncio.timeout(WAIT_S):
        while not is_true():  # noqa: ASYNC110 - the robot knows no event
            await asyncio.sleep(0.005)
