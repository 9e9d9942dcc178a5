"""Processor time for four videos of 640 × 480 pixels: URC compared with a plain relay.

ffmpeg sends each datagram to URC and to the relay. URC takes the streams apart into access units,
in a process for each camera, and sends the units to a page that confirms them. The relay sends each
datagram to its page as one WebSocket message. Both work in the same run, at the same time.

Ten pages then show the same videos. The number of processes that take streams apart must not grow.

At the end, a page in Chromium shows the four videos: see `bench.video_widgets`.
"""

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

from bench.figures import tell
from bench.harness import Result
from bench.line_page import Plan
from bench.processes import cpu_s
from bench.rig.programs import Program, Server
from bench.video_films import RATE_HZ, film, profile, sending
from bench.video_widgets import document, shown

__all__ = ["run"]

CAMERAS: Final = 4
FILM_KBIT: Final = 1500
PAGES: Final = 10
LASTS_S, LASTS_IF_FULL_S = 10.0, 30.0
GOAL: Final = 2.0
LEAST_SHARE: Final = 0.95
"""Share of the images that the page must have received; otherwise the machine was too busy."""
READY_S: Final = 60.0
_FIRST_PORT: Final = 5610


def run(*, full: bool) -> Sequence[Result]:
    """Compare the processor time of URC's processes with that of the relay."""
    lasts_s = LASTS_IF_FULL_S if full else LASTS_S
    ours = [_FIRST_PORT + place for place in range(CAMERAS)]
    theirs = [port + CAMERAS for port in ours]
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        place = Path(folder)
        sent = film(place, FILM_KBIT)
        file = place / "film.yaml"
        file.write_text(profile("film", ours, more=document(CAMERAS)), "utf-8")
        server = stack.enter_context(Server([file], place / "data"))
        relay = stack.enter_context(
            Program([sys.executable, "-m", "bench.relay_datagrams", *map(str, theirs)])
        )
        relay_port = relay.wait_for("ready", READY_S)[1]
        viewers = [sys.executable, "-m", "bench.viewers", relay_port, "/", "1"]
        watching = stack.enter_context(Program(viewers))
        watching.wait_for("ready", READY_S)
        for ports in zip(ours, theirs, strict=True):
            stack.enter_context(Program(sending(sent, ports)))
        pages = [_page(stack, server)]
        one, count = _measured(server, relay, pages[0], lasts_s), len(_cameras(server))
        pages += [_page(stack, server) for _ in range(PAGES - 1)]
        many, many_count = _measured(server, relay, pages[0], lasts_s), len(_cameras(server))
        for page in pages:
            page.close()
        drawn = shown(f"http://127.0.0.1:{server.port}/robots/film/?key={server.key}", lasts_s)
    _tell("plain relay", 1, one.relay_s / lasts_s, 0)
    _tell("URC", 1, (one.server_s + one.cameras_s) / lasts_s, count)
    _tell("URC", PAGES, (many.server_s + many.cameras_s) / lasts_s, many_count)
    if one.images_hz < LEAST_SHARE * CAMERAS * RATE_HZ:
        raise SystemExit(f"bench: the page got {one.images_hz:.0f} images a second; too few")
    base_s, ours_s = max(0.01, one.relay_s), one.server_s + one.cameras_s
    return [
        _result(f"{CAMERAS} videos: processor time / plain relay", GOAL, base_s, ours_s),
        _result(f"{CAMERAS} videos: demuxers of {PAGES} pages / of a page", 1.0, count, many_count),
        *drawn,
    ]


class _Load(NamedTuple):
    """Processor times in seconds, and the rate of the page's images."""

    relay_s: float
    server_s: float
    cameras_s: float
    """Time of the processes that take the videos apart."""
    images_hz: float


def _tell(program: str, pages: int, core: float, demuxers: int) -> None:
    row = {"program": program, "pages": pages, "core": round(core, 3), "demuxers": demuxers}
    tell({"figure": "video_relay", **row})


def _page(stack: ExitStack, server: Server) -> Program:
    signals = [f"v{place}" for place in range(CAMERAS)]
    plan = Plan("127.0.0.1", server.port, "film", server.key, "apart", signals, drives=False)
    page = stack.enter_context(Program([sys.executable, "-m", "bench.line_page"]))
    page.order(json.dumps(plan._asdict()))
    page.wait_for("ready", READY_S)
    return page


def _measured(server: Server, relay: Program, page: Program, lasts_s: float) -> _Load:
    time.sleep(2.0)  # the streams have begun
    cameras = _cameras(server)
    before = cpu_s([relay.pid, server.pid, *cameras])
    began_s, first = time.monotonic(), _images(page)
    time.sleep(lasts_s)
    images_hz = (_images(page) - first) / (time.monotonic() - began_s)
    after = cpu_s(before)
    spent = {one: after[one] - before[one] for one in before}
    relay_s, server_s = spent.pop(relay.pid), spent.pop(server.pid)
    return _Load(relay_s, server_s, sum(spent.values()), images_hz)


def _images(page: Program) -> int:
    """Return the number of images that a page has received so far."""
    count = len(page.lines)
    page.order("count")
    return int(page.wait_for("images", READY_S, after=count)[1])


def _cameras(server: Server) -> list[int]:
    """Return the processes that take the server's videos apart."""
    found = Path(f"/proc/{server.pid}/task/{server.pid}/children").read_text("ascii").split()
    return [
        int(one) for one in found if b"camera_process" in Path(f"/proc/{one}/cmdline").read_bytes()
    ]


def _result(name: str, goal: float, base: float, ours: float) -> Result:
    ratio = round(ours / base, 3)
    return Result(name, ratio, goal, round(1000 * base, 1), round(1000 * ours, 1), 1.0, 1)
