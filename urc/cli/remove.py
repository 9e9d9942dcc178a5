"""`urc remove`: an installed package, and what only it needed."""

import argparse

EXAMPLE = "urc remove drivers/puppet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to remove."""
    parser.add_argument(
        "package", metavar="PACKAGE", help="NAME or drivers/NAME; @VERSION for one version only"
    )


def run(arguments: argparse.Namespace) -> int:
    """Remove it; what another package needs stays."""
    from urc.cli.packages import open_store
    from urc.packages.names import parse_wish

    with open_store().changing() as change:
        _, gone = change.remove(parse_wish(arguments.package))
    for line in gone:
        print(f"removed {line}")
    if not gone:
        print("removed; another package needs it, so its files stay")
    return 0
