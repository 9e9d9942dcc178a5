"""Atomic writing of private files, safe against a power failure.

The files contain data that outlives a run: settings, a latched STOP, host keys.
"""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

__all__ = ["make_private", "put_private"]

_OWN = 0o700


def make_private(folder: Path) -> None:
    """Make a folder and its missing parents, accessible to their owner only.

    An existing folder stays unchanged.

    Raises:
        OSError: the folder cannot be made.
    """
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    for one in reversed(missing):
        one.mkdir(mode=_OWN, exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(20, "Not a directory", str(folder))


def put_private(file: Path, data: bytes) -> None:
    """Write a file atomically: after a power failure it has either the old or the new content.

    Args:
        file: path of the file; its folder is created, private to its owner.
        data: complete content.

    Raises:
        OSError: the file cannot be written, for example on a full disk. The old content then
            remains, unless only the sync of the folder failed.
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


def _keep_name(folder: Path) -> None:
    """Sync the folder to disk, where the system supports it."""
    if hasattr(os, "O_DIRECTORY"):
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
