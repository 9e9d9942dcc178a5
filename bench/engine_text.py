"""Text protocols: what the engine makes of declarations, against tidy code written by hand.

Both sides are given the same bytes and make the same samples, checked once before anything is
timed. What is timed is a line of bytes → samples, or arguments → bytes on the wire.
"""

import json
import platform
import re
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from typing import cast

from bench.documents import DOCUMENT, by_json, by_orjson, json_lines
from bench.harness import Goal, Result, compare
from urc.config.parse.driver import parse_driver
from urc.config.part import Findings, Part
from urc.model.driver import Driver
from urc.model.values import Sample
from urc.protocol.asking import Builder
from urc.protocol.codec import Frame
from urc.protocol.encode import build_check
from urc.protocol.fast_value import Taken
from urc.protocol.known import Known
from urc.protocol.messages import Messages
from urc.protocol.readings import Readings
from urc.runtime.catalog import built_in_catalog
from urc.source import parse_document

LINES = (
    b"BAT 24.31 87",
    b"ODO 1.250 -0.337 90.5",
    b"IMU 0.01 -0.02 9.81 0.001 0.002 -0.003",
    b"RNG 1.20 0.85",
    b"OK 17",
)
LINE = """
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 6789, framing: { type: delimiter, tx: LF, rx: LF } }
signals:
  volts: { min: 0, max: 60 }
  percent: { type: integer, min: 0, max: 100 }
  x: {}
  y: {}
  heading: {}
  ax: {}
  ay: {}
  az: {}
  gx: {}
  gy: {}
  gz: {}
  left: { min: 0 }
  right: { min: 0 }
  done: { type: integer }
"""
NUMBER = r"[+-]?[0-9]+(?:\.[0-9]+)?"
REGEXES = (
    LINE
    + f"""
messages:
  bat: {{ regex: '^BAT (?P<volts>{NUMBER}) (?P<percent>[0-9]+)$' }}
  odo: {{ regex: '^ODO (?P<x>{NUMBER}) (?P<y>{NUMBER}) (?P<heading>{NUMBER})$' }}
  imu:
    regex: '^IMU (?P<ax>{NUMBER}) (?P<ay>{NUMBER}) (?P<az>{NUMBER}) (?P<gx>{NUMBER}) \
(?P<gy>{NUMBER}) (?P<gz>{NUMBER})$'
  rng: {{ regex: '^RNG (?P<left>{NUMBER}) (?P<right>{NUMBER})$' }}
  ok: {{ regex: '^OK (?P<done>[0-9]+)$' }}
"""
)
PATTERNS = (
    LINE
    + """
messages:
  bat: { pattern: "BAT {volts:number} {percent:integer}" }
  odo: { pattern: "ODO {x:number} {y:number} {heading:number}" }
  imu:
    pattern: "IMU {ax:number} {ay:number} {az:number} {gx:number} {gy:number} {gz:number}"
  rng: { pattern: "RNG {left:number} {right:number}" }
  ok: { pattern: "OK {done:integer}" }
"""
)
PATHS = {
    "x": "pose.pose.position.x",
    "y": "pose.pose.position.y",
    "w": "pose.pose.orientation.w",
    "speed": "twist.twist.linear.x",
    "turn": "twist.twist.angular.z",
    "volts": "battery.voltage",
    "cell": "battery.cells[0]",
    "mode": "state.mode",
}
JSON = (
    LINE[: LINE.index("signals:")]
    + "signals:\n"
    + "".join(f"  {name}: {'{ type: string }' if name == 'mode' else '{}'}\n" for name in PATHS)
    + "messages:\n  odom:\n    json:\n"
    + "".join(f"      {name}: {path}\n" for name, path in PATHS.items())
)
COMMANDS = (
    LINE
    + """
commands:
  drive:
    send: "VEL {{ (vx * 1000) | fixed(1) }} {{ (wz * 57.3) | fixed(2) }}"
    args: { vx: { min: -1, max: 1 }, wz: { min: -2, max: 2 } }
  aim:
    send: "PT {{ (pan * 10) | fixed(0) }} {{ ((tilt + 90) * 10) | fixed(0) }}"
    args: { pan: { min: -180, max: 180 }, tilt: { min: -90, max: 90 } }
"""
)
ARGUMENTS = (
    ("drive", {"vx": 0.25, "wz": -1.5}),
    ("aim", {"pan": 12.5, "tilt": -3.25}),
)


# ---- by hand


class HandRegex:
    """What one writes for such a robot: a compiled pattern a line, tried in turn."""

    bat = re.compile(rf"BAT ({NUMBER}) ([0-9]+)\Z").match
    odo = re.compile(rf"ODO ({NUMBER}) ({NUMBER}) ({NUMBER})\Z").match
    imu = re.compile(rf"IMU {' '.join([f'({NUMBER})'] * 6)}\Z").match
    rng = re.compile(rf"RNG ({NUMBER}) ({NUMBER})\Z").match
    ok = re.compile(r"OK ([0-9]+)\Z").match

    def read(self, line: bytes, now: float) -> list[Sample] | None:
        """Return the samples of a line, or None for another one."""
        text = line.decode()
        if m := self.bat(text):
            volts, percent = float(m[1]), int(m[2])
            if 0 <= volts <= 60 and 0 <= percent <= 100:
                return [Sample("volts", volts, now), Sample("percent", percent, now)]
        elif m := self.odo(text):
            return [
                Sample("x", float(m[1]), now),
                Sample("y", float(m[2]), now),
                Sample("heading", float(m[3]), now),
            ]
        elif m := self.imu(text):
            return [
                Sample("ax", float(m[1]), now),
                Sample("ay", float(m[2]), now),
                Sample("az", float(m[3]), now),
                Sample("gx", float(m[4]), now),
                Sample("gy", float(m[5]), now),
                Sample("gz", float(m[6]), now),
            ]
        elif m := self.rng(text):
            left, right = float(m[1]), float(m[2])
            if left >= 0 and right >= 0:
                return [Sample("left", left, now), Sample("right", right, now)]
        elif m := self.ok(text):
            return [Sample("done", int(m[1]), now)]
        return None


def by_split(line: bytes, now: float) -> list[Sample] | None:
    """The same by `split`, tuned."""
    parts = line.decode().split(" ")
    kind = parts[0]
    try:
        if kind == "BAT":
            volts, percent = float(parts[1]), int(parts[2])
            if 0 <= volts <= 60 and 0 <= percent <= 100:
                return [Sample("volts", volts, now), Sample("percent", percent, now)]
        elif kind == "ODO":
            return [
                Sample("x", float(parts[1]), now),
                Sample("y", float(parts[2]), now),
                Sample("heading", float(parts[3]), now),
            ]
        elif kind == "IMU":
            return [
                Sample("ax", float(parts[1]), now),
                Sample("ay", float(parts[2]), now),
                Sample("az", float(parts[3]), now),
                Sample("gx", float(parts[4]), now),
                Sample("gy", float(parts[5]), now),
                Sample("gz", float(parts[6]), now),
            ]
        elif kind == "RNG":
            left, right = float(parts[1]), float(parts[2])
            if left >= 0 and right >= 0:
                return [Sample("left", left, now), Sample("right", right, now)]
        elif kind == "OK":
            return [Sample("done", int(parts[1]), now)]
    except (IndexError, ValueError):
        pass
    return None


def drive(vx: float, wz: float) -> bytes:
    vx = max(-1.0, min(1.0, vx))
    wz = max(-2.0, min(2.0, wz))
    return f"VEL {vx * 1000:.1f} {wz * 57.3:.2f}\n".encode()


def aim(pan: float, tilt: float) -> bytes:
    pan = max(-180.0, min(180.0, pan))
    tilt = max(-90.0, min(90.0, tilt))
    return f"PT {pan * 10:.0f} {(tilt + 90) * 10:.0f}\n".encode()


# ---- by declaration


def driver_of(text: str) -> Driver:
    document = parse_document(text, "bench.yaml")
    findings = Findings()
    driver = parse_driver(Part(document, (), document.data), findings, built_in_catalog())
    assert not findings.problems, findings.problems
    return driver


def reader_of(text: str) -> Callable[[bytes, float], Taken | None]:
    """Return bytes → samples and refused values, as a line of the engine does it."""
    driver = driver_of(text)
    known = Known(driver.signals, {})
    builder = Builder(driver, Readings(driver.signals), known, is_compiled=True)
    messages: Messages = builder.lines["wire"].inbox.messages
    return lambda line, now: messages.take(Frame(line, "utf-8"), now)


Encode = Callable[[Mapping[str, object]], bytes]
"""What a command becomes: bytes, as all its transports carry them."""


def sender_of(text: str) -> Callable[[str, Mapping[str, object]], bytes]:
    """Return command and arguments → bytes, the check of the arguments included."""
    driver = driver_of(text)
    known = Known(driver.signals, {})
    builder = Builder(driver, Readings(driver.signals), known, is_compiled=True)
    commands = {
        name: (
            build_check(command, is_compiled=True),
            cast("Encode", builder.command(command).encode),
        )
        for name, command in driver.commands.items()
    }

    def send(name: str, given: Mapping[str, object]) -> bytes:
        check, encode = commands[name]
        return encode(check(given))

    return send


# ---- timing


def seconds(work: Callable[[], None], times: int) -> float:
    began = time.perf_counter()
    for _ in range(times):
        work()
    return time.perf_counter() - began


def reading(read: Callable[[bytes, float], object], lines: Sequence[bytes]) -> Callable[[], None]:
    def work() -> None:
        for line in lines:
            read(line, 1.0)

    return work


def sending(send: Callable[[str, Mapping[str, object]], bytes]) -> Callable[[], None]:
    def work() -> None:
        for name, arguments in ARGUMENTS:
            send(name, arguments)

    return work


def by_hand() -> None:
    functions: dict[str, Callable[..., bytes]] = {"drive": drive, "aim": aim}
    for name, arguments in ARGUMENTS:
        functions[name](**arguments)


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure reading and writing of text."""
    rounds, times = (25, 4000) if full else (15, 2000)
    versions = {"python": platform.python_version(), "msgspec": version("msgspec")}
    versions["orjson"] = version("orjson")
    document = json.dumps(DOCUMENT, separators=(",", ":")).encode()
    hand, regex, pattern = HandRegex().read, reader_of(REGEXES), reader_of(PATTERNS)
    declared, send = reader_of(JSON), sender_of(COMMANDS)
    for line in LINES:
        wanted = (hand(line, 1.0), ())
        assert wanted == regex(line, 1.0) == pattern(line, 1.0) == (by_split(line, 1.0), ())
    assert declared(document, 1.0) == (by_json(document, 1.0), ())
    assert len(document) == 558
    lines = json_lines()
    for line in lines:
        taken = declared(line, 1.0)
        assert taken is not None
        assert {*taken[0]} == {*(by_orjson(line, 1.0) or ())}
    hands: Mapping[str, Callable[..., bytes]] = {"drive": drive, "aim": aim}
    for name, arguments in ARGUMENTS:
        assert hands[name](**arguments) == send(name, arguments)

    def pair(
        name: str,
        at_most: float,
        base: Callable[[], None],
        ours: Callable[[], None],
        times: int = times,
    ) -> Result:
        return compare(
            Goal(f"engine_text: {name}", at_most),
            partial(seconds, base, times),
            partial(seconds, ours, times),
            rounds=rounds,
            versions=versions,
        )

    return [
        pair("regex / hand regex", 1.5, reading(hand, LINES), reading(regex, LINES)),
        pair("pattern / hand split", 1.5, reading(by_split, LINES), reading(pattern, LINES)),
        pair(
            "8 paths of JSON / hand json", 1.5,
            reading(by_json, [document]), reading(declared, [document]),
        ),
        pair(
            "8 paths of JSON, 10 % incomplete / hand orjson", 1.5,
            reading(by_orjson, lines), reading(declared, lines), times // 10,
        ),
        pair("encode / hand f-string", 1.5, by_hand, sending(send)),
    ]  # fmt: skip
