"""`urc restore`: restore a backup of people, keys, settings and logs."""

import argparse
import time
from pathlib import Path

from urc.cli.audited import audit_access
from urc.cli.identities import local_time
from urc.problems import printable

EXAMPLE = "urc restore urc-backup.zip"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: file, data folder and options."""
    parser.add_argument("file", metavar="FILE", type=Path, help="backup file from 'urc backup'")
    parser.add_argument(
        "--replace", action="store_true", help="replace the data that the folder already contains"
    )
    parser.add_argument(
        "--people-only",
        action="store_true",
        help="remove all devices, tokens and guests of the backup; people keep their passphrases",
    )
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Restore the backup; refuse while a server is running."""
    from urc.cli.data_folder import own_folder
    from urc.runtime.backup_archive import opened_backup
    from urc.runtime.data_restore import check_target, restore

    data = own_folder(arguments.data)
    lines: list[str] = []
    with opened_backup(arguments.file) as reader:
        check_target(data, replaces=arguments.replace)
        restore(reader, data, lambda new: lines.extend(_ended(new, arguments.people_only)))
        made = local_time(reader.manifest.made_at)
        print(printable(f"restored the backup of {made} (URC {reader.manifest.version})"))
    audit_access(data, "restore", file=arguments.file.name, backup_of=made)
    for line in lines:
        print(line)
    return 0


def _ended(new: Path, people_only: bool) -> list[str]:
    """End the restored browser sign-ins; return a summary of people, devices and tokens."""
    from contextlib import closing

    from urc.access.administration import end_after_restore, overview
    from urc.access.store import FILE, AccessStore

    if not (new / FILE).exists():
        return ["the backup has no people, devices or tokens"]
    with closing(AccessStore(new)) as store:
        ended = end_after_restore(store, ends_keys=people_only)
        kinds = [one.principal.kind for one in overview(store, time.time())]
    people, devices, tokens = (kinds.count(kind) for kind in ("person", "device", "program"))
    lines = [
        f"people: {people}, devices: {devices}, tokens: {tokens}, ended sign-ins: {ended}",
    ]
    if devices or tokens or people:
        lines.append(
            "people, devices and tokens that were removed after the backup are valid again:"
            " remove them ('urc people list', 'urc devices list', 'urc tokens list')"
        )
    return lines
