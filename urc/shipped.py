"""Where the folders that ship with URC are: schemas, robots, widgets, templates, third-party JS.

Floor 1. In a checkout they are read from the repository's top level, so an edit shows at once; in
an installed wheel they stand inside the package.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Literal

__all__ = ["shipped", "vendored"]

_PACKAGE = Path(__file__).resolve().parent


def shipped(name: Literal["schemas", "robots", "widgets", "templates"]) -> Path:
    """Return the folder `name` of this installation or checkout."""
    installed = _PACKAGE / "_shipped" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def vendored() -> Path | None:
    """Return the folder of third-party browser modules, or None when the build brought none."""
    spec = find_spec("urc_vendor")
    places = list(spec.submodule_search_locations or ()) if spec else []
    return Path(places[0]) if places else None
