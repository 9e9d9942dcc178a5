"""Files of their owner alone that are there whole or not at all, whenever the machine ends.

Floor 1. For what is kept between two runs: settings, a latched stop, keys of hosts.
"""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

__all__ = ["make_private", "put_private"]

_OWN = 0o700


def make_private(folder: Path) -> None:
    """Make a folder, and those above it that are missing, for their owner alone.

    One that is there is left as it is.

    Raises:
        OSError: it cannot be made.
    """
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    for one in reversed(missing):
        one.mkdir(mode=_OWN, exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(20, "Not a directory", str(folder))


def put_private(file: Path, data: bytes) -> None:
    """Write a file: after this it holds `data`, even if the power goes; before, what it held.

    Args:
        file: what it is called; its folder is made, for its owner alone.
        data: all of it.

    Raises:
        OSError: the disk is full, for example; then nothing has changed, unless all was written
            and only the folder could not be forced to the disk.
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
    """Have the disk know the new name of what is in it, where a system can do that."""
    if hasattr(os, "O_DIRECTORY"):
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
