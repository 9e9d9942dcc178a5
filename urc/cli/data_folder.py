"""URC's data folder, private to the current user."""

import os
from contextlib import suppress
from pathlib import Path

from urc._environment import DATA_DIR
from urc._folders import data_folder
from urc.private_files import make_private, remove_incomplete

__all__ = ["own_folder"]

_OWN = 0o700


def own_folder(named: Path | None = None) -> Path:
    """Return URC's data folder; create it if necessary, and delete its incomplete files.

    The default folder becomes private, even if an older version created it with other permissions.
    The permissions of an existing custom folder remain unchanged, because the folder may be shared.
    If the folder cannot be created, the first write reports the error.

    Args:
        named: value of `--data-dir`; None means ``URC_DATA_DIR`` or the default folder.
    """
    folder = named or data_folder()
    with suppress(OSError):
        make_private(folder)
        if named is None and DATA_DIR not in os.environ:
            folder.chmod(_OWN)
        remove_incomplete(folder)
    return folder
