"""The reference page for limits, generated from constants whose docstrings begin with “Maximum”."""

import ast
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from scripts.reference.markdown import plain, table

__all__ = ["Limit", "limits", "page"]

ROOT = Path(__file__).resolve().parents[2]
_WORDS = ("Maximum ", "Longest ", "Largest ")
_KIB = 1024
_PLAIN = 1e5


class Limit(NamedTuple):
    """One limit: a constant with its docstring."""

    part: str
    """Package below `urc`, such as `web`."""
    place: str
    meaning: str
    value: float


def page() -> str:
    """Return the page: one table of limits for each package of `urc`."""
    lines = ["# Limits", "", "Fixed limits of URC, which bound its use of memory and time.", ""]
    every = list(limits())
    for part in sorted({one.part for one in every}):
        rows = [(one.meaning, _shown(one), f"`{one.place}`") for one in every if one.part == part]
        lines += [f"## `urc.{part}`", "", *table(("limit", "value", "name in the code"), rows)]
    return "\n".join(lines).rstrip() + "\n"


def limits() -> Iterator[Limit]:
    """Yield every limit in the code, in module order."""
    for file in sorted((ROOT / "urc").rglob("*.py")):
        body = ast.parse(file.read_text("utf-8")).body
        for statement, following in pairwise(body):
            name, text = _name(statement), _docstring(following)
            if name and text.startswith(_WORDS):
                module = ".".join(file.relative_to(ROOT).with_suffix("").parts)
                value = getattr(import_module(module), name)
                if isinstance(value, (int, float)):
                    part = module.split(".")[1]
                    yield Limit(part, f"{module}.{name}", plain(text), value)


def _name(statement: ast.stmt) -> str:
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
        return statement.target.id
    if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
        return statement.targets[0].id
    return ""


def _docstring(statement: ast.stmt) -> str:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return str(statement.value.value)
    return ""


def _shown(limit: Limit) -> str:
    value = limit.value
    if "byte" in limit.meaning and value >= _KIB and value % _KIB == 0:
        size = int(value) // _KIB
        return f"{size // _KIB} MiB" if size % _KIB == 0 else f"{size} KiB"
    return f"{value:g}" if value < _PLAIN else f"{int(value)}"
