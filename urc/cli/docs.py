"""`urc docs`: print a profile's manual page as Markdown."""

import argparse

from urc.cli.arguments import load
from urc.problems import printable

EXAMPLE = "urc docs puppet > puppet.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile."""
    parser.add_argument("profile", metavar="PROFILE", help="robot file, driver file or robot name")


def run(arguments: argparse.Namespace) -> int:
    """Print the page."""
    from urc.runtime.manual import manual

    page = manual(load(arguments.profile))
    print("\n".join(map(printable, page.split("\n"))), end="")
    return 0
