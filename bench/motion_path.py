"""Latency of a tick from the page's socket to the robot's socket, compared with a Python relay.

One clock timestamps each tick twice: before the page's socket accepts it, and after the robot has
read the tick's line. URC and the relay alternate in one run. URC's path includes the checks of the
motion contract, the engine, and the pipe to the guard.
"""

import json
import signal
import statistics
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

TIMES_RELAY = 1.5
"""Largest allowed ratio of URC's latency to the relay's, for the median and the 99th percentile."""
TICKS, TICKS_IF_FULL = 150, 600
ROUNDS, ROUNDS_IF_FULL = 3, 7
TICK_NS = 20_000_000
"""Tick interval in nanoseconds: shorter than a page's interval, longer than `hold.repeat`."""
SETTLE_NS = 100_000_000
LEAST_SHARE = 0.5
"""Minimum share of ticks that must arrive; on a busy machine, some ticks are dropped."""
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
    """A page that puts a number into each tick and stores the tick's send time."""

    def begin_anew(self) -> None:
        """Release control and take it again for a new gesture, like an operator after a stop."""
        self.let_go()
        self.has_let_go = False
        self.say({"t": "drive", "verb": "leave"})
        self.wait(time.monotonic_ns() + SETTLE_NS)
        self.take_controls()
        self.refusal = ""

    def tick_number(self, number: int) -> int:
        """Send a tick with `number` as its value; return its send time, in nanoseconds."""
        self.hear()  # the newest heartbeat
        self.sent += 1
        body = {
            "t": "tick",
            "command": "go",
            "epoch": self.epoch,
            "number": self.sent,
            "echo": self.heartbeat,
            "arguments": {"value": number},
        }
        data = json.dumps(body, separators=(",", ":")).encode()
        # A mask of zeros is valid, and keeps the cost of masking out of the measurement.
        frame = bytes([0x81, 0xFE]) + len(data).to_bytes(2, "big") + bytes(4) + data
        sent_ns = time.monotonic_ns()
        self.socket.sendall(frame)
        return sent_ns


def run(*, full: bool) -> Sequence[Result]:
    """Measure the latency of URC and of the relay in turn."""
    ticks = TICKS_IF_FULL if full else TICKS
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        place = Path(folder)
        ways: dict[str, Callable[[], list[float]]] = {}
        relay = [sys.executable, "-m", "bench.relay_plain"]
        ways["Python relay"] = stack.enter_context(_bare(relay, ticks))
        ways["URC"] = stack.enter_context(_urc(place, ticks))
        taken: dict[str, list[list[float]]] = {name: [] for name in ways}
        for number in range(rounds + 1):
            for name, way in ways.items():
                times = sorted(way())
                if number:  # the first round warms up
                    taken[name].append(times)
    for name, of_rounds in taken.items():
        tell(_distribution(name, [one for times in of_rounds for one in times]))
    relays, ours = taken["Python relay"], taken["URC"]
    return [_result("median", relays, ours, 0.5), _result("p99", relays, ours, 0.99)]


@contextmanager
def _bare(command: Sequence[str], ticks: int) -> Iterator[Callable[[], list[float]]]:
    """Run a plain relay without any checks."""
    with Robots(["tcp:127.0.0.1:0"]) as robots, Program([*command, str(robots.ports[0])]) as relay:
        port = int(relay.wait_for("ready")[1])
        page = TimedPage(Plan(1, "127.0.0.1", port, "", "", 0))
        yield lambda: ticks_of(page, robots, ticks)
        page.socket.close()
        relay.signal(signal.SIGTERM)


@contextmanager
def _urc(folder: Path, ticks: int) -> Iterator[Callable[[], list[float]]]:
    """Run a real server with its guard."""
    with Robots(["tcp:127.0.0.1:0"]) as robots:
        file = folder / "path.yaml"
        file.write_text(PROFILE.format(port=robots.ports[0]), "utf-8")
        with Server([file], folder / "data") as server:

            def one_round() -> list[float]:
                # The page gets a separate connection. A page that waits for other rounds would not
                # answer pings, and would be disconnected.
                page = TimedPage(Plan(1, "127.0.0.1", server.port, "path", "", 0, key=server.key))
                try:
                    page.take_controls()
                    page.wait(time.monotonic_ns() + 100_000_000)
                    return ticks_of(page, robots, ticks)
                finally:
                    page.socket.close()

            yield one_round


def ticks_of(page: TimedPage, robots: Robots, ticks: int) -> list[float]:
    """Send ticks; return the latency of each tick that arrived, in milliseconds."""
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
    page.wait(next_ns + SETTLE_NS)  # delayed ticks arrive now
    page.let_go()
    page.has_let_go = False
    page.wait(time.monotonic_ns() + SETTLE_NS)
    page.refusal = ""
    heard = {int(one.text[2:]): one.time_ns for one in robots.heard[0]}
    came = [(heard[value] - at) / 1e6 for value, at in sent.items() if value in heard]
    if len(came) < ticks * LEAST_SHARE:
        raise SystemExit(f"bench: {len(came)} of {ticks} ticks arrived; {page.refusal}")
    return came


def _distribution(name: str, times: Sequence[float]) -> dict[str, object]:
    ordered = sorted(times)
    return {
        "figure": "motion_path",
        "way": name,
        "ticks": len(ordered),
        "p50_us": round(_quantile(ordered, 0.5) * 1000),
        "p99_us": round(_quantile(ordered, 0.99) * 1000),
        "max_us": round(ordered[-1] * 1000),
    }


def _quantile(ordered: Sequence[float], share: float) -> float:
    return ordered[round((len(ordered) - 1) * share)]


def _result(
    name: str, relays: Sequence[Sequence[float]], ours: Sequence[Sequence[float]], share: float
) -> Result:
    """Compare a quantile of both paths in each round."""
    bases = [_quantile(times, share) for times in relays]
    subjects = [_quantile(times, share) for times in ours]
    pairs = zip(bases, subjects, strict=True)
    return Result(
        name=f"motion path: tick to robot, {name} / Python relay",
        ratio=round(statistics.median(after / before for before, after in pairs), 3),
        goal=TIMES_RELAY,
        baseline_ms=round(statistics.median(bases), 3),
        subject_ms=round(statistics.median(subjects), 3),
        spread=round(max(bases) / statistics.median(bases), 2),
        rounds=len(bases),
    )
