"""Fault injection for emulated robots, by command-line options and typed commands."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.config.spelling_suggestions import did_you_mean
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.simulator.emulated_robot import EmulatedRobot
import asyncio
import os
import stat
from collections.abc import AsyncIterator
from typing import Final, TextIO

__all__ = ["FaultInjector", "add_faults"]


_LONGEST: Final = 4096
"""Maximum length of a typed command, in bytes; longer commands are dropped."""
_MOST_WAITING: Final = 64
"""Maximum number of typed commands in the queue; additional commands are dropped."""


async def typed_lines(stream: TextIO | None) -> AsyncIterator[str]:
    """Yield the lines of a stream until it ends. An unreadable stream yields no lines.

    A background process must not read from its terminal, or the terminal would suspend the process.

    Args:
        stream: a pipe or a terminal, or None.
    """
    try:
        handle = -1 if stream is None else stream.fileno()
    except (OSError, ValueError):
        return
    if stream is None or handle < 0:
        return
    if stat.S_ISREG(os.fstat(handle).st_mode):
        for text in await asyncio.to_thread(stream.readlines, _MOST_WAITING * _LONGEST):
            yield text.rstrip("\n")
        return
    loop, lines = asyncio.get_running_loop(), asyncio.Queue[str | None](_MOST_WAITING)
    rest = bytearray()

    def read() -> None:
        if not _is_ours(handle):
            return
        try:
            data = os.read(handle, _LONGEST)
        except OSError:
            data = b""
        *whole, last = (bytes(rest) + data).split(b"\n")
        rest[:] = last[:_LONGEST]
        for line in whole if data else [*whole, last]:
            with suppress(asyncio.QueueFull):
                lines.put_nowait(line.decode("utf-8", "replace"))
        if not data:
            loop.remove_reader(handle)
            with suppress(asyncio.QueueFull):
                lines.put_nowait(None)

    try:
        loop.add_reader(handle, read)
    except (NotImplementedError, OSError, ValueError):
        return  # this system's event loop supports only sockets
    try:
        while (line := await lines.get()) is not None:
            yield line
    finally:
        loop.remove_reader(handle)


def _is_ours(handle: int) -> bool:
    """Return whether the process can read the stream without being suspended.

    Only foreground processes may read a terminal.
    """
    try:
        return not os.isatty(handle) or os.tcgetpgrp(handle) == os.getpgrp()
    except (AttributeError, OSError):
        return True


def add_faults(parser: argparse.ArgumentParser, *, has_names: bool) -> None:
    """Declare the option for initial faults; `has_names` permits the form ROBOT:FAULT."""
    which = " for all emulated robots" if has_names else ""
    single = " ROBOT:FAULT for a single robot;" if has_names else ""
    name = "tello:" if has_names else ""
    parser.add_argument(
        "--fault",
        dest="faults",
        action="append",
        default=[],
        metavar="FAULT",
        help=f"a fault{which}, such as delay=200ms, loss=5%%, silent, noise=2x,"
        f" dropout=SIGNAL, stuck=SIGNAL, low-battery;{single} repeatable; to change faults"
        f" while running, enter 'fault {name}loss=10%%', 'mend' or 'faults' on standard input",
    )


class FaultInjector:
    """The emulated robots of one process, and their injected faults.

    A robot's faults persist when its emulation restarts, for example after its settings change.
    """

    def __init__(self, now: Callable[[], float] = time.time) -> None:
        """Start without robots.

        Args:
            now: function that returns the current time in seconds since the epoch.
        """
        self._now = now
        self._emulated_robots: dict[str, list[EmulatedRobot]] = {}
        self._wrong: dict[str, dict[str, str]] = {}
        """Faults to inject when a robot's emulation restarts, by robot name."""

    @contextmanager
    def watch(self, name: str, emulated_robot: "EmulatedRobot") -> Iterator[None]:
        """Inject the stored faults of a robot while the context is active."""
        emulated_robots = self._emulated_robots.setdefault(name, [])
        for text in self._wrong.get(name, {}).values():
            with suppress(UrcError):  # another version may not have the signal
                emulated_robot.inject(text, self._now())
        emulated_robots.append(emulated_robot)
        try:
            yield
        finally:
            emulated_robots.remove(emulated_robot)

    def begin(self, texts: Sequence[str]) -> None:
        """Inject the command-line faults; raise `Misuse` if a fault cannot be injected."""
        for text in texts:
            try:
                self.inject(text)
            except UrcError as error:
                raise Misuse(f"--fault: {error}") from None

    def inject(self, text: str) -> None:
        """Inject a fault such as ``loss=5%`` or ``tello:loss=5%``.

        Without a robot name, the fault applies to every robot that supports it.

        Raises:
            UrcError: the robot or the fault is unknown, or no robot supports the fault.
        """
        from urc.simulator.faults import parse_fault

        robot, colon, fault = text.strip().rpartition(":")
        names = self._named(robot) if colon else [*self._emulated_robots]
        said = parse_fault(fault)
        refusals = []
        for name in names:
            try:
                for emulated_robot in self._emulated_robots[name]:
                    emulated_robot.inject(fault, self._now())
            except UrcError as error:
                refusals.append(error)
            else:
                self._wrong.setdefault(name, {})[f"{said.name} {said.signal}"] = said.text
        if refusals and len(refusals) == len(names):
            raise refusals[0]

    def mend(self, robot: str = "") -> None:
        """Remove all faults from one robot or from all robots.

        Raises:
            UrcError: the robot is unknown.
        """
        for name in self._named(robot) if robot else [*self._emulated_robots]:
            self._wrong.pop(name, None)
            for emulated_robot in self._emulated_robots[name]:
                emulated_robot.mend()

    def _named(self, robot: str) -> list[str]:
        if robot in self._emulated_robots:
            return [robot]
        hint = did_you_mean(robot, self._emulated_robots, "robots")
        raise UrcError(f"no emulated robot has the name {robot!r}" + (f"; {hint}" if hint else ""))

    def __str__(self) -> str:
        """Return the injected faults as text."""
        found = []
        for name, emulated_robots in self._emulated_robots.items():
            faults = ", ".join(
                emulated_robots[0].faults if emulated_robots else self._wrong.get(name, {}).values()
            )
            if faults:
                found.append(faults if len(self._emulated_robots) == 1 else f"{name}: {faults}")
        return f"faults: {'; '.join(found) or 'none'}"

    def obey(self, line: str) -> None:
        """Execute a typed fault command, then print all injected faults."""
        verb, _, rest = line.strip().partition(" ")
        try:
            if verb == "fault" and rest:
                self.inject(rest)
            elif verb == "mend":
                self.mend(rest.strip())
            elif line.strip() not in ("", "faults"):
                raise UrcError(
                    f"unknown command {line.strip()[:60]!r}; expected fault …, mend or faults"
                )
        except UrcError as error:
            complain(str(error))
            return
        if verb:
            print(self, flush=True)

    async def listen(self) -> None:
        """Execute the fault commands on standard input, until the input ends."""
        async for line in typed_lines(sys.stdin):
            self.obey(line)
