"""`urc resolve`: print a profile as one document, with the origin of each key."""

import argparse

from urc.cli.arguments import profile_path
from urc.problems import ProblemsError

EXAMPLE = "urc resolve puppet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profile."""
    parser.add_argument("profile", metavar="PROFILE", help="robot file, driver file or robot name")


def run(arguments: argparse.Namespace) -> int:
    """Print the document."""
    from urc.config.load import check
    from urc.config.resolve import resolve
    from urc.runtime.registries import built_in_catalog
    from urc.runtime.widget_registry import widget_folder_of

    path = profile_path(arguments.profile)
    registry = widget_folder_of(path)
    checked = check(path, built_in_catalog(), registry)
    resolved = resolve(path, registry, checked.profile)
    if not resolved.text:
        raise ProblemsError(resolved.problems)
    print(resolved.text, end="")
    return 0
