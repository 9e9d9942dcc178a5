"""The way of a tick from the page's socket to the robot's, beside bare relays in C and Python.

Each tick's time is taken just before it is given to the page's socket, and just after the robot
took its line from its own; both by one clock. All three ways run in the same run, in turns.
URC's has the checks of the contract, the engine, and the pipe to the guard in it.
"""

import json
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from bench.figures import tell
from bench.harness import Result
from bench.rig.operator_process import Page, Plan
from bench.rig.programs import Program, Robots, Server

__all__ = ["PROFILE", "TimedPage", "run", "ticks_of"]

TIMES_C = 2.0
TIMES_PYTHON = 1.5
TICKS, TICKS_IF_FULL = 150, 600
ROUNDS, ROUNDS_IF_FULL = 3, 7
TICK_NS = 20_000_000
"""50 a second: faster than pages tick, slower than the profile lets through."""
SETTLE_NS = 100_000_000
LEAST_SHARE = 0.5
"""A busy machine thins some ticks out; below this share nothing is said."""
PROFILE = """\
urc: 1
kind: robot
name: path
title: Path
transports:
  wire:
    {{ type: tcp, host: 127.0.0.1, port: {port}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
commands:
  go:
    send: "M {{{{ value }}}}"
    args: {{ value: {{ type: integer, min: 0 }} }}
    hold: {{ repeat: 10ms, release: {{ value: 0 }}, watchdog: none }}
"""

Ticker = Callable[[int], int]


class TimedPage(Page):
    """A page that says when it gave a tick to its socket."""

    def begin_anew(self) -> None:
        """Do what a person does after a stop: let go, and take the controls for a new gesture."""
        self.let_go()
        self.has_let_go = False
        self.say({"t": "drive", "verb": "leave"})
        self.wait(time.monotonic_ns() + SETTLE_NS)
        self.take_controls()
        self.refusal = ""

    def tick_number(self, number: int) -> int:
        """Send a tick with `number` as its value; return when, in nanoseconds."""
        self.hear()  # the newest beat
        self.sent += 1
        body = {
            "t": "tick",
            "command": "go",
            "epoch": self.epoch,
            "number": self.sent,
            "echo": self.beat,
            "arguments": {"value": number},
        }
        data = json.dumps(body, separators=(",", ":")).encode()
        # A mask of zeros is a mask: it leaves the work of masking out of what is measured.
        frame = bytes([0x81, 0xFE]) + len(data).to_bytes(2, "big") + bytes(4) + data
        sent_ns = time.monotonic_ns()
        self.socket.sendall(frame)
        return sent_ns


def run(*, full: bool) -> Sequence[Result]:
    """Measure the three ways in turns."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        place = Path(folder)
        ways: dict[str, Callable[[], list[float]]] = {}
        compiled = _compiled(place)
        if compiled:
            ways["C relay"] = stack.enter_context(_bare([str(compiled), "0"], ticks))
        else:
            print(json.dumps({"left_out": "motion_path C relay: no C compiler"}))
        plain = [sys.executable, "-m", "bench.relay_plain"]
        ways["Python relay"] = stack.enter_context(_bare(plain, ticks))
        ways["URC"] = stack.enter_context(_urc(place, ticks))
        taken: dict[str, list[float]] = {name: [] for name in ways}
        medians: dict[str, list[float]] = {name: [] for name in ways}
        for number in range(rounds + 1):
            for name, way in ways.items():
                times = way()
                if number:  # the first round does not count
                    taken[name] += times
                    medians[name].append(statistics.median(times))
    for name, times in taken.items():
        tell(_distribution(name, times))
    goals = {"C relay": TIMES_C, "Python relay": TIMES_PYTHON}
    return [_result(name, medians, goal) for name, goal in goals.items() if name in medians]


def _compiled(folder: Path) -> Path | None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    made = folder / "relay"
    source = Path(__file__).with_name("relay.c")
    subprocess.run([compiler, "-O2", "-o", str(made), str(source)], check=True, timeout=60)
    return made


@contextmanager
def _bare(command: Sequence[str], ticks: int) -> Iterator[Callable[[], list[float]]]:
    """Run a bare relay; it takes any page at its word."""
    with Robots(["tcp:127.0.0.1:0"]) as robots, Program([*command, str(robots.ports[0])]) as relay:
        port = int(relay.wait_for("ready")[1])
        page = TimedPage(Plan(1, "127.0.0.1", port, "", "", 0))
        yield lambda: ticks_of(page, robots, ticks)
        page.socket.close()
        relay.signal(signal.SIGTERM)


@contextmanager
def _urc(folder: Path, ticks: int) -> Iterator[Callable[[], list[float]]]:
    """Run the real server with its guard."""
    with Robots(["tcp:127.0.0.1:0"]) as robots:
        file = folder / "path.yaml"
        file.write_text(PROFILE.format(port=robots.ports[0]), "utf-8")
        with Server([file], folder / "data") as server:

            def one_round() -> list[float]:
                # A page of its own: one that waits for the others' rounds answers no ping, and is
                # closed.
                page = TimedPage(Plan(1, "127.0.0.1", server.port, "path", "", 0, key=server.key))
                try:
                    page.take_controls()
                    page.wait(time.monotonic_ns() + 100_000_000)
                    return ticks_of(page, robots, ticks)
                finally:
                    page.socket.close()

            yield one_round


def ticks_of(page: TimedPage, robots: Robots, ticks: int) -> list[float]:
    """Tick; return the time of each tick that came, in milliseconds."""
    first = len(robots.heard[0]) + 1
    sent: dict[int, int] = {}
    next_ns = time.monotonic_ns()
    for number in range(first, first + ticks):
        page.wait(next_ns)
        if page.refusal:  # a busy machine was silent for longer than the lease
            page.begin_anew()
            next_ns = time.monotonic_ns()
        sent[number * 1000] = page.tick_number(number * 1000)
        next_ns += TICK_NS
    page.wait(next_ns + SETTLE_NS)  # what was thinned out or waits for the line comes now
    page.let_go()
    page.has_let_go = False
    page.wait(time.monotonic_ns() + SETTLE_NS)
    page.refusal = ""
    heard = {int(one.text[2:]): one.time_ns for one in robots.heard[0]}
    came = [(heard[value] - at) / 1e6 for value, at in sent.items() if value in heard]
    if len(came) < ticks * LEAST_SHARE:
        raise SystemExit(f"bench: {len(came)} of {ticks} ticks came; {page.refusal}")
    return came


def _distribution(name: str, times: Sequence[float]) -> dict[str, object]:
    ordered = sorted(times)
    last = len(ordered) - 1
    return {
        "figure": "motion_path",
        "way": name,
        "ticks": len(ordered),
        "p50_us": round(ordered[last // 2] * 1000),
        "p99_us": round(ordered[round(last * 0.99)] * 1000),
        "max_us": round(ordered[-1] * 1000),
    }


def _result(name: str, medians: dict[str, list[float]], goal: float) -> Result:
    bases, ours = medians[name], medians["URC"]
    pairs = zip(bases, ours, strict=True)
    return Result(
        name=f"motion path: tick to robot / {name}",
        ratio=round(statistics.median(after / before for before, after in pairs), 3),
        goal=goal,
        baseline_ms=round(statistics.median(bases), 3),
        subject_ms=round(statistics.median(ours), 3),
        spread=round(max(bases) / statistics.median(bases), 2),
        rounds=len(bases),
    )
