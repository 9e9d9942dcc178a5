"""Files of their owner alone that are there whole or not at all, whenever the machine ends.

Floor 1. For what is kept between two runs: settings, a latched stop, keys of hosts.
"""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

__all__ = ["put_private"]


def put_private(file: Path, data: bytes, folder_mode: int = 0o777) -> None:
    """Write a file: after this it holds `data`, even if the power goes; before, what it held.

    Args:
        file: what it is called; its folder is made.
        data: all of it.
        folder_mode: of a folder that has to be made, less the umask.

    Raises:
        OSError: the disk is full, for example; then nothing has changed, unless all was written
            and only the folder could not be forced to the disk.
    """
    file.parent.mkdir(parents=True, exist_ok=True, mode=folder_mode)
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
