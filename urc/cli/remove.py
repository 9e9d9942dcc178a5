"""`urc remove`: an installed package, and what only it needed."""

import argparse

EXAMPLE = "urc remove drivers/puppet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to remove."""
    parser.add_argument(
        "package", metavar="PACKAGE", help="NAME or drivers/NAME; @VERSION for one version only"
    )
    parser.add_argument(
        "--keep-settings",
        action="store_true",
        help="keep the settings of its robot, including secrets",
    )


def run(arguments: argparse.Namespace) -> int:
    """Remove it; what another package needs stays."""
    from urc._folders import data_folder
    from urc.cli.packages import open_store
    from urc.packages.names import parse_wish
    from urc.runtime.kept import KeptFile, names_kept

    store, folder = open_store(), data_folder() / "robots"
    with store.changing() as change:
        removed, gone = change.remove(parse_wish(arguments.package))
    for line in gone:
        print(f"removed {line}")
    if not gone:
        print("removed; another package needs it, so its files stay")
    for name in names_kept(folder, removed, store.installed()):
        file = KeptFile(folder, name)
        if arguments.keep_settings:
            print(f"kept what was filled in for {name}: {file.file}")
        else:
            file.forget()
            print(f"forgot what was filled in for {name}, its secrets too")
    return 0
