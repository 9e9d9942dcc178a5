"""Processor time and memory of one server that has many robots and one page for each robot.

Every robot sends 20 signals, 20 times a second, in lines of JSON over TCP. The robot's page
receives each change. Robots and pages run in two other processes, which only send or count bytes.
Additional rows show how the costs grow with the number of robots, signals and pages. These rows
also show the share of the robots' lines that do not reach a page. Drivable robots have guards in
separate processes, which are measured separately.
"""

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.processes import cpu_s, own_mb, resident_mb, spent_s
from bench.rig.programs import Program, Server, peer

__all__ = ["run"]

CORE_SHARE, RESIDENT_MB, LOST = 0.5, 120.0, 0.1
RATE_HZ = 20
SETTLE_S = 2.0
LOOK_S, LOOK_IF_FULL_S = 5.0, 10.0
ROUNDS, ROUNDS_IF_FULL = 1, 5
START_S = 60.0
PROFILE = """\
urc: 1
kind: robot
name: r{number}
title: Robot {number}
transports:
  wire:
    {{ type: tcp, host: 127.0.0.1, port: {port}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
signals: {signals}
messages: {{ all: {{ json: {fields} }} }}
"""
HELD = """\
commands:
  go:
    send: "M {{ value }}"
    args: { value: { type: integer, min: 0 } }
    hold: { repeat: 100ms, release: { value: 0 }, watchdog: none }
"""


class Load(NamedTuple):
    """A server's load: the numbers of robots, signals per robot, and pages."""

    robots: int
    signals: int
    pages: int
    can_drive: bool = False


class Look(NamedTuple):
    """The pages' frame count and the processes' processor times, both since the start."""

    frames: int
    """Number of frames received by all pages."""
    server: dict[int, float]
    """Processor time of the server in seconds, by process id."""
    guards: dict[int, float]


FIELDS = Load._fields
Row = dict[str, Any]
GOAL = Load(100, 20, 100)
LOADS = (
    *(Load(robots, 20, robots) for robots in (1, 10, 25, 50, 100, 200)),
    *(Load(100, signals, 100) for signals in (5, 80)),
    Load(100, 20, 200),
    *(Load(robots, 20, robots, can_drive=True) for robots in (10, 25)),
)
"""Loads to measure with `full`; a server allows one client at most 256 pages."""


def run(*, full: bool) -> Sequence[Result]:
    """Measure the goal's load, or all loads with `full`; store each row."""
    kept = Kept("server_robots-full" if full else "server_robots")
    rounds, loads = (ROUNDS_IF_FULL, LOADS) if full else (ROUNDS, (GOAL,))
    wanted = [load for _ in range(rounds) for load in loads]
    for load in wanted[len(kept.rows) :]:
        kept.add(_measured(load, LOOK_IF_FULL_S if full else LOOK_S))
    rows: list[Row] = [dict(row) for row in kept.end()]
    for load in loads:
        tell(_middle(_of(load, rows)))
    goal = _of(GOAL, rows)
    return [
        _result("processor time of the server / half a core", "server_core", CORE_SHARE, goal),
        _result(f"memory of the server / {RESIDENT_MB:g} MB", "server_mb", RESIDENT_MB, goal),
        # A server that is delayed by a busy machine uses less processor time.
        _result("lines that did not reach a page / a tenth of all lines", "lost", LOST, goal),
    ]


def _of(load: Load, rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if all(row[name] == getattr(load, name) for name in FIELDS)]


def _measured(load: Load, look_s: float) -> Row:
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        port = stack.enter_context(peer("fleet.py", load.signals, RATE_HZ))
        profiles = [_profile(Path(folder), load, number, port) for number in range(load.robots)]
        server = stack.enter_context(Server(profiles, Path(folder, "data")))
        # Each process has one page for each robot. Without pages, the robots are not connected.
        pages = [
            _pages(stack, server, min(load.robots, load.pages - first))
            for first in range(0, load.pages, load.robots)
        ]
        _settle(pages)
        before, began_s = _now(server, pages), time.monotonic()
        time.sleep(look_s)
        after, passed_s = _now(server, pages), time.monotonic() - began_s
        frames = after.frames - before.frames
        return {
            **load._asdict(),
            "server_core": round(spent_s(before.server, after.server) / passed_s, 3),
            "server_mb": round(resident_mb(server.pid), 1),
            "guards_core": round(spent_s(before.guards, after.guards) / passed_s, 3),
            "guards_mb": round(sum(map(own_mb, server.guards)), 1),
            "lost": round(max(0.0, 1 - frames / (passed_s * RATE_HZ * load.pages)), 3),
        }


def _settle(pages: Sequence[Program]) -> None:
    """Wait until each page has received one second's values."""
    end_s = time.monotonic() + START_S
    time.sleep(SETTLE_S)
    while min((each for program in pages for each in _counts(program)), default=RATE_HZ) < RATE_HZ:
        if time.monotonic() > end_s:
            raise SystemExit("bench: a page receives nothing")
        time.sleep(SETTLE_S)


def _now(server: Server, pages: Sequence[Program]) -> Look:
    frames = sum(sum(_counts(program)) for program in pages)
    return Look(frames, cpu_s([server.pid]), cpu_s(server.guards))


def _profile(folder: Path, load: Load, number: int, port: int) -> Path:
    names = [f"s{each}" for each in range(load.signals)]
    number_type = {"type": "number", "min": 0, "max": 100}
    text = PROFILE.format(
        number=number,
        port=port,
        signals=json.dumps(dict.fromkeys(names, number_type)),
        fields=json.dumps({name: name for name in names}),
    )
    file = folder / f"r{number}.yaml"
    file.write_text(text + HELD * load.can_drive, "utf-8")
    return file


def _pages(stack: ExitStack, server: Server, count: int) -> Program:
    command = [sys.executable, "-m", "bench.viewers", str(server.port), "/ws?robot=r{}", str(count)]
    key = ["env", f"URC_BENCH_KEY={server.key}"]
    program = stack.enter_context(Program(command, inside=key))
    program.wait_for("ready", START_S)
    return program


def _counts(pages: Program) -> list[int]:
    """Return the number of frames that each page of a program has received."""
    had = len(pages.lines)
    pages.order("")
    pages.wait_until(lambda: len(pages.lines) > had, START_S, "counts")
    return [frames for frames, _ in json.loads(pages.lines[-1])]


def _middle(rows: Sequence[Row]) -> Row:
    """Return the median of each measured value for one load."""
    figures = {name: median(row[name] for row in rows) for name in rows[0] if name not in FIELDS}
    return {"figure": "server_robots", **{name: rows[0][name] for name in FIELDS}, **figures}


def _result(name: str, column: str, goal: float, rows: Sequence[Row]) -> Result:
    shares = [row[column] / goal for row in rows]
    return Result(
        name=f"100 robots × 20 signals × 20 a second, one page each: {name}",
        ratio=round(median(shares), 3),
        goal=1.0,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=round(max(shares) / (median(shares) or 1.0), 2),
        rounds=len(shares),
    )
