"""`urc audit`: print the audit log of motion as JSON lines."""

import argparse
from pathlib import Path

from urc.cli.output import complain, json_text
from urc.problems import UrcError

EXAMPLE = "urc audit --robot puppet --last 20"

USUAL = 200
MOST = 1_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: number of entries, robot and data folder."""
    parser.add_argument(
        "--last",
        type=_count,
        default=USUAL,
        metavar="N",
        help="number of newest entries to print (default: 200)",
    )
    parser.add_argument(
        "--robot", default="", metavar="NAME", help="print only entries of this robot"
    )
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the entries, oldest first; return 1 if the log was tampered with."""
    from urc._folders import data_folder
    from urc.runtime.audit import check, read

    file = (arguments.data or data_folder()) / "audit.sqlite"
    if not file.is_file():
        raise UrcError(
            f"{file} does not exist; start 'urc serve' to create the file,"
            " or select its folder with --data-dir"
        )
    for entry in read(file, robot=arguments.robot, last=arguments.last):
        print(json_text(entry._asdict()))
    broken = check(file)
    if broken:
        complain(f"urc audit: {file} was tampered with: {broken}")
    return 1 if broken else 0


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) <= MOST or len(text) > 7:
        raise argparse.ArgumentTypeError(f"expected a number from 1 to {MOST}, found {text!r}")
    return int(text)
