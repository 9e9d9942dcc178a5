"""`urc remove`: remove an installed package and its unused dependencies."""

import argparse

from urc.cli.audited import audit_packages

EXAMPLE = "urc remove drivers/puppet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: package to remove."""
    parser.add_argument(
        "package", metavar="PACKAGE", help="NAME or drivers/NAME; @VERSION for one version only"
    )
    parser.add_argument(
        "--keep-settings",
        action="store_true",
        help="keep the settings of the removed robot, including secrets",
    )


def run(arguments: argparse.Namespace) -> int:
    """Remove the package with its dependencies, except those that other packages need."""
    from urc._folders import data_folder
    from urc.cli.packages import open_store
    from urc.packages.names import parse_requirement
    from urc.runtime.settings_store import SettingsStore, names_kept

    store, folder = open_store(), data_folder() / "robots"
    with store.changing() as change:
        removed, gone = change.remove(parse_requirement(arguments.package))
    audit_packages("remove", gone or removed)
    for line in gone:
        print(f"removed {line}")
    if not gone:
        print("removed; another package needs it, so its files remain")
    for name in names_kept(folder, removed, store.installed()):
        file = SettingsStore(folder, name)
        if arguments.keep_settings:
            print(f"kept the settings of {name}: {file.file}")
        else:
            file.forget()
            print(f"deleted the settings of {name}, including its secrets")
    return 0
