"""Options that make a command use a server's robot instead of connecting to a robot directly.

Layer 6. A token is read from a file or from the environment, but never from the command line. Every
user of a computer can read the command lines of all processes.
"""

import argparse
import os
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from urc._environment import TOKEN
from urc.cli.error_report import Misuse

if TYPE_CHECKING:
    from urc.client.remote import RemoteRobot

__all__ = ["add_server", "opened_robot", "refuse_local_options"]


def add_server(
    parser: argparse.ArgumentParser,
    server: str = "use the robot PROFILE on a server, such as https://robots.lab:8080",
) -> None:
    """Declare the options that select a robot on a server; `server` explains ``--server``."""
    parser.add_argument("--server", metavar="URL", help=server)
    parser.add_argument(
        "--token-file",
        metavar="FILE",
        type=Path,
        help=f"file with the token for the server (default: {TOKEN} in the environment)",
    )
    parser.add_argument(
        "--authority",
        metavar="FILE",
        type=Path,
        help="PEM file with the certificate of the server's local authority"
        " (default: this system's trust store)",
    )
    parser.add_argument(
        "--allow-unencrypted",
        action="store_true",
        help="send the token to another computer without encryption",
    )


def refuse_local_options(arguments: argparse.Namespace, options: Sequence[str]) -> None:
    """Raise `Misuse` for an option that works only with, or only without, a server.

    Args:
        arguments: the parsed arguments.
        options: options that work only without a server, such as ``--wire``. The attribute of an
            option has the option's name, with ``_`` in place of ``-``.
    """
    if arguments.server is None:
        for option in ("--token-file", "--authority", "--allow-unencrypted"):
            if _is_given(arguments, option):
                raise Misuse(f"{option} needs --server")
        return
    for option in ("--set", "--settings", *options):
        if _is_given(arguments, option):
            raise Misuse(f"{option} does not work with --server: the server connects to the robot")


def _is_given(arguments: argparse.Namespace, option: str) -> bool:
    name = {"--set": "settings", "--settings": "settings_file", "--data-dir": "data"}.get(
        option, option.removeprefix("--").replace("-", "_")
    )
    return bool(getattr(arguments, name, None))


def opened_robot(arguments: argparse.Namespace) -> "AbstractAsyncContextManager[RemoteRobot]":
    """Return a context manager for the server's robot that `arguments` specify."""
    from urc.client.remote import open

    token = "" if arguments.token_file else os.environ.get(TOKEN, "").strip()
    return open(
        arguments.server,
        arguments.profile,
        token=token,
        token_file=arguments.token_file,
        authority=arguments.authority,
        allow_unencrypted=arguments.allow_unencrypted,
    )
