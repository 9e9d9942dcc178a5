"""`urc backup`: save people, keys, settings and logs to one file."""

import argparse
import time
from pathlib import Path

from urc.cli.audited import audit_access
from urc.cli.output import complain
from urc.problems import UrcError, printable

EXAMPLE = "urc backup urc-backup.zip"

_MOST_NAMED = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: file and data folder."""
    parser.add_argument("file", metavar="FILE", type=Path, help="file to write, such as backup.zip")
    parser.add_argument("--replace", action="store_true", help="replace an existing file")
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the backup, even while a server is running."""
    from urc import __version__
    from urc._folders import data_folder
    from urc.runtime.backup_archive import BackupManifest, parts_in, write_backup

    data, file = arguments.data or data_folder(), arguments.file
    if file.exists() and not arguments.replace:
        raise UrcError(f"{file} already exists; use --replace to overwrite the file")
    if not parts_in(data)[0]:
        raise UrcError(f"{data} has nothing to back up; select another folder with --data-dir")
    written, unknown = write_backup(data, file, BackupManifest(1, __version__, time.time()))
    audit_access(data, "backup", file=file.name)
    size = max(1, file.stat().st_size >> 10)
    print(f"{file}: {len(written)} files, {size} KiB; keep it secret, because it contains keys")
    if unknown:
        more = f" and {len(unknown) - _MOST_NAMED} more" if len(unknown) > _MOST_NAMED else ""
        complain(printable(f"not in the backup: {', '.join(unknown[:_MOST_NAMED])}{more}"))
    return 0
