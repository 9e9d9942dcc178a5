"""A repository for tests of the managers' pages, the robot that its driver is for, a dashboard."""

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple

from tests.e2e.processes import UrcProcess
from tests.unit.packages.made import accepted, keep_settings, write_package
from urc.cli.dashboard import DashboardAddress, robot_options_of
from urc.model.profile import Profile
from urc.packages.install import plan_requirement
from urc.packages.names import parse_requirement
from urc.packages.repositories import Repositories
from urc.packages.signature import new_signer
from urc.packages.store import Store
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, build_app, serve
from urc.web.fleet.robot_factory import RobotFactory

__all__ = [
    "GONE",
    "Shop",
    "emulated_rover",
    "fill_lab",
    "install",
    "newer_rover",
    "running_managed",
    "running_shop",
    "set_up",
    "static_server",
]

GOT: dict[str, tuple[str, ...]] = {"bare": (), "full": ("drivers/rover", "interfaces/wide")}
"""Name of a data folder → what was installed into it."""
WAIT_S = 30.0
GONE = "(gone)"
"""Is heard when a line to the rover ends."""

_DRIVER = """\
title: Rover
settings:
  host: {{ type: host, title: Robot address }}
  camera: {{ type: host, default: 127.0.0.1, title: Camera address }}
  port: {{ type: port, default: 6789 }}
  speed: {{ type: integer, min: 1, max: 9, default: 3, title: Pace }}
  look: {{ type: choice, choices: [dawn, dusk], default: dawn }}
  key: {{ type: string, secret: true, title: Key }}
transports:
  wire:
    type: tcp
    host: "{{{{ settings.host }}}}"
    port: "{{{{ settings.port }}}}"
    timeouts: {{ connect: 2s }}
    framing: {{ type: delimiter, tx: LF, rx: LF }}
  eye:
    type: tcp
    host: "{{{{ settings.camera }}}}"
    port: "{{{{ settings.port }}}}"
    timeouts: {{ connect: 2s }}
    framing: {{ type: delimiter, tx: LF, rx: LF }}
signals:
  battery: {{ type: integer, unit: "%", min: 0, max: 100 }}
polls:
  - every: 200ms
    to: wire
    send: "{ask} {{{{ settings.speed }}}} {{{{ settings.look }}}}"
    reply: {{ regex: '^(?P<battery>\\d+)$' }}
commands:
  shout: {{ to: eye, send: "{{{{ settings.key }}}}" }}
widgets:
  battery: {{ use: dial, bind: {{ level: battery }} }}
  charge: {{ use: battery, bind: {{ level: battery }} }}
"""
_INTERFACE = "title: {title}\ngrid: |\n  {grid}\n"


def fill_lab(folder: Path) -> None:
    """Write a driver with its widget, two interfaces, and a lone widget."""
    for name in ("dial", "lamp"):
        home = write_package(folder, "widget", name, "1.0.0")
        (home / "widget.css").write_text("b { display: block; }\n", encoding="utf-8")
    plain = _INTERFACE.format(title="Plain", grid="battery")
    write_package(folder, "interface", "plain", "1.0.0", text=plain)
    wide = _INTERFACE.format(title="Wide", grid=". charge .")
    write_package(folder, "interface", "wide", "1.0.0", text=wide)
    _write_rover(folder, "1.0.0", "charge?")


def newer_rover(folder: Path) -> None:
    """Write the driver's next version, which says something else to the robot."""
    _write_rover(folder, "1.1.0", "battery?")


def _write_rover(folder: Path, version: str, ask: str) -> None:
    needs = {"widgets/dial": "^1", "interfaces/plain": "*"}
    write_package(folder, "driver", "rover", version, needs, text=_DRIVER.format(ask=ask))


@asynccontextmanager
async def emulated_rover(heard: list[str]) -> AsyncIterator[int]:
    """Be the rover on a free port: it answers whatever asks for its charge; give the port."""
    lines: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        lines.add(task)
        try:
            while line := await reader.readline():
                heard.append(line.decode().strip())
                if "?" in heard[-1]:
                    writer.write(b"42\n")
                    await writer.drain()
        except (OSError, asyncio.CancelledError):
            pass
        finally:
            lines.discard(task)
            heard.append(GONE)
            writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in tuple(lines):
            task.cancel()


def install(data: Path, url: str, *packages: str) -> None:
    """Know a repository, and have some of its packages, as somebody who did it before."""
    known = Repositories(data / "packages", print)
    known.add(url)
    store = Store(data / "packages")
    for package in packages:
        plan = plan_requirement(parse_requirement(package), known.all(), store, print)
        with store.changing() as change:
            change.stage(accepted(plan))
            change.commit(plan)


def set_up(data: Path, port: int, host: str = "127.0.0.1") -> None:
    """Have the rover's settings filled in."""
    settings = {"host": host, "port": str(port), "key": "open sesame"}
    keep_settings(data, "rover", settings)


@asynccontextmanager
async def running_managed(
    data: Path, profiles: Sequence[Profile] = (), *, is_dev: bool = False
) -> AsyncIterator[str]:
    """Serve what `urc serve --data-dir DATA` would; give the address, and end cleanly."""
    place = DashboardAddress("127.0.0.1", 0, data=data, shows_installed=not profiles)
    robot_options = robot_options_of(place)
    factory = RobotFactory(robot_options)
    robots = {one.name: factory.robot(one.name, one) for one in profiles}
    remake = {name: partial(factory.robot, name) for name in robots} if is_dev else None
    app = build_app(
        robots,
        DashboardOptions(
            access=ACCESS, data=data, remake=remake, robot_options=robot_options, linger_s=0.2
        ),
    )
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        async with asyncio.timeout(WAIT_S):
            await asyncio.wait((ready, task), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield await ready
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await asyncio.wait((task,), timeout=WAIT_S)


class Shop(NamedTuple):
    """A repository that runs, one that has been switched off, and what was got from each."""

    lab: Path
    url: str
    gone_url: str
    folders: dict[tuple[bool, str], Path]
    """Whether it runs, and ``bare`` or ``full`` → a data folder."""


@contextmanager
def running_shop(home: Path) -> Iterator[Shop]:
    """Run `urc repo serve` while the context lasts; a second repository is off from the start."""
    lab = home / "lab"
    fill_lab(lab)
    folders: dict[tuple[bool, str], Path] = {}
    urls = {}
    key = home / "keeper.pem"
    new_signer("Keeper", key)
    words = ["repo", "serve", str(lab), "--port", "0", "--name", "Lab", "--key", str(key)]
    on = UrcProcess(words, {})
    try:
        urls[True] = on.wait_for(r"^repository (http://\S+)$")[1]
        with static_server(lab) as urls[False]:
            for is_on, url in urls.items():
                for kind, packages in GOT.items():
                    folder = folders[is_on, kind] = home / f"{kind}-{is_on}"
                    install(folder, url, *packages)
        yield Shop(lab, urls[True], urls[False], folders)
    finally:
        on.kill()


@contextmanager
def static_server(folder: Path) -> Iterator[str]:
    """Give out a folder as any web server does; it is off when the context ends."""
    handler = partial(QuietHandler, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{http.server_port}/"
        finally:
            http.shutdown()
            thread.join(10)


class QuietHandler(SimpleHTTPRequestHandler):
    """Says nothing of what it does."""

    def log_message(self, *_: object) -> None:
        """Keep quiet."""
