"""Ticks between two sites of a fleet while their data session is overloaded with pictures.

A robot with a camera is at one site, the dashboard at another one, behind a router. A line with a
limited rate carries the data session between the dashboard and the router; the control session has
a line without a limit. Pages show more pictures than the data session can carry. In the same run, a
page drives the robot over both sites, without and with these pages.
"""

import json
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median

from bench.figures import tell
from bench.fleet_ticks import driven
from bench.harness import Result
from bench.motion_path import PROFILE
from bench.rig.fleet import FleetSite
from bench.rig.picture_source import IMAGE_BYTES, LINE_BYTES_S, RATE_HZ
from bench.rig.programs import HERE, Program, Robots, Server
from tests.e2e.ports import free_pair

__all__ = ["run"]

TICKS, TICKS_IF_FULL = 150, 300
ROUNDS, ROUNDS_IF_FULL = 3, 9
PAGES = 5
OVERLOAD = PAGES * IMAGE_BYTES * RATE_HZ / LINE_BYTES_S
"""Pictures that the pages request, as a multiple of the data line's rate."""
TIMES = 1.5
"""Largest ratio of the 95th percentile of a tick's time, with pictures to without them."""
START_S = 60.0
SETTLE_S = 2.0
CAMERA = """\
  eye: {{ type: http, url: "http://127.0.0.1:{camera}" }}
signals:
  picture: {{ type: image, size: 100000 }}
messages:
  eye: {{ from: eye, subscribe: {{ topic: /, stream: mjpeg }}, raw: picture }}
commands:
  go:
    to: wire
"""


def run(*, full: bool) -> Sequence[Result]:
    """Measure without and with pictures in turn."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    alone: list[list[float]] = []
    beside: list[list[float]] = []
    carried: list[float] = []
    with _sites() as (office, robots):
        driven(office.server, "path@mill", robots, ticks)  # warms up
        for _ in range(rounds):
            alone.append(sorted(driven(office.server, "path@mill", robots, ticks)))
            with _pages(office.server) as rate:
                beside.append(sorted(driven(office.server, "path@mill", robots, ticks)))
            carried += rate
    ratios = [_p95(after) / _p95(before) for after, before in zip(beside, alone, strict=True)]
    for way, times, shown in (
        ("no pictures", alone, 0.0),
        (f"pictures, {OVERLOAD:g} × the data line", beside, median(carried)),
    ):
        tell(
            {
                "figure": "fleet_overload",
                "way": way,
                "p50_ms": round(median(one[len(one) // 2] for one in times), 2),
                "p95_ms": round(median(map(_p95, times)), 2),
                "images_hz": round(shown / IMAGE_BYTES, 1),
            }
        )
    return [
        Result(
            name=f"p95 of ticks between sites: data session {OVERLOAD:g} × overloaded / idle",
            ratio=round(median(ratios), 3),
            goal=TIMES,
            baseline_ms=round(median(map(_p95, alone)), 2),
            subject_ms=round(median(map(_p95, beside)), 2),
            spread=round(max(ratios) / median(ratios), 2),
            rounds=rounds,
        )
    ]


@contextmanager
def _sites() -> Iterator[tuple[FleetSite, Robots]]:
    """Run a router, a site with a robot and a camera, and the dashboard's site."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"]))
        port, way = free_pair(), free_pair()
        script = str(HERE / "picture_source.py")
        source = stack.enter_context(Program([sys.executable, "-P", script, str(way), str(port)]))
        camera = int(source.wait_for("ready", START_S)[1])
        text = PROFILE.replace("commands:\n  go:\n", CAMERA)
        document = text.format(port=robots.ports[0], camera=camera)
        hub, mill, office = (
            FleetSite(name, Path(folder, name), [document]) for name in ("hub", "mill", "office")
        )
        hub.command("fleet", "init", "rig", "--site", "hub", "--listen", f"127.0.0.1:{port}")
        for guest, first in ((mill, port), (office, way)):
            address = f"127.0.0.1:{first}"
            code = hub.command("fleet", "invite", guest.name, "--address", address)
            guest.command("fleet", "join", code)
        for site in (hub, mill, office):
            stack.callback(site.close)
            site.start()
        for guest in (mill, office):
            end_s = time.monotonic() + START_S
            while json.loads(guest.command("fleet", "status", "--format", "json"))["is_invitation"]:
                if time.monotonic() > end_s:
                    raise TimeoutError(f"the site {guest.name} has not renewed its certificate")
        yield office, robots


@contextmanager
def _pages(server: Server) -> Iterator[list[float]]:
    """Show the camera on several pages; afterwards, the list has the carried bytes a second."""
    rate: list[float] = []
    plan = {
        "host": server.host,
        "port": server.port,
        "robot": "path@mill",
        "key": server.key,
        "way": "apart",
        "signals": ["picture"],
        "drives": False,
    }
    with ExitStack() as stack:
        command = [sys.executable, "-m", "bench.line_page"]
        pages = [stack.enter_context(Program(command)) for _ in range(PAGES)]
        for page in pages:
            page.order(json.dumps(plan))
        for page in pages:
            page.wait_for("ready", START_S)
        began_s = time.monotonic()
        time.sleep(SETTLE_S)
        yield rate
        lasted_s = time.monotonic() - began_s
        for page in pages:
            page.order("end")
        told = [_end(page) for page in pages]
        rate.append(sum(one["bytes"] for one in told) / lasted_s)


def _end(page: Program) -> dict[str, float]:
    page.wait_until(lambda: page.lines[-1].startswith("{"), START_S, "the page's figures")
    found: dict[str, float] = json.loads(page.lines[-1])
    return found


def _p95(ordered: Sequence[float]) -> float:
    return ordered[round((len(ordered) - 1) * 0.95)]
