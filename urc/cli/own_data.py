"""The folder of URC's own data, as the verbs use it: for this user alone."""

import os
from contextlib import suppress
from pathlib import Path

from urc._folders import data_folder
from urc.private_files import make_private

__all__ = ["own_folder"]

_OWN = 0o700


def own_folder(named: Path | None = None) -> Path:
    """Return the folder of URC's own data, made where it is missing.

    The usual one is closed to others, also where an older version left it open; one that was chosen
    and is there may serve others as well, and is left as it is. Where it cannot be made, whoever
    writes there says so.

    Args:
        named: as `--data-dir` says; None: the usual one, or that of ``URC_DATA_DIR``.
    """
    folder = named or data_folder()
    with suppress(OSError):
        make_private(folder)
        if named is None and "URC_DATA_DIR" not in os.environ:
            folder.chmod(_OWN)
    return folder
