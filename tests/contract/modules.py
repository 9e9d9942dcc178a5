"""URC's Python modules, each parsed once for all tests: their syntax trees and imports."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from scripts.structure import every_statement

__all__ = ["MODULES", "ROOT", "imports_of", "tree_of"]

ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted((ROOT / "urc").rglob("*.py"))


@cache
def tree_of(path: Path) -> ast.Module:
    """Return the tree of a module, which no test may change."""
    return ast.parse(path.read_text("utf-8"))


def imports_of(path: str, tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and absolute dotted name of all imports, those in functions and for types too."""
    package = Path(path).parts[:-1]
    for node in every_statement(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*above, *([node.module] if node.module else [])))
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
