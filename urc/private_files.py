"""Writes private files atomically: a power failure leaves either the old or the new content.

The files contain persistent data: settings, a latched STOP and host keys.
"""

import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path

__all__ = ["make_private", "put_private", "remove_incomplete"]

_OWN = 0o700
_INCOMPLETE_S = 3600.0
"""Age of an incomplete file, in seconds, after which no process can still be writing it."""


def make_private(folder: Path) -> None:
    """Create a folder and its missing parents, accessible only to the owner.

    The permissions of an existing folder stay unchanged.

    Raises:
        OSError: the folder cannot be created.
    """
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    for one in reversed(missing):
        one.mkdir(mode=_OWN, exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(20, "Not a directory", str(folder))


def put_private(file: Path, data: bytes) -> None:
    """Write a file atomically: a power failure leaves either the old or the new content.

    Args:
        file: path of the file; a missing folder is created, accessible only to the owner.
        data: complete content.

    Raises:
        OSError: the file cannot be written, for example on a full disk. After an error, the file
            has the old content, unless only the folder's sync failed.
    """
    make_private(file.parent)
    # `mkstemp` makes files that only their owner can read.
    number, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.", suffix=".new")
    try:
        with os.fdopen(number, "wb") as new:
            new.write(data)
            new.flush()
            os.fsync(new.fileno())
        os.replace(name, file)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise
    _keep_name(file.parent)


def remove_incomplete(folder: Path) -> None:
    """Delete the files that killed processes left incomplete in a folder and its direct subfolders.

    Files that cannot be deleted are kept, as are files that another process may still be writing.
    """
    oldest_s = time.time() - _INCOMPLETE_S
    for pattern in (".*.new", "*/.*.new"):
        for file in folder.glob(pattern):
            with suppress(OSError):
                if file.stat().st_mtime < oldest_s:
                    file.unlink()


def _keep_name(folder: Path) -> None:
    """Sync a folder to disk if the operating system supports this."""
    if hasattr(os, "O_DIRECTORY"):
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
