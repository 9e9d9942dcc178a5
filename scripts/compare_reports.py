"""Compare the results of two commits for the same documents; renamed words count as equal.

    python -m scripts.compare_reports COMMIT            that commit and this tree
    python -m scripts.compare_reports COMMIT --list     every difference, not the first of each kind

The old commit's code reads the old commit's documents. This tree's code reads the same documents
after their migration. Changes made to a document after the old commit, such as new comments, are
therefore ignored. The script compares:

- reports: file, line, column, severity and code of every problem in the broken documents. A renamed
  key shifts the columns after it, but not the lines;
- resolved profiles: the output of `urc resolve` for each robot; the old commit's output is migrated
  first.

The exit code is 1 if any difference is not due to a rename.
"""

import argparse
import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from urc.config.migrate import Migrated, migrate
from urc.config.renames import CODES
from urc.problems import ProblemsError

ROOT = Path(__file__).resolve().parents[1]
BROKEN = "tests/broken"
CODE = ("urc", "schemas", "templates")
DOCUMENTS = ("robots", "widgets", BROKEN)

RECORD = """
import importlib, json, os, sys
from pathlib import Path

def found(*places):
    for place in places:
        module, name = place.split(":")
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError):
            pass
    raise SystemExit(f"none of {places} is there")

from urc.config.load import check
from urc.config.resolve import resolve
widgets = found("urc.config.parse.widget:WidgetFolder", "urc.config.load:Shelf",
                "urc.config.parse.widget:Shelf")
known = found("urc.runtime.catalog:built_in_catalog", "urc.runtime.registries:built_in_registries",
              "urc.runtime.registries:built_in_catalog")()
root = Path.cwd()
os.chdir(root / "tests/broken")
reports = {}
for path in sorted(Path().rglob("*.yaml")):
    name = path.as_posix()
    if name.startswith(("parts/", "shelf/")):
        continue
    problems = check(name, known, widgets(Path("shelf").absolute())).problems
    reports[name] = [[one.file, one.line, one.column, one.severity, one.code] for one in problems]
os.chdir(root)
resolved = {}
for path in sorted(Path("robots").glob("*.yaml")):
    shelf = widgets(root / "widgets")
    profile = check(path.as_posix(), known, shelf).profile
    resolved[path.name] = resolve(path.as_posix(), shelf, profile).text
print(json.dumps({"reports": reports, "resolved": resolved}))
"""
"""Source of a program that runs in the old commit's tree, with that commit's code."""

Problem = tuple[str, int, int, str, str]
"""A problem: file, line, column, severity and code."""


def main() -> int:
    """Compare a commit with this tree; return 1 if any difference is not due to a rename."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("commit", help="the commit before the renames")
    parser.add_argument("--list", action="store_true", help="list every difference")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        old, new = Path(folder, "old"), Path(folder, "new")
        unpack(arguments.commit, old)
        shutil.copytree(old, new)
        for name in CODE:
            shutil.rmtree(new / name)
            shutil.copytree(ROOT / name, new / name, ignore=shutil.ignore_patterns("__pycache__"))
        for path in new.rglob("*.yaml"):
            with suppress(ProblemsError):
                path.write_bytes(migrate(str(path)).content)
        before, after = recorded(old), recorded(new)
        differences = Comparison(old, print if arguments.list else None)
        differences.compare_reports(before["reports"], after["reports"])
        differences.compare_resolved(before["resolved"], after["resolved"])
    for name, count in differences.counts.items():
        print(f"{count:6}  {name}")
    return int(differences.is_different)


def unpack(commit: str, folder: Path) -> None:
    """Write a commit's code and documents into a folder."""
    packed = subprocess.run(
        ["git", "archive", commit, *CODE, *DOCUMENTS, "pyproject.toml"],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as files:
        files.extractall(folder, filter="data")


def recorded(root: Path) -> dict[str, Any]:
    """Return the reports and resolved profiles of a tree, computed by the tree's own code."""
    done = subprocess.run(
        [sys.executable, "-c", RECORD],
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(root)},
        check=True,
        stdout=subprocess.PIPE,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def without_title(text: str) -> str:
    """Return a resolved profile without the comment in its first line."""
    return text.partition("\n")[2]


class Comparison:
    """Compares an old tree with this tree, and counts the differences of each kind."""

    def __init__(self, old: Path, tell: Callable[[str], None] | None) -> None:
        self.old = old
        self.tell = tell or (lambda _: None)
        self.counts: Counter[str] = Counter()
        self.is_different = False
        self._migrated: dict[str, Migrated | None] = {}

    def compare_reports(self, before: dict[str, Any], after: dict[str, Any]) -> None:
        """Compare the problems that both trees report for the broken documents."""
        self.counts["broken documents before"] = len(before)
        self.counts["broken documents after"] = len(after)
        for name, old in before.items():
            if name not in after:
                self.differs(f"{name}: removed", "removed documents")
                continue
            moved = Counter(self.moved(tuple(one)) for one in old)
            found = Counter(tuple(one) for one in after[name])
            self.counts["problems compared"] += moved.total()
            self.counts["problems with a new code"] += sum(one[4] in CODES for one in old)
            self.counts["problems in a new column"] += sum(
                self.moved(tuple(one))[2] != one[2] for one in old
            )
            for one in moved - found:
                self.differs(f"{name}: only before: {one}", "problems only before")
            for one in found - moved:
                self.differs(f"{name}: only after: {one}", "problems only after")
            self.counts["reports equal"] += moved == found

    def compare_resolved(self, before: dict[str, str], after: dict[str, str]) -> None:
        """Compare the output of `urc resolve` in both trees, for each robot."""
        for name, text in before.items():
            with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                old = without_title(migrate(file.name).content.decode())
            new = without_title(after.get(name, ""))
            self.counts["resolved profiles"] += 1
            if old == new:
                self.counts["resolved profiles equal"] += 1
                continue
            self.differs(f"{name}: resolved profile differs", "resolved profiles that differ")
            for one, other in zip(old.splitlines(), new.splitlines(), strict=False):
                if one != other:
                    print(f"  - {one}\n  + {other}")
                    break

    def differs(self, text: str, kind: str) -> None:
        """Count a difference.

        Print only the first difference of each kind, or all differences with `--list`.
        """
        self.is_different = True
        self.counts[kind] += 1
        if self.counts[kind] == 1:
            print(text)
        else:
            self.tell(text)

    def migrated(self, file: str) -> Migrated | None:
        """Return a migrated broken document of the old tree, or None if it can't be migrated."""
        if file not in self._migrated:
            try:
                self._migrated[file] = migrate(str(self.old / BROKEN / file))
            except ProblemsError:
                self._migrated[file] = None
        return self._migrated[file]

    def moved(self, problem: Problem) -> Problem:
        """Return a problem of the old tree as expected in this tree: with its new column and code.

        The line stays the same, because renames never change lines.
        """
        file, line, column, severity, code = problem
        migrated = self.migrated(file) if (self.old / BROKEN / file).is_file() else None
        changes = migrated.changes if migrated is not None else ()
        shift = sum(
            len(one.new) - len(one.old)
            for one in changes
            if one.line == line and one.column < column
        )
        return file, line, column + shift, severity, CODES.get(code, code)


if __name__ == "__main__":
    sys.exit(main())
