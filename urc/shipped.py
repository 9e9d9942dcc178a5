"""Finds the shipped folders: schemas, robots, widgets, templates and third-party JS.

In a checkout, the folders are in the root of the repository, so edits take effect immediately. In
an installed wheel, the folders are inside the package.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Literal

__all__ = ["shipped", "vendored"]

_PACKAGE = Path(__file__).resolve().parent


def shipped(name: Literal["schemas", "robots", "widgets", "templates"]) -> Path:
    """Return the path of the shipped folder `name`."""
    installed = _PACKAGE / "_shipped" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def vendored() -> Path | None:
    """Return the folder of third-party browser modules; None if the build lacks the folder."""
    spec = find_spec("urc_vendor")
    places = list(spec.submodule_search_locations or ()) if spec else []
    return Path(places[0]) if places else None
