"""Which paths may stand in a package: those that mean the same file on every system."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

__all__ = ["name_fault", "names_fault"]

_DEEPEST: Final = 8
_LONGEST: Final = 200
_PART = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}", re.ASCII)
_RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.ASCII)
_ENDINGS: Final = frozenset(
    (
        "yaml",
        "yml",
        "json",
        "js",
        "css",
        "html",
        "j2",
        "svg",
        "png",
        "jpg",
        "jpeg",
        "webp",
        "gif",
        "txt",
        "md",
        "csv",
        "urdf",
        "stl",
        "glb",
        "gltf",
        "bin",
        "dae",
        "obj",
        "mtl",
        "woff2",
        "wav",
        "mp3",
        "ogg",
        "zip",
    )
)
_BARE: Final = frozenset(("LICENSE", "LICENCE", "NOTICE", "README", "AUTHORS"))


def name_fault(path: str) -> str:
    """Return what is wrong with a path in a package, or ""."""
    if path.startswith(("/", "\\")) or re.match(r"[A-Za-z]:", path):
        return f"{path!r} is an absolute path"
    parts = path.split("/")
    if ".." in parts or ".." in path.split("\\"):
        return f"{path!r} leads out of the package"
    if len(path) > _LONGEST or len(parts) > _DEEPEST:
        return f"{path[:_LONGEST]!r} is too long or too deep: {_DEEPEST} levels at most"
    for part in parts:
        if not _PART.fullmatch(part) or part.endswith(".") or _RESERVED.fullmatch(part):
            return (
                f"{path!r}: the name {part!r} is not allowed;"
                " letters, digits, '-', '_' and '.' are, and no system may give it a meaning"
            )
    last = parts[-1]
    if last not in _BARE and last.rpartition(".")[2].lower() not in _ENDINGS:
        return f"{path!r}: files of this kind do not belong in a package"
    return ""


def names_fault(paths: Sequence[str]) -> str:
    """Return which two paths cannot stand side by side on every system, or ""."""
    seen: dict[str, str] = {}
    for path in paths:
        other = seen.setdefault(path.casefold(), path)
        if other is not path:
            same = "twice" if other == path else f"beside {other!r}: only capitals differ"
            return f"{path!r} is there {same}"
    return _folder_fault(seen)


def _folder_fault(seen: dict[str, str]) -> str:
    folders: dict[str, str] = {}
    for path in seen.values():
        for folder in _folders(path):
            other = folders.setdefault(folder.casefold(), folder)
            if other != folder:
                return f"{folder!r} is there beside {other!r}: only capitals differ"
            if folder.casefold() in seen:
                return f"{folder!r} is a file and a folder"
    return ""


def _folders(path: str) -> Iterable[str]:
    parts = path.split("/")
    return ("/".join(parts[:at]) for at in range(1, len(parts)))
