"""Location of the shipped folders: schemas, robots, widgets, templates, third-party JS.

In a checkout, the folders are in the top folder of the repository, so that edits take effect at
once. In an installed wheel, the folders are inside the package.
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
    """Return the folder of third-party browser modules, or None if the build has none."""
    spec = find_spec("urc_vendor")
    places = list(spec.submodule_search_locations or ()) if spec else []
    return Path(places[0]) if places else None
