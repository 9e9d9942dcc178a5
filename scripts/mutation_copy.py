"""Copy the source tree for mutmut, and invalidate outdated results.

The sources are copied with one change: each property becomes a plain method, with a generated
property under the old name. Properties are split because mutmut skips decorated functions, and many
of URC's properties decide whether a robot stops.
"""

import ast
import hashlib
import json
import tomllib
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

__all__ = [
    "PLAIN",
    "Settings",
    "bring_up_to_date",
    "forget_open_questions",
    "with_plain_properties",
]

PLAIN = "_as_method"
"""Suffix for the plain method that replaces a property of the original code."""
STAMP = "urc-mutate.json"
SETTLED = (1, 3, -1, -15, 24, -24, 36, 152, 255)
"""mutmut's exit codes for killed mutants and for timeouts."""


class Settings(NamedTuple):
    """Settings from `[tool.mutmut]` in pyproject.toml that determine the copy."""

    mutated: tuple[str, ...]
    """Path patterns of the files to mutate."""
    spared: tuple[str, ...]
    """Path patterns of files that are copied without mutants."""
    copied: tuple[str, ...]
    """Files and folders to copy because the tests need them."""

    @classmethod
    def of(cls, root: Path) -> "Settings":
        """Read the settings."""
        told = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["tool"]["mutmut"]
        named = [*told["source_paths"], *told["also_copy"], "tests", "pyproject.toml"]
        return cls(tuple(told["only_mutate"]), tuple(told.get("do_not_mutate", ())), tuple(named))

    def is_mutated(self, name: str) -> bool:
        """Return whether the settings select a file for mutation."""
        is_named = any(fnmatch(name, pattern) for pattern in self.mutated)
        return is_named and not any(fnmatch(name, pattern) for pattern in self.spared)


def bring_up_to_date(root: Path, copy: Path, settings: Settings) -> bool:
    """Update `copy` from the tree at `root`; return whether a file has changed.

    An unchanged file keeps its modification time, so mutmut keeps the results of its mutants.
    """
    digest = hashlib.sha256()
    names = set()
    for name in _files(root, settings.copied):
        data = (root / name).read_bytes()
        if settings.is_mutated(name):
            data = with_plain_properties(data.decode()).encode()
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
        names.add(name)
        target = copy / name
        if not target.is_file() or target.read_bytes() != data:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
    # Without this call, Python would cache the absence of this folder from its path.
    (copy / "mutants").mkdir(exist_ok=True)
    for folder in (copy, copy / "mutants"):
        for name in _files(folder, settings.copied):
            if name.removesuffix(".meta").removesuffix(".spans") not in names:
                (folder / name).unlink()
    stamp, state = copy / STAMP, json.dumps(digest.hexdigest())
    is_changed = not stamp.is_file() or stamp.read_text("utf-8") != state
    stamp.write_text(state, "utf-8")
    return is_changed


def _files(root: Path, named: tuple[str, ...]) -> Iterator[str]:
    for name in named:
        path = root / name
        found = [path] if path.is_file() else sorted(path.rglob("*"))
        for one in found:
            if one.is_file() and "__pycache__" not in one.parts:
                yield one.relative_to(root).as_posix()


def forget_open_questions(copy: Path) -> None:
    """Mark all surviving mutants as untested, because a new test may kill them.

    A killed mutant keeps its status until mutmut detects a change in its function.
    """
    (copy / "mutants" / "mutmut-stats.json").unlink(missing_ok=True)
    for path in (copy / "mutants").rglob("*.meta"):
        meta = json.loads(path.read_text("utf-8"))
        codes = meta["exit_code_by_key"]
        meta["exit_code_by_key"] = {
            name: code if code in SETTLED else None for name, code in codes.items()
        }
        path.write_text(json.dumps(meta), "utf-8")


def with_plain_properties(source: str) -> str:
    """Return `source` with each property split into a plain method and a generated property."""
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.ClassDef):
            continue
        for one in node.body:
            if isinstance(one, ast.FunctionDef) and _is_property(one):
                indent = " " * one.col_offset
                lines[one.decorator_list[0].lineno - 1] = "\n"
                at, plain = one.lineno - 1, one.name + PLAIN
                lines[at] = lines[at].replace(f"def {one.name}(", f"def {plain}(", 1)
                last = one.end_lineno or one.lineno
                lines[last - 1] += f"{indent}{one.name} = property({plain})\n"
    return "".join(lines)


def _is_property(function: ast.FunctionDef) -> bool:
    match function.decorator_list:
        case [ast.Name(id="property")]:
            return True
    return False
