"""`urc list`: what is installed."""

import argparse

EXAMPLE = "urc list --json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the form of the answer."""
    parser.add_argument("--json", action="store_true", help="one JSON line for each")


def run(arguments: argparse.Namespace) -> int:
    """Print what was asked for, and what it brought."""
    from urc.cli.output import json_text
    from urc.cli.packages import open_store

    for lock in open_store().installed():
        needs = {key: pin.version for key, pin in lock.packages.items() if key != lock.root}
        if arguments.json:
            said = {"package": lock.root, "version": lock.version, "needs": needs}
            print(json_text(said))
        else:
            rest = ", ".join(f"{key} {version}" for key, version in needs.items())
            print(f"{lock}  with {rest}" if rest else str(lock))
    return 0
