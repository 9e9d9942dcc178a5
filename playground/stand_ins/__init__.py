"""Modules in pure Python that replace compiled modules for which browsers have no build.

`install` registers the stand-ins. The worker of the playground and the tests call the same
function, so CPython runs the stand-ins on the same documents.

- `rpds` (of jsonschema): persistent maps, sets and lists.
- `anycrc.crc`: CRCs. The table of models is the package's own.
- `re2`: patterns of RE2, matched by Python's `re`.
- `anyio.to_interpreter` (of Starlette): further interpreters, which URC does not use.

Other compiled modules need no stand-in: PyYAML and MarkupSafe have fall-backs of their own, and
URC renders emulated cameras and lasers without numpy and Pillow. Where such a module is installed,
`install` hides it.
"""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Final

__all__ = ["HIDDEN", "STAND_INS", "install"]

_HOME: Final = Path(__file__).resolve().parent

STAND_INS: Final = {
    "rpds": "rpds.py",
    "anycrc.crc": "crc.py",
    "re2": "re2.py",
    "anyio.to_interpreter": "to_interpreter.py",
}
"""File of each stand-in, by the name of the replaced module."""
HIDDEN: Final = frozenset(
    ("yaml._yaml", "yaml.cyaml", "_yaml", "markupsafe._speedups", "numpy", "PIL", "uvloop")
)
"""Compiled modules that browsers lack; URC and the packages work without them."""


class _Finder(MetaPathFinder):
    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None = None,
        target: ModuleType | None = None,
    ) -> ModuleSpec | None:
        if fullname in HIDDEN:
            raise ModuleNotFoundError(f"{fullname} does not exist in browsers", name=fullname)
        name = STAND_INS.get(fullname)
        if name is None:
            return None
        file = _HOME / name
        if not file.is_file():  # the playground has compiled files only
            file = file.with_suffix(".pyc")
        return spec_from_file_location(fullname, file)


def install() -> None:
    """Register the stand-ins, before the first import of any replaced module.

    Raises:
        RuntimeError: a replaced or hidden module is already loaded.
    """
    early = sorted((STAND_INS.keys() | HIDDEN) & sys.modules.keys())
    if early:
        raise RuntimeError(f"already imported: {', '.join(early)}")
    sys.meta_path.insert(0, _Finder())
