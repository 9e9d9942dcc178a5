"""Measure the code's structure: its size, and its division into modules and functions.

    python -m scripts.structure             this tree
    python -m scripts.structure ROOT        another tree, such as a worktree of an older commit

Use the metrics to compare the code before and after a change. A better metric is never a goal in
itself. `--names` lists the counted modules, classes and functions. Definitions of the metrics:

- modules with one importer: modules of `urc` that exactly one other module uses. A use is an import
  at any level, or an entry `"urc.module:name"` in a table. Packages and `__main__` do not count;
- class names used more than once: names that `urc` defines in two or more places;
- functions over 60 lines: the line count includes the docstring, but not the decorators;
- repeated lines: lines of four or more consecutive statements that also occur in an earlier
  function. The comparison ignores variable names and constants. Only the header of a compound
  statement is compared. Each repeated line counts once.
"""

import argparse
import ast
import io
import re
import tokenize
from collections import defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONG = 60
WINDOW = 4
_ENTRY = re.compile(r"(urc(?:\.\w+)+):\w+")


@dataclass
class Module:
    """A Python file with its path, its text and its syntax tree."""

    path: str
    name: str
    text: str
    tree: ast.Module

    @property
    def is_package(self) -> bool:
        """Whether the module is the `__init__.py` of a package."""
        return self.path.endswith("__init__.py")


@dataclass
class Lines:
    """Line counts of Python code, by kind."""

    total: int = 0
    blank: int = 0
    docstring: int = 0
    comments: int = 0
    """Lines with a comment, with or without code."""

    @property
    def code(self) -> int:
        """Number of lines with code or a comment."""
        return self.total - self.blank - self.docstring


@dataclass
class Structure:
    """All metrics, and the names of the counted modules, classes and functions."""

    lines: Lines = field(default_factory=Lines)
    files: int = 0
    one_importer: list[str] = field(default_factory=list)
    public_twice: dict[str, list[str]] = field(default_factory=dict)
    private_twice: dict[str, list[str]] = field(default_factory=dict)
    classes: int = 0
    long_functions: list[str] = field(default_factory=list)
    repeated: int = 0


def main() -> int:
    """Print the table of metrics, and the names if requested; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m scripts.structure", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "root", nargs="?", type=Path, default=ROOT, help="root folder of the measured tree"
    )
    parser.add_argument(
        "--names",
        action="store_true",
        help="list the names of the counted modules, classes and functions",
    )
    options = parser.parse_args()
    root: Path = options.root
    found = structure(modules(root, "urc"))
    rows = [
        *table(found),
        ("lines of Python in bench/", lines_of(modules(root, "bench")).total),
        ("lines of JavaScript in urc/", javascript(root / "urc")),
        ("lines of JavaScript in widgets/", javascript(root / "widgets")),
    ]
    width = max(len(name) for name, _ in rows)
    for name, figure in rows:
        print(f"{name:<{width}}  {figure:>8}")
    if options.names:
        print("\n".join(names(found)))
    return 0


def table(found: Structure) -> list[tuple[str, str | int]]:
    """Return each metric of `urc` as a name and a value."""
    lines = found.lines
    return [
        ("lines of Python in urc/", lines.total),
        ("  code", lines.code),
        ("  blank", lines.blank),
        ("  docstring", lines.docstring),
        ("files", found.files),
        ("modules with one importer", len(found.one_importer)),
        ("classes", found.classes),
        ("public class names used more than once", len(found.public_twice)),
        ("private class names used more than once", len(found.private_twice)),
        (f"functions over {LONG} lines", len(found.long_functions)),
        ("comments", lines.comments),
        ("comments per 100 lines", f"{100 * lines.comments / max(1, lines.total):.1f}"),
        (f"repeated lines (windows of {WINDOW} statements)", found.repeated),
    ]


def names(found: Structure) -> Iterator[str]:
    """Yield the names of the counted modules, classes and functions."""
    yield "\nmodules with one importer"
    yield from (f"  {name}" for name in found.one_importer)
    yield "\nclass names used more than once"
    for name, places in [*found.public_twice.items(), *found.private_twice.items()]:
        yield f"  {name}: {', '.join(places)}"
    yield f"\nfunctions over {LONG} lines"
    yield from (f"  {name}" for name in found.long_functions)


def modules(root: Path, folder: str) -> list[Module]:
    """Return all Python modules below a folder, sorted by path."""
    found = []
    for file in sorted((root / folder).rglob("*.py")):
        path = file.relative_to(root).as_posix()
        text = file.read_text("utf-8")
        name = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        found.append(Module(path, name, text, ast.parse(text)))
    return found


def structure(found: list[Module]) -> Structure:
    """Return all metrics of the modules."""
    public, private = repeated_names(found)
    return Structure(
        lines=lines_of(found),
        files=len(found),
        one_importer=with_one_importer(found),
        public_twice=public,
        private_twice=private,
        classes=sum(1 for _ in classes(found)),
        long_functions=long_functions(found),
        repeated=repeated_lines(found),
    )


def lines_of(found: list[Module]) -> Lines:
    """Return the total line counts of the modules."""
    counted = Lines()
    for module in found:
        lines = module.text.splitlines()
        documented = {
            number
            for node in ast.walk(module.tree)
            if isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
            for number in range(node.lineno, (node.end_lineno or node.lineno) + 1)
        }
        counted.total += len(lines)
        counted.docstring += len(documented)
        counted.blank += sum(
            1
            for number, line in enumerate(lines, 1)
            if not line.strip() and number not in documented
        )
        tokens = tokenize.generate_tokens(io.StringIO(module.text).readline)
        counted.comments += sum(1 for token in tokens if token.type == tokenize.COMMENT)
    return counted


def with_one_importer(found: list[Module]) -> list[str]:
    """Return the names of modules with exactly one importer."""
    known = {module.name for module in found}
    importers: dict[str, set[str]] = defaultdict(set)
    for module in found:
        for name in imported(module, known) - {module.name}:
            importers[name].add(module.name)
    plain = [one for one in found if not one.is_package and not one.name.endswith("__main__")]
    return [one.name for one in plain if len(importers[one.name]) == 1]


def imported(module: Module, known: set[str]) -> set[str]:
    """Return the modules in `known` that a module imports or names in a table."""
    found: set[str] = set()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inner & known or {node.module}
        elif isinstance(node, ast.Constant) and (entry := _ENTRY.fullmatch(str(node.value))):
            found.add(entry[1])
    return found & known


def every_statement(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield each statement of a module, including those in classes, functions and blocks.

    Unlike `ast.walk`, this function skips expressions, which make up nine tenths of a tree.
    """
    waiting: deque[ast.AST] = deque([tree])
    while waiting:
        node = waiting.popleft()
        if isinstance(node, ast.stmt):
            yield node
        for block in ("body", "handlers", "orelse", "finalbody", "cases"):
            waiting.extend(getattr(node, block, ()))


def classes(found: list[Module]) -> Iterator[tuple[str, str]]:
    """Yield the name and location of each class."""
    for module in found:
        for node in every_statement(module.tree):
            if isinstance(node, ast.ClassDef):
                yield node.name, f"{module.path}:{node.lineno}"


def repeated_names(found: list[Module]) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Return the public and the private class names defined twice or more, with locations."""
    places: dict[str, list[str]] = defaultdict(list)
    for name, place in classes(found):
        places[name].append(place)
    twice = {name: places[name] for name in sorted(places) if len(places[name]) > 1}
    public = {name: where for name, where in twice.items() if not name.startswith("_")}
    return public, {name: where for name, where in twice.items() if name not in public}


def functions(module: Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Yield each function of a module, including methods and inner functions."""
    for node in every_statement(module.tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def long_functions(found: list[Module]) -> list[str]:
    """Return name, location and length of each function that exceeds `LONG` lines."""
    return [
        f"{node.name} {module.path}:{node.lineno} ({length} lines)"
        for module in found
        for node in functions(module)
        if (length := (node.end_lineno or node.lineno) - node.lineno + 1) > LONG
    ]


def repeated_lines(found: list[Module]) -> int:
    """Count the lines of statement sequences that also occur in an earlier function."""
    seen: set[tuple[str, ...]] = set()
    repeated: set[tuple[str, int]] = set()
    for module in found:
        for function in functions(module):
            heads = list(statements(function))
            shapes = [shape for _, shape in heads]
            fresh: set[tuple[str, ...]] = set()
            for start in range(len(heads) - WINDOW + 1):
                window = tuple(shapes[start : start + WINDOW])
                if window in seen:
                    repeated.update(
                        (module.path, number)
                        for lines, _ in heads[start : start + WINDOW]
                        for number in lines
                    )
                fresh.add(window)
            # Added only now, because repeated rows within one function do not count.
            seen |= fresh
    return len(repeated)


def statements(node: ast.AST) -> Iterator[tuple[range, str]]:
    """Yield the lines and the normalized form of each statement in a function, in source order."""
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            continue  # counted on its own
        if isinstance(inner, ast.Expr) and isinstance(inner.value, ast.Constant):
            continue  # a docstring
        if isinstance(inner, ast.stmt):
            blocks = [one.lineno for one in ast.walk(inner) if isinstance(one, ast.stmt)][1:]
            end = min(blocks, default=(inner.end_lineno or inner.lineno) + 1)
            yield range(inner.lineno, max(end, inner.lineno + 1)), shape_of(inner)
        if isinstance(inner, ast.stmt | ast.ExceptHandler | ast.match_case):
            yield from statements(inner)


def shape_of(node: ast.AST) -> str:
    """Return the normalized form of a statement: without blocks, variable names and constants."""
    if isinstance(node, ast.Name | ast.Constant):
        return type(node).__name__
    parts = [type(node).__name__]
    for name, value in ast.iter_fields(node):
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, ast.stmt | ast.ExceptHandler | ast.match_case) or name == "ctx":
                continue
            parts.append(shape_of(one) if isinstance(one, ast.AST) else str(one))
    return f"({' '.join(parts)})"


def javascript(folder: Path) -> int:
    """Count the lines of JavaScript files below a folder."""
    return sum(
        len(file.read_text("utf-8").splitlines())
        for file in folder.rglob("*.js")
        if not {"node_modules", "vendor"} & set(file.parts)
    )


if __name__ == "__main__":
    raise SystemExit(main())
