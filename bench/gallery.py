"""What the whole gallery costs, emulated at once: `urc demo`, alone, looked at, and connected.

Times are of the processor, over all processes of the demo; memory is what they take together, with
what they share counted once. Linux only, because nothing else says that.
"""

import asyncio
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin

from bench.harness import Result

__all__ = ["run"]

CORES, MEMORY_MB, FIRST_PICTURE_S = 1.0, 500.0, 5.0
READY_S = 60.0
SETTLED_S = 4.0
"""After a change: what is done once is over."""
LASTS_S, LASTS_IF_FULL_S = 10.0, 60.0
LOOKS_A_SECOND = 8
"""As many as one page with cards asks for."""
_TICK_S = 1 / os.sysconf("SC_CLK_TCK")


class Dashboard(NamedTuple):
    """The demo's."""

    address: str
    headers: dict[str, str]
    """What a program sends with each request."""


def run(*, full: bool) -> Sequence[Result]:
    """Measure."""
    lasts_s = LASTS_IF_FULL_S if full else LASTS_S
    began = time.monotonic()
    demo = subprocess.Popen(
        [sys.executable, "-m", "urc.cli.main", "demo", "--no-browser", "--port", "0"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        demo_page = _address(demo)
        names = re.findall(r'data-look="([^"]+)"', _get(demo_page).decode())
        _get(demo_page, names[0])
        first_s = time.monotonic() - began
        results = [
            _result("seconds to the first moving picture", first_s, FIRST_PICTURE_S),
            _result("of which the processor's", _seconds(demo.pid), FIRST_PICTURE_S),
        ]
        results += asyncio.run(_measured(demo.pid, demo_page, names, lasts_s))
    finally:
        demo.send_signal(signal.SIGINT)
        code = demo.wait(READY_S)
    return [*results, _result("exit code after Ctrl-C", float(code), 0.0)]


def _address(demo: "subprocess.Popen[str]") -> Dashboard:
    assert demo.stdout is not None
    for line in demo.stdout:
        if match := re.search(r"dashboard (http://\S+)\?key=(\S+)", line):
            return Dashboard(match[1], {"Authorization": f"Bearer {match[2]}"})
    raise SystemExit("bench: the demo did not begin")


def _get(at: Dashboard, path: str = "") -> bytes:
    url = at.address + path.removeprefix("/")
    asked = urllib.request.Request(url, headers=at.headers)  # noqa: S310 - of this machine
    with urllib.request.urlopen(asked, timeout=READY_S) as answer:  # noqa: S310
        return bytes(answer.read())


async def _measured(pid: int, at: Dashboard, looks: Sequence[str], lasts_s: float) -> list[Result]:
    """Measure alone, then with a page of cards, then with every robot connected as well."""
    results = await _cost(pid, f"{len(looks)} robots emulated, alone", lasts_s)
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(_look(at, looks))]
        results += await _cost(pid, "with a page of live cards", lasts_s)
        for look in looks:
            tasks.append(group.create_task(_visit(at, look.split("/")[2])))
        results += await _cost(pid, "with every robot connected as well", lasts_s)
        for task in tasks:
            task.cancel()
    return results


async def _look(at: Dashboard, looks: Sequence[str]) -> None:
    place = 0
    while True:
        await asyncio.to_thread(_get, at, looks[place % len(looks)])
        place += 1
        await asyncio.sleep(1 / LOOKS_A_SECOND)


async def _visit(at: Dashboard, robot: str) -> None:
    """Be a page of a robot: take what is said."""
    place = urlsplit(at.address).netloc
    line = f"ws://{place}/ws?robot={robot}"
    with suppress(ConnectionClosed):
        origin = Origin(f"http://{place}")
        async with connect(
            line, max_size=None, origin=origin, additional_headers=at.headers
        ) as page:
            async for _ in page:
                pass


async def _cost(pid: int, what: str, lasts_s: float) -> list[Result]:
    """Return cores and megabytes while nothing changes."""
    await asyncio.sleep(SETTLED_S)
    before = {each: _seconds(each) for each in _family(pid)}
    began = time.monotonic()
    await asyncio.sleep(lasts_s)
    took_s = time.monotonic() - began
    family = _family(pid)
    cores = sum(_seconds(each) - before.get(each, 0.0) for each in family) / took_s
    memory = sum(map(_megabytes, family))
    return [
        _result(f"cores, {what}", cores, CORES),
        _result(f"megabytes, {what}, {len(family)} processes", memory, MEMORY_MB),
    ]


def _family(pid: int) -> list[int]:
    """Return a process and all that it started."""
    found = [pid]
    for one in found:
        for task in Path(f"/proc/{one}/task").glob("*/children"):
            with suppress(OSError):
                found += map(int, task.read_text("ascii").split())
    return found


def _seconds(pid: int) -> float:
    with suppress(OSError):
        words = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) * _TICK_S
    return 0.0


def _megabytes(pid: int) -> float:
    with suppress(OSError):
        text = Path(f"/proc/{pid}/smaps_rollup").read_text("ascii")
        return sum(int(match) for match in re.findall(r"^Pss:\s+(\d+)", text, re.M)) / 1024
    return 0.0


def _result(name: str, found: float, goal: float) -> Result:
    return Result(
        name=f"gallery: {name}",
        ratio=round(found, 3),
        goal=goal,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=1.0,
        rounds=1,
    )
