"""Functions that open SQLite files to which several servers may write."""

import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Final

__all__ = ["LOCKED_S", "open_for_writing", "opened_for_reading", "set_aside"]

LOCKED_S: Final = 1.0
"""Maximum wait for the end of another server's transaction, in seconds."""

_AGAIN_S: Final = 0.01


def open_for_writing(file: Path) -> sqlite3.Connection:
    """Return a connection without implicit transactions; create the file if it is missing.

    The file is readable only by its owner and has a write-ahead log, so readers never wait.

    Raises:
        sqlite3.DatabaseError: the file is not an SQLite file, or another server has locked it.
        OSError: the file cannot be created.
    """
    # Created before SQLite creates it, because SQLite's other files copy this file's mode.
    os.close(os.open(file, os.O_RDWR | os.O_CREAT, 0o600))
    for name in ("", "-wal", "-shm"):
        with suppress(FileNotFoundError):
            os.chmod(f"{file}{name}", 0o600)
    base = sqlite3.connect(file, timeout=LOCKED_S, isolation_level=None)
    try:
        _use_write_ahead_log(base)
        base.execute("PRAGMA journal_size_limit = 1048576")
    except sqlite3.Error:
        base.close()
        raise
    return base


@contextmanager
def opened_for_reading(file: Path) -> Iterator[sqlite3.Connection | None]:
    """Open a file for reading, even while a server writes to it.

    The context manager yields None if the file does not exist or has no tables.

    Raises:
        OSError: the file cannot be read.
    """
    if not file.is_file():
        yield None
        return
    uri = f"{file.absolute().as_uri()}?mode=ro"
    try:
        with closing(sqlite3.connect(uri, uri=True, timeout=LOCKED_S)) as base:
            # A server creates the file shortly before the tables.
            (tables,) = base.execute("SELECT count(*) FROM sqlite_master").fetchone()
            yield base if tables else None
    except sqlite3.Error as error:
        raise OSError(f"{file} cannot be read: {error}") from error


def set_aside(file: Path) -> Path:
    """Rename a damaged file to an unused name ending in `.broken…` and return its new path.

    Raises:
        OSError: the file cannot be renamed.
    """
    aside = file.with_suffix(".broken")
    number = 2
    while aside.exists():
        aside, number = file.with_name(f"{file.stem}.broken{number}"), number + 1
    file.replace(aside)
    for ending in ("-wal", "-shm"):
        Path(f"{file}{ending}").unlink(missing_ok=True)
    return aside


def _use_write_ahead_log(base: sqlite3.Connection) -> None:
    # Unlike for transactions, SQLite does not wait here. Two servers that start together would each
    # get an error immediately. https://sqlite.org/c3ref/busy_handler.html
    end = time.monotonic() + LOCKED_S
    while True:
        try:
            base.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() >= end:
                raise
            time.sleep(_AGAIN_S)
        else:
            return
