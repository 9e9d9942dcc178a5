"""`urc explain`: print the help page for a problem code."""

import argparse
from difflib import get_close_matches

from urc.cli.error_report import Misuse
from urc.config.codes import pages
from urc.config.renames import CODES

EXAMPLE = "urc explain unknown-key"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: problem code."""
    parser.add_argument(
        "code",
        metavar="CODE",
        nargs="?",
        help="code printed by 'urc validate' (default: list all codes)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the help page for a problem code; without a code, list all codes."""
    every = pages()
    if arguments.code is None:
        width = max(map(len, every))
        for one in every.values():
            print(f"{one.code:<{width}}  {one.what}")
        return 0
    new = CODES.get(arguments.code)
    page = every.get(new or arguments.code)
    if page is None:
        close = get_close_matches(arguments.code, every, n=1)
        hint = f"did you mean '{close[0]}'?" if close else "'urc explain' lists all codes"
        raise Misuse(f"unknown code {arguments.code!r}; {hint}")
    if new is not None:
        print(f"The new name of {arguments.code} is {new}.\n")
    print(page)
    return 0
