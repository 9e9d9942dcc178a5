"""Delay of control on a line of 1 Mbit/s while a page shows a video that needs 3 Mbit/s.

A page drives a robot over a link with a rate and a long queue, as in many modems. The baseline is a
page without a video. A page's video has a socket of its own; a program's video uses the main one.
It measures the delay of each tick from the page to
the robot. It also measures the time from a ping of the page until its answer, which waits for all
data that the server has sent before. The benchmark needs root and /dev/net/tun; otherwise, it is
skipped with a message.
"""

import json
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Final

from bench.figures import tell
from bench.harness import Result
from bench.line_page import Plan
from bench.rig.programs import SERVER_ADDRESS, Program, Relay, Robots, Server, can_relay
from bench.video_films import film, profile, sending

__all__ = ["run"]

RATE_KBIT, DELAY_MS = 1000, 10
FILM_KBIT: Final = 3000
LASTS_S, LASTS_IF_FULL_S = 15.0, 60.0
CALM_S: Final = 3.0
"""Time after the page's first image that is left out, in seconds."""
READY_S: Final = 60.0
GOAL: Final = 2.0
WAYS: Final = {"none": "no video", "apart": "own socket", "main": "main socket"}
_CAMERA: Final = 5600
_WIRE: Final = (
    "  wire:\n    {{ type: tcp, host: 127.0.0.1, port: {port},"
    " framing: {{ type: delimiter, tx: LF, rx: LF }} }}\n"
)
_COMMANDS: Final = """\
commands:
  go:
    to: wire
    send: "M {{ t }}"
    args: { t: { type: integer, min: 0 } }
    hold: { repeat: 10ms, release: { t: 0 }, watchdog: none }
"""


def run(*, full: bool) -> Sequence[Result]:
    """Compare the delays with and without a video."""
    if not can_relay():
        print(json.dumps({"left_out": "video_line: needs root and /dev/net/tun"}))
        return []
    lasts_s = LASTS_IF_FULL_S if full else LASTS_S
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        place = Path(folder)
        relay = stack.enter_context(Relay())
        there = relay.inside("b")
        robots = stack.enter_context(Robots(["tcp:127.0.0.1:0"], inside=there))
        file = place / "film.yaml"
        wire = _WIRE.format(port=robots.ports[0])
        file.write_text(profile("film", [_CAMERA], wire, _COMMANDS), "utf-8")
        stack.enter_context(Program(sending(film(place, FILM_KBIT), [_CAMERA]), inside=there))
        server = stack.enter_context(
            Server([file], place / "data", host=SERVER_ADDRESS, inside=there)
        )
        look = partial(_look, relay, robots, server, lasts_s)
        found = {way: look(way) for way in WAYS}
    for way, title in WAYS.items():
        rows = {key: _quantiles(found[way][key]) for key in ("ticks", "trips")}
        tell(
            {
                "figure": "video_line",
                "video": title,
                **{f"{key} {name}_ms": ms for key, row in rows.items() for name, ms in row.items()},
                "images_hz": round(found[way]["images"][0], 1),
                "stops": round(found[way]["stops"][0]),
            }
        )
    return [_result(key, found["none"][key], found["apart"][key]) for key in ("ticks", "trips")]


def _look(
    relay: Relay, robots: Robots, server: Server, lasts_s: float, way: str
) -> Mapping[str, list[float]]:
    """Drive for a while; return the delays in milliseconds, and the rate of the images."""
    relay.do("delay 0", "rate 0")
    plan = Plan(SERVER_ADDRESS, server.port, "film", server.key, way, ["v0"], drives=True)
    with Program([sys.executable, "-m", "bench.line_page"], inside=relay.inside("a")) as page:
        page.order(json.dumps(plan._asdict()))
        page.wait_for("ready", READY_S)
        relay.do(f"delay {DELAY_MS}", f"rate {RATE_KBIT}")
        time.sleep(CALM_S)
        began_ns = time.monotonic_ns()
        time.sleep(lasts_s)
        heard = robots.since(0, began_ns)
        relay.do("delay 0", "rate 0")
        page.order("end")
        page.wait_until(lambda: page.lines[-1].startswith("{"), READY_S, "the page's figures")
        told = json.loads(page.lines[-1])
    seconds = CALM_S + lasts_s
    first = round(CALM_S * len(told["trips_ms"]) / seconds)
    moved = [one for one in heard if one.text != "M 0"]
    return {
        "ticks": [(one.time_ns / 1000 - int(one.text[2:])) / 1000 for one in moved],
        "trips": told["trips_ms"][first:],
        "images": [told["images"] / seconds],
        "stops": [float(told["stops"])],
    }


def _quantiles(times_ms: Sequence[float]) -> dict[str, float]:
    times = sorted(times_ms) or [0.0]
    last = len(times) - 1
    return {"p50": round(times[last // 2], 1), "p99": round(times[round(last * 0.99)], 1)}


def _result(name: str, without: Sequence[float], beside: Sequence[float]) -> Result:
    base, ours = _quantiles(without)["p99"], _quantiles(beside)["p99"]
    return Result(
        name=f"video on a line of {RATE_KBIT / 1000:g} Mbit/s: p99 of {name} / without the video",
        ratio=round(ours / base, 3) if base else float("inf"),
        goal=GOAL,
        baseline_ms=base,
        subject_ms=ours,
        spread=1.0,
        rounds=len(beside),
    )
