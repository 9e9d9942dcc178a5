"""`urc audit`: print, export and check the audit log."""

import argparse
import os
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path

from urc.cli.output import complain, json_text
from urc.problems import UrcError

EXAMPLE = "urc audit --robot puppet --last 20"

USUAL = 200
MOST = 1_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: entries, export, check and data folder."""
    parser.add_argument(
        "--last",
        type=_count,
        default=USUAL,
        metavar="N",
        help="number of newest entries to print (default: 200)",
    )
    parser.add_argument(
        "--robot", default="", metavar="NAME", help="use only entries about this robot"
    )
    parser.add_argument(
        "--who", default="", metavar="NAME", help="print only entries with this person's name"
    )
    parser.add_argument("--text", default="", help="print only entries that contain this text")
    action = parser.add_mutually_exclusive_group()
    action.add_argument(
        "--export",
        metavar="FILE",
        help="export all entries as JSON lines for a later --check; '-' prints them",
    )
    action.add_argument(
        "--check",
        metavar="FILE",
        help="check an exported file; with --data-dir, also compare it with the audit log",
    )
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print, export or check the audit log; return 1 if its entries cannot be trusted."""
    from urc.runtime.audit_check import check

    if arguments.check:
        return _check_export(arguments)
    file = _file(arguments)
    if arguments.export:
        _export(file, arguments.export, arguments.robot)
    else:
        _print(file, arguments)
    broken = check(file)
    if broken:
        complain(f"urc audit: {file} was tampered with: {broken}")
    return 1 if broken else 0


def _file(arguments: argparse.Namespace) -> Path:
    from urc._folders import data_folder
    from urc.runtime.audit import FILE

    file: Path = (arguments.data or data_folder()) / FILE
    if not file.is_file():
        raise UrcError(
            f"{file} does not exist; start 'urc serve' to create the file,"
            " or select its folder with --data-dir"
        )
    return file


def _print(file: Path, arguments: argparse.Namespace) -> None:
    from urc.runtime.audit_search import AuditQuery, search

    query = AuditQuery(
        robot=arguments.robot, who=arguments.who, text=arguments.text, last=arguments.last
    )
    for row in reversed(search(file, query, longest_s=float("inf"))):
        print(json_text(row.entry._asdict()))


def _export(file: Path, target: str, robot: str) -> None:
    from urc.runtime.audit_check import exported

    blocks = exported(file, frozenset({robot}) if robot else None)
    if target == "-":
        # Exports are always UTF-8, because a check on another machine reads UTF-8.
        for block in blocks:
            sys.stdout.buffer.write(block.encode())
        sys.stdout.buffer.flush()
        return
    # The log contains names and addresses, so only the owner may read the copy.
    number = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with open(number, "w", encoding="utf-8", newline="\n") as copy:
        with suppress(OSError):
            os.chmod(target, 0o600)
        for block in blocks:
            copy.write(block)


def _check_export(arguments: argparse.Namespace) -> int:
    from urc.runtime.audit_check import LONGEST_LINE, check_export, compare

    with open(arguments.check, encoding="utf-8", errors="replace") as lines:
        found = check_export(iter(partial(lines.readline, LONGEST_LINE + 1), ""))
    fault = found.fault or ("" if arguments.robot else found.gap)
    if not fault and arguments.data and found.entries:
        fault = compare(_file(arguments), found)
    if fault:
        complain(f"urc audit: {arguments.check} cannot be trusted: {fault}")
        return 1
    print(f"{arguments.check}: {found.entries} entries, intact")
    return 0


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) <= MOST or len(text) > 7:
        raise argparse.ArgumentTypeError(f"expected a number from 1 to {MOST}, found {text!r}")
    return int(text)
