"""`urc resolve`: a profile as one document, each key with the place that it comes from."""

import argparse

from urc.cli.arguments import profile_path
from urc.problems import ProblemsError

EXAMPLE = "urc resolve robots/puppet.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the profile."""
    parser.add_argument(
        "profile", metavar="PROFILE", help="a robot or driver file, or the name of a robot"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the document."""
    from urc.config.parse_widget import Shelf
    from urc.config.resolve import resolve
    from urc.shipped import shipped

    resolved = resolve(profile_path(arguments.profile), Shelf(shipped("widgets")))
    if not resolved.text:
        raise ProblemsError(resolved.problems)
    print(resolved.text, end="")
    return 0
