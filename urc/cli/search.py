"""`urc search`: search the configured repositories for packages."""

import argparse

EXAMPLE = "urc search battery --kind widget"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: search words and output format."""
    parser.add_argument(
        "words", metavar="WORD", nargs="*", help="words in the name, kind or summary of a package"
    )
    parser.add_argument(
        "--kind",
        choices=("driver", "interface", "widget", "robot"),
        default="",
        help="search only for packages of this kind",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON line per package")


def run(arguments: argparse.Namespace) -> int:
    """Print the newest version of each package that matches all words; return 1 if none match."""
    from urc.cli.packages import search_repositories

    return search_repositories(arguments.words, arguments.kind, is_json=arguments.json)
