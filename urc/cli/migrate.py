"""`urc migrate`: replace old names of keys and values in documents."""

import argparse
import os
import tempfile

from urc.cli.output import complain
from urc.problems import ProblemsError, printable

EXAMPLE = "urc migrate robot.yaml drivers/arm.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: documents and check option."""
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="documents of any kind; the files are changed in place",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="do not change files; exit with code 1 if a document contains an old name",
    )


def run(arguments: argparse.Namespace) -> int:
    """Migrate each file; return 1 after a failure, or if `--check` finds an old name."""
    code = 0
    for file in dict.fromkeys(arguments.files):
        try:
            is_old = _migrate(file, is_check=arguments.check)
        except ProblemsError as error:
            complain(error.problems[0].headline)
            code = 1
            continue
        except OSError as error:
            complain(f"urc migrate: {file}: {error.strerror or error}")
            code = 1
            continue
        code = max(code, int(is_old and arguments.check))
    return code


def _migrate(file: str, *, is_check: bool) -> bool:
    """Migrate or check one file; return whether the file contained an old name."""
    from urc.config.migrate import migrate

    migrated = migrate(file)
    changes = migrated.changes
    if not changes:
        print(printable(f"{file}: nothing to rename"))
        return False
    names = ", ".join(f"{one.old} → {one.new} (line {one.line})" for one in changes)
    if not is_check:
        _write(file, migrated.content)
    print(printable(f"{file}: {'would rename' if is_check else 'renamed'} {names}"))
    return True


def _write(file: str, content: bytes) -> None:
    """Replace a file's content atomically. After a failure, the file keeps its old content.

    Symbolic links and file permissions are preserved.
    """
    real = os.path.realpath(file)
    number, new = tempfile.mkstemp(dir=os.path.dirname(real), suffix=".new")
    try:
        with os.fdopen(number, "wb") as out:
            out.write(content)
        os.chmod(new, os.stat(real).st_mode & 0o7777)
        os.replace(new, real)
    except BaseException:
        os.unlink(new)
        raise
