"""Finds the folder with the user's URC data on this machine."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from urc._environment import DATA_DIR

__all__ = ["data_folder"]


def data_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Return URC's data folder, which may not exist yet.

    ``URC_DATA_DIR`` overrides the system's default. The default is in ``XDG_DATA_HOME`` or
    ``~/.local/share`` on Linux, in ``~/Library/Application Support`` on macOS, and in
    ``LOCALAPPDATA`` on Windows.
    """
    if named := environ.get(DATA_DIR):
        return Path(named).expanduser()
    if sys.platform == "win32":
        base = environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Application Support")
    else:
        base = environ.get("XDG_DATA_HOME") or str(Path.home() / ".local" / "share")
    return Path(base) / "urc"
