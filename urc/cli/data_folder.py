"""The folder of URC's own data, private to this user."""

import os
from contextlib import suppress
from pathlib import Path

from urc._folders import data_folder
from urc.private_files import make_private

__all__ = ["own_folder"]

_OWN = 0o700


def own_folder(named: Path | None = None) -> Path:
    """Return the folder of URC's own data; create it if it is missing.

    The default folder becomes private, even if an older version left it open. A chosen folder that
    exists may serve other users, and stays as it is. If the folder cannot be created, the first
    write to it fails with a message.

    Args:
        named: from `--data-dir`; None means ``URC_DATA_DIR`` or the default folder.
    """
    folder = named or data_folder()
    with suppress(OSError):
        make_private(folder)
        if named is None and "URC_DATA_DIR" not in os.environ:
            folder.chmod(_OWN)
    return folder
