"""`urc simulate`: emulate a profile's robot on its real ports."""

import argparse
import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from urc.cli.arguments import add_host, add_profile, load
from urc.cli.fault_injection import FaultInjector, add_faults
from urc.cli.output import complain

if TYPE_CHECKING:
    from urc.model.profile import Profile
    from urc.model.values import Value
    from urc.simulator.emulated_robot import EmulatedRobot

EXAMPLE = "urc simulate puppet --set port=6789"

_SOURCE: Final = "urc.simulator.emulated_robot"
"""Name of the logger for frames without a reply."""
_AGAIN_S: Final = 10.0
"""Minimum interval between repetitions of a warning, in seconds."""
_LINES_A_SECOND: Final = 5
_LAST_LINES: Final = 10
"""Maximum number of different warnings in the final summary."""
_KINDS_MOST: Final = 200
"""Maximum number of warnings with a separate count; above the limit, the oldest count is
dropped."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile and address."""
    add_profile(parser)
    add_host(parser)
    add_faults(parser, has_names=False)


def run(arguments: argparse.Namespace) -> int:
    """Emulate the robot until Ctrl-C or SIGTERM."""
    from urc.cli.event_loop import run_loop
    from urc.cli.rendering import warn_without_encoder, warn_without_rendering
    from urc.cli.settings import settings_given
    from urc.runtime.document_tests import sample_settings
    from urc.simulator.emulated_robot import EmulatedRobot

    profile = load(arguments.profile)
    ((values, missing),) = settings_given([profile], arguments, allows_any_port=True)
    # Sample values replace values that only a real robot needs.
    settings = sample_settings(profile.settings) | values
    settings |= {name: 0 for name in missing if profile.settings[name].type == "port"}
    warn_without_rendering([profile])
    warn_without_encoder(profile)
    emulated_robot, faulty = EmulatedRobot(profile, settings), FaultInjector()
    with faulty.watch(profile.name, emulated_robot):
        faulty.begin(arguments.faults)
        work = _simulate(profile, settings, arguments.host, emulated_robot, faulty)
        return run_loop(work, code_when_ended=0)


async def _simulate(
    profile: "Profile",
    settings: Mapping[str, "Value"],
    host: str,
    emulated_robot: "EmulatedRobot",
    faulty: FaultInjector,
) -> int:
    from urc.simulator.server import serve

    log, complaints = logging.getLogger(_SOURCE), UnansweredLog(complain)
    before = log.level, log.propagate
    log.setLevel(logging.INFO)
    log.propagate = False
    log.addHandler(complaints)
    try:
        async with serve(profile, settings, host, emulated_robot=emulated_robot) as listening:
            for name, place in listening.items():
                print(f"listening {name} {place.text}", flush=True)
            await faulty.listen()
            await asyncio.Event().wait()
    finally:
        log.removeHandler(complaints)
        log.level, log.propagate = before
        complaints.finish()
    return 0


class UnansweredLog(logging.Handler):
    """A logging handler that reports frames without a reply.

    Identical warnings share one line with a count.

    Args:
        tell: function that prints one line.
        clock: function that returns monotonic time in seconds.
    """

    def __init__(
        self, tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(logging.INFO)
        self._tell = tell
        self._clock = clock
        self._counts: dict[str, int] = {}
        """Number of times that each warning has occurred since it was last printed."""
        self._told_at: dict[str, float] = {}
        self._forgotten = 0
        """Number of warnings that were neither printed nor counted separately."""
        self._second = float("-inf")
        self._lines = 0
        """Number of lines printed in the current second, which began at `_second`."""

    def emit(self, record: logging.LogRecord) -> None:
        """Count a warning, and print it unless it was printed recently."""
        text = record.getMessage()
        if text not in self._counts and len(self._counts) >= _KINDS_MOST:
            oldest = next(iter(self._counts))
            self._forgotten += self._counts.pop(oldest)
            self._told_at.pop(oldest, None)
        self._counts[text] = self._counts.get(text, 0) + 1
        now = self._clock()
        if now - self._told_at.get(text, float("-inf")) >= _AGAIN_S and self._may_tell(now):
            count = self._counts[text]
            self._tell(text if count == 1 else f"{text} ({count} times)")
            self._counts[text] = 0
            self._told_at[text] = now

    def finish(self) -> None:
        """Print the counted warnings in order of decreasing frequency."""
        left = sorted(self._counts.items(), key=lambda item: -item[1])
        for text, count in left[:_LAST_LINES]:
            if count:
                again = "more " if text in self._told_at else ""
                self._tell(f"{text} ({count} {again}time{'s' if count > 1 else ''})")
        others = self._forgotten + sum(count for _, count in left[_LAST_LINES:])
        if others:
            self._tell(f"other frames without a reply: {others}")
        self._counts.clear()
        self._forgotten = 0

    def _may_tell(self, now: float) -> bool:
        if now - self._second >= 1.0:
            self._second, self._lines = now, 0
        self._lines += 1
        return self._lines <= _LINES_A_SECOND
