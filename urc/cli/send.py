"""`urc send`: one command, its reply as JSON."""

import argparse
import asyncio
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from urc.cli.arguments import add_profile, load, what_it_has
from urc.cli.failures import Misuse
from urc.cli.output import json_text
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.model.driver import Argument, Command
    from urc.model.profile import Profile
    from urc.model.values import Reading, Value
    from urc.runtime.session import CommandFailed, Session

EXAMPLE = "urc send my-robot.yaml set_speed speed=3 --set host=192.168.1.20"

_WHOLE = re.compile(r"[+-]?[0-9]{1,300}")
KNOWN_S = 3.0
"""How long what a command requires may take to be read."""
_WRONG_USE = ("bad-argument", "unknown-command")
"""Codes of a failure that lies in what was typed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the profile, the command and its arguments."""
    add_profile(parser)
    parser.add_argument("command", metavar="COMMAND", help="a command of the robot's driver")
    parser.add_argument("words", metavar="ARG=VALUE", nargs="*", default=[], help="its arguments")


def run(arguments: argparse.Namespace) -> int:
    """Run the command and print its reply; 1 when it failed."""
    from urc.cli.running import run_loop
    from urc.cli.settings import complete_settings

    profile = load(arguments.profile)
    command = profile.driver.commands.get(arguments.command)
    if command is None:
        hint = what_it_has(arguments.command, profile.driver.commands)
        raise Misuse(f"{profile.name} has no command {arguments.command!r}; {hint}")
    if command.hold is not None:
        raise Misuse(
            f"{command.name} moves the robot for as long as it is held, and nothing holds it here:"
            " give it on the dashboard"
        )
    values = _arguments(command, arguments.words)
    settings = complete_settings(profile, arguments)
    return run_loop(_send(profile, settings, command, values))


def _arguments(command: "Command", words: list[str]) -> dict[str, "Reading"]:
    values: dict[str, Reading] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            example = f"{next(iter(command.arguments), 'ARG')}={word}"
            raise Misuse(f"an argument is written ARG=VALUE, as {example!r}; found {word!r}")
        argument = command.arguments.get(name)
        if argument is None:
            hint = what_it_has(name, command.arguments)
            raise Misuse(f"{command.name} has no argument {name!r}; {hint}")
        if name in values:
            raise Misuse(f"{name} is given twice")
        if argument.type == "array":
            values[name] = _elements(argument, text)
        else:
            values[name] = _value(argument, text)
    return values


def _elements(argument: "Argument", text: str) -> tuple["Value", ...]:
    """Return the elements of an array: ``1,2,3``, or ``["a, b", "c"]`` as JSON has it."""
    if text.startswith("["):
        import json

        try:
            return tuple(json.loads(text))
        except (ValueError, RecursionError):
            raise Misuse(f"{argument.name}: {text!r} is no list in JSON") from None
    single = argument._replace(type=argument.of)
    return tuple(_value(single, word.strip()) for word in text.split(",")) if text else ()


def _value(argument: "Argument", text: str) -> "Value":
    """Return the typed value; range and choices are the engine's to check."""
    try:
        if argument.type == "integer":
            return int(text, 0)
        if argument.type == "number":
            # "20" stays a whole number, as it would in a document: templates print it as written.
            return int(text) if _WHOLE.fullmatch(text) else float(text)
    except ValueError:
        raise Misuse(f"{argument.name}: {argument.type} expected, found {text!r}") from None
    if argument.type == "boolean":
        if text not in ("true", "false"):
            raise Misuse(f"{argument.name}: true or false expected, found {text!r}")
        return text == "true"
    return text


async def _send(
    profile: "Profile",
    settings: Mapping[str, "Value"],
    command: "Command",
    values: Mapping[str, "Reading"],
) -> int:
    from urc.runtime.catalog import built_in_catalog
    from urc.runtime.session import CommandFailed, Session

    async with Session(profile, settings, built_in_catalog().transports) as session:
        await _known(session, command)
        try:
            replied = await session.command(command.name, values)
        except CommandFailed as failed:
            text = f"{command.name} failed ({failed.code}): {_why(session, command, failed)}"
            raise (Misuse if failed.code in _WRONG_USE else UrcError)(text) from failed
    print(json_text({"command": command.name, "values": dict(replied.values)}))
    return 0


async def _known(session: "Session", command: "Command") -> None:
    """Wait for the first reading of what the command requires, for as long as may take."""
    wanted = {name for one in command.requires for name in one.condition.names}
    wanted &= session.profile.driver.signals.keys()

    def is_known() -> bool:
        return all(session.hub.latest(name) is not None for name in wanted)

    if is_known():
        return
    with session.hub.tap() as tap, suppress(TimeoutError):  # then the engine says what is not known
        async with asyncio.timeout(KNOWN_S):
            while not is_known():
                await tap.filled()
                tap.take()


def _why(session: "Session", command: "Command", failed: "CommandFailed") -> str:
    """Return the reason, with what the link knows when the robot is not there."""
    link = session.hub.links[command.transport]
    if failed.code != "disconnected" or not link.detail or link.detail in failed.message:
        return failed.message
    return f"{failed.message}: {link.detail}"
