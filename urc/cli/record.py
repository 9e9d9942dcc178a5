"""`urc record`: connect to a robot and record the session to a file for `urc replay`."""

import argparse
import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.arguments import add_profile, duration, load
from urc.cli.output import complain
from urc.cli.server_robot import add_server, opened_robot, refuse_local_options
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.model.profile import Profile
    from urc.model.values import Value
    from urc.runtime.recording.recorder import Recorder

EXAMPLE = "urc record puppet --for 10s -o puppet.mcap"

_SOON_S, _LOOK_S = 0.02, 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile, duration and output file."""
    add_profile(parser)
    add_server(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="output file (default: ROBOT-TIME.mcap in the current folder)",
    )
    parser.add_argument(
        "--for", dest="seconds", type=duration, metavar="TIME", help="stop after 500ms, 5s, 2m …"
    )


def run(arguments: argparse.Namespace) -> int:
    """Record the robot for the duration or until a signal; return 1 if nothing was received."""
    from urc.cli.event_loop import run_loop
    from urc.cli.settings import complete_settings

    refuse_local_options(arguments, [])
    if arguments.server is not None:
        return run_loop(_record_server(arguments), code_when_ended=0)
    profile = load(arguments.profile)
    settings = complete_settings(profile, arguments)
    return run_loop(_record(profile, settings, arguments), code_when_ended=0)


async def _record(
    profile: "Profile", settings: Mapping[str, "Value"], arguments: argparse.Namespace
) -> int:
    from urc.runtime.recording.recorder import check_installed, named, recorded
    from urc.runtime.registries import built_in_catalog
    from urc.runtime.session import Session

    session = Session(profile, settings, built_in_catalog().transports)
    check_installed()
    file = arguments.output or named(Path(), profile.name)
    # The recording starts before the session and ends after it, to capture both ends.
    async with recorded(session.hub, file, profile) as recorder:
        await _until_begun(recorder)
        async with session:
            await _until_over(recorder, arguments.seconds)
            details = {link.detail for link in session.hub.links.values() if link.detail}
    return _told(recorder, details)


async def _record_server(arguments: argparse.Namespace) -> int:
    """Record the readings and the log from a server's robot.

    A server sends neither its traffic with the robot nor the robot's document.
    """
    from urc.model.driver import Driver, TransportSpec
    from urc.model.profile import Profile
    from urc.runtime.recording.recorder import check_installed, named, recorded

    check_installed()
    async with opened_robot(arguments) as robot:
        driver = Driver({name: TransportSpec(name, "") for name in robot.links}, robot.signals)
        source = f"{robot.name} at {arguments.server}"
        profile = Profile(robot.name, robot.name, source, driver=driver)
        file = arguments.output or named(Path(), robot.name)
        async with recorded(robot.hub, file, profile, document="") as recorder:
            await _until_begun(recorder)
            with robot.shown(tuple(robot.signals)):
                recorder.record(robot.hub.changed_since(0))
                await _until_over(recorder, arguments.seconds, robot.check_open)
        details = {link.detail for link in robot.links.values() if link.detail}
    return _told(recorder, details)


async def _until_begun(recorder: "Recorder") -> None:
    """Wait until the file of the recording exists, and print its name."""
    while not (recorder.is_begun or recorder.fault):  # noqa: ASYNC110 - a thread sets them
        await asyncio.sleep(_SOON_S)
    if recorder.fault:
        raise UrcError(recorder.fault)
    complain(f"recording {recorder.file}; Ctrl-C ends it")


async def _until_over(
    recorder: "Recorder", seconds: float | None, check: Callable[[], None] = lambda: None
) -> None:
    """Wait until the duration has elapsed, recording has failed, or Ctrl-C is pressed."""
    try:
        async with asyncio.timeout(seconds):
            while not recorder.fault:
                check()
                await asyncio.sleep(_LOOK_S)
    except TimeoutError:
        pass
    except asyncio.CancelledError:
        # Without a duration, Ctrl-C is the normal end: complete the file and print a summary of its
        # contents.
        task = asyncio.current_task()
        if task is not None:
            task.uncancel()


def _told(recorder: "Recorder", details: set[str]) -> int:
    if recorder.fault:
        raise UrcError(recorder.fault)
    counts = recorder.counts
    values = {name: count for name, count in counts.items() if name.startswith("/signals/")}
    wire = sum(count for name, count in counts.items() if name.startswith("/wire/"))
    print(
        printable(
            f"{recorder.file}: {_many(sum(values.values()), 'reading')} of"
            f" {_many(len(values), 'signal')}, {_many(wire, 'piece')} of traffic"
        )
    )
    if not values:
        reasons = f": {'; '.join(sorted(details))}" if details else ""
        raise UrcError(f"no reading was received{reasons}")
    return 0


def _many(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
