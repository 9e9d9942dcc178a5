"""`urc send`: run one robot command and print the reply as JSON.

While STOP is latched or an operator is in control, motion is refused or stopped. If another process
latches STOP, this module notifies the engine.
"""

import argparse
import asyncio
import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.arguments import add_profile, duration, load, what_it_has
from urc.cli.error_report import Misuse
from urc.cli.output import json_text
from urc.cli.server_robot import add_server, opened_robot, refuse_local_options
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.model.driver import Argument, Command
    from urc.model.profile import Profile
    from urc.model.values import Reading, Value
    from urc.runtime.motion_interlock import MotionInterlock
    from urc.runtime.session import CommandFailed, Motion, Session

EXAMPLE = "urc send my-robot.yaml set_speed speed=3 --set host=192.168.1.20"

_WHOLE = re.compile(r"[+-]?[0-9]{1,300}")
KNOWN_S = 3.0
"""Timeout for reading the signals that a command requires, in seconds."""
_WRONG_USE = ("bad-argument", "unknown-command")
"""Codes of failures that count as invalid use of the command line."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile, command and the command's arguments."""
    add_profile(parser)
    add_server(parser)
    parser.add_argument(
        "command", metavar="COMMAND", help="name of a command in the robot's driver"
    )
    parser.add_argument("words", metavar="ARG=VALUE", nargs="*", default=[], help="its arguments")
    parser.add_argument(
        "--hold",
        dest="hold_s",
        metavar="TIME",
        type=duration,
        help="duration of a held command, such as 500ms or 2s; the command is then released",
    )
    parser.add_argument(
        "--despite-stop",
        action="store_true",
        help="move the robot even while STOP is latched or an operator has the controls",
    )
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command and print its reply; return 1 after a failure."""
    from urc.cli.event_loop import run_loop
    from urc.cli.settings import complete_settings

    refuse_local_options(arguments, ["--despite-stop", "--data-dir"])
    if arguments.server is not None:
        return run_loop(_send_server(arguments))
    profile = load(arguments.profile)
    command = profile.driver.commands.get(arguments.command)
    if command is None:
        hint = what_it_has(arguments.command, profile.driver.commands)
        raise Misuse(f"{profile.name} has no command {arguments.command!r}; {hint}")
    is_held = command.hold is not None
    _check_hold(command.name, is_held=is_held, hold_s=arguments.hold_s)
    values = _arguments(command, arguments.words)
    settings = complete_settings(profile, arguments)
    return run_loop(_send(profile, settings, command, values, arguments))


def _check_hold(command: str, *, is_held: bool, hold_s: float | None) -> None:
    if not is_held and hold_s is not None:
        raise Misuse(f"{command} is not a held command: remove --hold")
    if is_held and hold_s is None:
        raise Misuse(f"{command} moves the robot while held: add a duration, such as --hold 1s")
    if hold_s is not None:
        from urc.runtime.scripted_hold import LONGEST_HOLD_S

        if hold_s > LONGEST_HOLD_S:
            raise Misuse(
                f"--hold is limited to {LONGEST_HOLD_S:g}s; use a dashboard to drive longer"
            )


def _arguments(command: "Command", words: list[str]) -> dict[str, "Reading"]:
    values: dict[str, Reading] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            example = f"{next(iter(command.arguments), 'ARG')}={word}"
            raise Misuse(f"expected ARG=VALUE, such as {example!r}; found {word!r}")
        argument = command.arguments.get(name)
        if argument is None:
            hint = what_it_has(name, command.arguments)
            raise Misuse(f"{command.name} has no argument {name!r}; {hint}")
        if name in values:
            raise Misuse(f"{name} appears twice")
        if argument.type == "array":
            values[name] = _elements(argument, text)
        else:
            values[name] = _value(argument, text)
    return values


def _elements(argument: "Argument", text: str) -> tuple["Value", ...]:
    """Return the elements of an array from text: ``1,2,3``, or JSON like ``["a, b", "c"]``."""
    if text.startswith("["):
        import json

        try:
            return tuple(json.loads(text))
        except (ValueError, RecursionError):
            raise Misuse(f"{argument.name}: {text!r} is not a JSON array") from None
    single = argument._replace(type=argument.items)
    return tuple(_value(single, word.strip()) for word in text.split(",")) if text else ()


def _value(argument: "Argument", text: str) -> "Value":
    """Return text converted to the argument's type. The engine checks ranges and choices."""
    try:
        if argument.type == "integer":
            return int(text, 0)
        if argument.type == "number":
            # "20" stays an integer, as in a document, because templates print the number.
            return int(text) if _WHOLE.fullmatch(text) else float(text)
    except ValueError:
        raise Misuse(f"{argument.name}: expected {argument.type}, found {text!r}") from None
    if argument.type == "boolean":
        if text not in ("true", "false"):
            raise Misuse(f"{argument.name}: expected true or false, found {text!r}")
        return text == "true"
    return text


async def _send_server(arguments: argparse.Namespace) -> int:
    """Run the command on a server's robot, under the server's rules."""
    from urc.runtime.command_failed import CommandFailed

    name, hold_s = arguments.command, arguments.hold_s
    values = dict(_json_argument(word) for word in arguments.words)
    async with opened_robot(arguments) as robot:
        _check_hold(name, is_held=name in robot.controls, hold_s=hold_s)
        replied: dict[str, Reading] = {}
        try:
            if hold_s is None:
                replied = await robot.command(name, **values)
            else:
                async with robot.drive(name) as stick:
                    await stick.hold(hold_s, **values)
        except CommandFailed as failed:
            text = f"{name} failed ({failed.code}): {failed.message}"
            raise (Misuse if failed.code in _WRONG_USE else UrcError)(text) from failed
    print(json_text({"command": name, "values": replied}))
    return 0


def _json_argument(word: str) -> tuple[str, "Reading"]:
    """Return the name and value of an argument; a value that is not JSON is text.

    The server checks the types and rejects a value of the wrong type.
    """
    import json

    name, equals, text = word.partition("=")
    if not equals or not name:
        raise Misuse(f"expected ARG=VALUE, found {word!r}")
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return name, text
    return name, tuple(value) if isinstance(value, list) else value


async def _send(
    profile: "Profile",
    settings: Mapping[str, "Value"],
    command: "Command",
    values: Mapping[str, "Reading"],
    arguments: argparse.Namespace,
) -> int:
    from urc.runtime.registries import built_in_catalog
    from urc.runtime.session import CommandFailed, Session

    transports = built_in_catalog().transports
    motion: Motion = "none" if command.hold is None else "guarded"
    async with Session(profile, settings, transports, motion=motion) as session:
        await _known(session, command)
        try:
            async with _heeding(session, command, arguments) as interlock:
                replied = await _given(session, command, values, arguments.hold_s, interlock)
        except CommandFailed as failed:
            text = f"{command.name} failed ({failed.code}): {_why(session, command, failed)}"
            raise (Misuse if failed.code in _WRONG_USE else UrcError)(text) from failed
        lost = await session.settle()
    if lost:
        raise UrcError(f"{command.name} was sent, but {lost}")
    print(json_text({"command": command.name, "values": replied}))
    return 0


async def _given(
    session: "Session",
    command: "Command",
    values: Mapping[str, "Reading"],
    hold_s: float | None,
    interlock: "MotionInterlock | None",
) -> dict[str, "Reading"]:
    """Send the command, or hold it for the given time; return the values in the reply."""
    if hold_s is None:
        return dict((await session.command(command.name, values)).values)
    from urc.protocol.requests.encode import BadArgument, check_arguments
    from urc.runtime.scripted_hold import hold
    from urc.runtime.session import CommandFailed

    try:
        check_arguments(command, values)
    except BadArgument as wrong:
        raise CommandFailed("bad-argument", str(wrong)) from wrong
    why_not = (lambda: interlock.why) if interlock is not None else str
    await hold(session, command.name, values, hold_s, why_not)
    return {}


@asynccontextmanager
async def _heeding(
    session: "Session", command: "Command", arguments: argparse.Namespace
) -> AsyncIterator["MotionInterlock | None"]:
    """Apply the interlocks to motion while the context is active, except with `--despite-stop`."""
    may_move = command.moves or command.hold is not None
    if arguments.despite_stop or not may_move:
        yield None
        return
    from urc._folders import data_folder
    from urc.runtime.motion_interlock import MotionInterlock

    clock = asyncio.get_running_loop().time
    data = arguments.data or data_folder()
    interlock = MotionInterlock(data, session.profile.name, clock)

    def tell(why: str) -> None:
        session.latch(f"{why}; --despite-stop overrides this" if why else "")

    if await interlock.check():
        tell(interlock.why)
    following = asyncio.create_task(interlock.follow(tell))
    try:
        yield interlock
    finally:
        following.cancel()


async def _known(session: "Session", command: "Command") -> None:
    """Wait for the first readings of all signals that the command requires, with a timeout."""
    wanted = {name for one in command.requires for name in one.condition.names}
    wanted &= session.profile.driver.signals.keys()

    def is_known() -> bool:
        return all(session.hub.latest(name) is not None for name in wanted)

    if is_known():
        return
    with (
        session.hub.tap() as tap,
        suppress(TimeoutError),
    ):  # the engine then reports the missing signals
        async with asyncio.timeout(KNOWN_S):
            while not is_known():
                await tap.filled()
                tap.drain()


def _why(session: "Session", command: "Command", failed: "CommandFailed") -> str:
    """Return the reason why a command failed, as text.

    If the robot is not connected, the reason includes the state of its links.
    """
    from urc.protocol.requests.bounds import lines_of

    if failed.code != "disconnected":
        return failed.message
    lines = lines_of(command.name, session.profile.driver)
    links = [link for name, link in session.hub.links.items() if name in lines]
    details = dict.fromkeys(link.detail for link in links if link.detail)
    more = "; ".join(detail for detail in details if detail not in failed.message)
    return f"{failed.message}: {more}" if more else failed.message
