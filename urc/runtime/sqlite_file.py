"""Opening of SQLite files that several servers may write."""

import os
import sqlite3
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

__all__ = ["LOCKED_S", "open_for_reading", "open_for_writing", "set_aside"]

LOCKED_S: Final = 1.0
"""Time to wait for another server's transaction, in seconds."""

_AGAIN_S: Final = 0.01


def open_for_writing(file: Path) -> sqlite3.Connection:
    """Return a connection without implicit transactions; create a missing file in its folder.

    The file is readable to its owner only and has a write-ahead log, so readers never wait.

    Raises:
        sqlite3.DatabaseError: the file is not an SQLite file, or another server keeps it locked.
        OSError: the file cannot be created.
    """
    # Created before SQLite does, because SQLite's other files copy the mode of this one.
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


def open_for_reading(file: Path) -> sqlite3.Connection:
    """Return a connection for reading a file that a server may be writing."""
    return sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, timeout=LOCKED_S)


def set_aside(file: Path) -> Path:
    """Rename a damaged file to a free name ending in `.broken…`, and return its new path.

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
    # SQLite does not wait here as it waits for transactions: two servers that start together
    # would each get an error at once. https://sqlite.org/c3ref/busy_handler.html
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
