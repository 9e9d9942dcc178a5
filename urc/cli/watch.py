"""`urc watch`: print a JSON line per update, for people, pipes and logs."""

import argparse
import asyncio
import math
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from urc.cli.arguments import add_profile, duration, load, what_it_has
from urc.cli.error_report import Misuse
from urc.cli.output import json_text
from urc.cli.server_robot import add_server, opened_robot, refuse_local_options
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.cli.event_loop import LineWriter
    from urc.model.profile import Profile
    from urc.model.values import Sample, Value
    from urc.runtime.hub import EventTap, Hub, LogEntry, Tapped, Traffic

EXAMPLE = "urc watch puppet battery --for 5s"

_LAST_WORDS_S = 5.0
"""Timeout for writing the last lines, in seconds."""

_LOSSES_S = 5.0
"""Minimum interval between two messages about lost updates, in seconds."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile, signals, duration and raw traffic."""
    add_profile(parser)
    add_server(parser)
    parser.add_argument(
        "signals", metavar="SIGNAL", nargs="*", default=[], help="only these signals"
    )
    parser.add_argument(
        "--for", dest="seconds", type=duration, metavar="TIME", help="stop after 500ms, 5s, 2m …"
    )
    parser.add_argument(
        "--wire",
        action="store_true",
        help="also print the raw traffic, as hexadecimal digits and text",
    )


def run(arguments: argparse.Namespace) -> int:
    """Watch the robot for the duration or until a signal; return 1 if nothing was received."""
    from urc.cli.event_loop import run_loop
    from urc.cli.settings import complete_settings

    refuse_local_options(arguments, ["--wire"])
    if arguments.server is not None:
        return run_loop(_watch_server(arguments))
    profile = load(arguments.profile)
    _check_signals(profile.name, profile.driver.signals, arguments.signals)
    settings = complete_settings(profile, arguments)
    return run_loop(_watch(profile, settings, arguments))


def _check_signals(robot: str, signals: Iterable[str], names: list[str]) -> None:
    known = tuple(signals)
    for name in names:
        if name not in known:
            raise Misuse(f"{robot} has no signal {name!r}; {what_it_has(name, known)}")


async def _watch(
    profile: "Profile", settings: Mapping[str, "Value"], arguments: argparse.Namespace
) -> int:
    from urc.cli.event_loop import LineWriter
    from urc.runtime.registries import built_in_catalog
    from urc.runtime.session import Session

    async with Session(profile, settings, built_in_catalog().transports) as session:
        printer = _Printer(LineWriter(), arguments.signals)
        with session.hub.tap(with_traffic=arguments.wire) as tap:
            await _follow(tap, printer, arguments.seconds)
        if not printer.received:
            raise UrcError(f"nothing was received from {profile.name}{_reasons(session.hub)}")
    return 0


async def _watch_server(arguments: argparse.Namespace) -> int:
    """Print the readings of a server's robot, beginning with the current readings."""
    from urc.cli.event_loop import LineWriter

    async with opened_robot(arguments) as robot:
        _check_signals(robot.name, robot.signals, arguments.signals)
        printer = _Printer(LineWriter(), arguments.signals)
        with robot.hub.tap() as tap, robot.shown(tuple(arguments.signals)):
            await printer.print_events(robot.hub.changed_since(0))
            await _follow(tap, printer, arguments.seconds, robot.check_open)
        if not printer.received:
            raise UrcError(f"nothing was received from {robot.name}{_reasons(robot.hub)}")
    return 0


async def _follow(
    tap: "EventTap",
    printer: "_Printer",
    seconds: float | None,
    check: Callable[[], None] = lambda: None,
) -> None:
    """Print the robot's events until the duration has elapsed, or `check` raises an error."""
    now = asyncio.get_running_loop().time
    ends = math.inf if seconds is None else now() + seconds
    is_over = False
    while not is_over:
        with suppress(TimeoutError):
            async with asyncio.timeout_at(ends):
                await tap.filled()
        is_over = now() >= ends  # checked here, because a tap that is never empty never waits
        try:
            # The end of the duration does not cut off a line, but a blocked reader is given limited
            # time.
            async with asyncio.timeout_at(ends + _LAST_WORDS_S):
                await printer.print_events(tap.drain())
                await printer.tell_losses(tap.dropped, is_last=is_over)
                check()
        except TimeoutError:
            raise UrcError("the output is blocked; the last lines are lost") from None


def _reasons(hub: "Hub") -> str:
    """Return the states of the links, to append to an error message; "" if there are no states."""
    details = dict.fromkeys(link.detail for link in hub.links.values() if link.detail)
    return f": {'; '.join(details)}" if details else ""


class _Printer:
    """Prints events: JSON lines on standard output, and log lines on standard error."""

    def __init__(self, writer: "LineWriter", signals: Iterable[str]) -> None:
        self.received = 0
        """Number of printed lines that contain data from the robot."""
        self._writer = writer
        self._signals = frozenset(signals)
        self._dropped = 0
        self._losses_told_s = 0.0
        # Offset from monotonic time to wall time.
        self._offset_s = time.time() - time.monotonic()

    async def print_events(self, events: "Iterable[Tapped]") -> None:
        """Print the events."""
        from urc.model.values import Sample
        from urc.runtime.hub import LogEntry, Traffic

        output: list[str] = []
        notes: list[str] = []
        for event in events:
            match event:
                case LogEntry():
                    notes.append(_note_line(event))
                case Traffic():
                    self.received += event.direction == "received"
                    output.append(self._traffic_line(event))
                case Sample() if not self._signals or event.signal in self._signals:
                    self.received += 1
                    output.append(self._sample_line(event))
        for stream, lines in ((sys.stdout, output), (sys.stderr, notes)):
            if lines:
                await self._writer.write(stream, "".join(f"{line}\n" for line in lines))

    async def tell_losses(self, dropped: int, *, is_last: bool) -> None:
        """Print the number of lost updates, at most once per interval, and at the end."""
        now_s = time.monotonic()
        if dropped == self._dropped or not (is_last or now_s >= self._losses_told_s + _LOSSES_S):
            return
        lost, self._dropped, self._losses_told_s = dropped - self._dropped, dropped, now_s
        text = f"warning: updates lost, because the reader of the output is too slow: {lost}\n"
        await self._writer.write(sys.stderr, text)

    def _time(self, time_s: float) -> float:
        return round(time_s + self._offset_s, 3)

    def _sample_line(self, sample: "Sample") -> str:
        line: dict[str, object] = {
            "t": self._time(sample.time_s),
            "signal": sample.signal,
            "value": sample.value,
        }
        return json_text(line | {"alarm": sample.alarm} if sample.alarm else line)

    def _traffic_line(self, traffic: "Traffic") -> str:
        return json_text(
            {
                "t": self._time(traffic.time_s),
                "transport": traffic.transport,
                "direction": traffic.direction,
                "hex": traffic.data.hex(" "),
                "text": traffic.data.decode("utf-8", "backslashreplace"),
            }
        )


def _note_line(note: "LogEntry") -> str:
    return printable(f"{note.level}: {note.source}: {note.text}")
