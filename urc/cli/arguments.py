"""Command-line parsing, shared by all subcommands.

Layer 6. Each subcommand's module has `EXAMPLE`, `add_arguments(parser)` and `run(arguments) ->
int`.
"""

import argparse
import ipaddress
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from urc.cli.output import complain
from urc.problems import UrcError
from urc.shipped import shipped

if TYPE_CHECKING:
    from urc.model.profile import Profile

__all__ = [
    "add_dev",
    "add_host",
    "add_port",
    "add_profile",
    "add_settings",
    "describe",
    "duration",
    "is_loopback",
    "load",
    "parse",
    "port",
    "profile_path",
    "what_it_has",
]

_DURATION = re.compile(r"([0-9]{1,9}(?:\.[0-9]{1,9})?)(ms|s|m|h)?")
_SECONDS = {"ms": 0.001, "s": 1.0, "m": 60.0, "h": 3600.0, None: 1.0}


class _Exit(Exception):
    """Raised to end parsing after help text or an error message has been printed."""


class _ArgumentParser(argparse.ArgumentParser):
    """An argument parser with one-line error messages."""

    def error(self, message: str) -> NoReturn:
        complain(f"{self.prog}: {message}; try '{self.prog} --help'")
        raise _Exit(2)

    def print_help(self, file: object = None) -> None:
        print(self.format_help(), end="")  # argparse's own method hides write errors

    def exit(self, status: int = 0, message: str | None = None) -> NoReturn:
        raise _Exit(status)


def parse(verb: str, summary: str, module: Any, words: list[str]) -> argparse.Namespace | int:
    """Return the parsed arguments, or the exit code after help text or an error message."""
    parser = _ArgumentParser(prog=f"urc {verb}", allow_abbrev=False)
    describe(parser, summary, module)
    try:
        # Options may appear between words, as in `urc watch PROFILE --for 5s SIGNAL`.
        return parser.parse_intermixed_args(words)
    except _Exit as ended:
        return int(ended.args[0])


def describe(parser: argparse.ArgumentParser, summary: str, module: Any) -> None:
    """Add a subcommand's description, example and arguments to a parser."""
    parser.description = summary[0].upper() + summary[1:] + "."
    parser.epilog = f"example:\n  {module.EXAMPLE}"
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    module.add_arguments(parser)


def add_profile(parser: argparse.ArgumentParser) -> None:
    """Declare the argument PROFILE and the options for the profile's settings."""
    parser.add_argument("profile", metavar="PROFILE", help="robot file or robot name")
    add_settings(parser)


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Declare the options `--set` and `--settings`."""
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        type=_assignment,
        help="value of a setting; the environment variable URC_SET_NAME is an alternative",
    )
    parser.add_argument(
        "--settings",
        dest="settings_file",
        metavar="FILE",
        help="YAML file of settings, one NAME: VALUE on each line",
    )


def add_host(parser: argparse.ArgumentParser) -> None:
    """Declare the option `--host`, the address to listen on."""
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        type=_address,
        default="127.0.0.1",
        help="address to listen on (default: this machine only)",
    )


def add_dev(parser: argparse.ArgumentParser) -> None:
    """Declare the option `--dev` for developer pages."""
    parser.add_argument(
        "--dev",
        action="store_true",
        help="add a developer page for each robot: traffic, parser, and reload on every save",
    )


def is_loopback(host: str) -> bool:
    """Return whether `host` is reachable only from this machine."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def add_port(parser: argparse.ArgumentParser) -> None:
    """Declare the option `--port`, the dashboard's port."""
    parser.add_argument(
        "--port",
        type=port,
        default=8080,
        help="port of the dashboard; 0 selects a free port (default: 8080)",
    )


def add_foxglove(parser: argparse.ArgumentParser) -> None:
    """Declare the option `--foxglove`, a port for viewers such as Foxglove and Lichtblick."""
    parser.add_argument(
        "--foxglove",
        type=port,
        metavar="PORT",
        help="port for viewers that speak the Foxglove WebSocket protocol, usually 8765;"
        " 0 selects a free port (default: only the path /api/v1/foxglove of the dashboard)",
    )


def load(word: str) -> "Profile":
    """Return the profile with the name or path `word`; raise `UrcError` for an invalid profile."""
    from urc.runtime.open_profile import open_document

    return open_document(profile_path(word))


def profile_path(word: str) -> str:
    """Return the path of a robot's file; `word` is a path, or a shipped or installed robot's name.

    An existing file has priority over a shipped robot with the same name, and a shipped robot has
    priority over an installed package.
    """
    path = Path(word)
    if path.suffix in (".yaml", ".yml") or os.path.isfile(word):
        return word
    named = shipped("robots") / f"{word}.yaml"
    if len(path.parts) == 1 and os.path.isfile(named):
        return str(named)
    from urc.cli.packages import installed_document  # slow to load

    if installed := installed_document(word):
        return str(installed)
    if path.suffix or len(path.parts) > 1:
        return word
    if os.path.exists(word):
        return word  # reading it as a file reports an error later
    for suffix in (".yaml", ".yml"):
        if os.path.isfile(word + suffix):
            raise UrcError(f"file {word!r} does not exist; did you mean {word + suffix!r}?")
    known = ", ".join(sorted(file.stem for file in shipped("robots").glob("*.yaml")))
    raise UrcError(f"no file or robot has the name {word!r}; known robots: {known}")


def what_it_has(word: str, known: Iterable[str]) -> str:
    """Return a suggestion for an unknown name: a similar name, or all known names."""
    from difflib import get_close_matches

    names = list(known)
    close = get_close_matches(word, names, n=1)
    return f"did you mean {close[0]!r}?" if close else f"it has: {', '.join(names) or 'none'}"


def duration(text: str) -> float:
    """Return a duration in seconds, which must be greater than 0.

    `text` is a number of seconds, or a number with the unit ms, s, m or h.
    """
    found = _DURATION.fullmatch(text)
    seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
    if not seconds:
        raise argparse.ArgumentTypeError(
            f"expected a duration like 500ms, 5s or 2m, found {text!r}"
        )
    return seconds


def port(text: str) -> int:
    """Return the number of a port to listen on, from 0 to 65535."""
    if not re.fullmatch(r"[0-9]{1,5}", text) or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"expected a port from 0 to 65535, found {text!r}")
    return int(text)


def _address(text: str) -> str:
    # An empty address would mean all of this machine's networks.
    if not text.strip():
        raise argparse.ArgumentTypeError("expected an address like 127.0.0.1 or 0.0.0.0")
    return text.strip()


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"expected NAME=VALUE, found {text!r}")
    return name, value
