"""House rules over every file of the tree: no machine's paths, no registries, no giants."""

import json
import os
import re
from functools import cache
from pathlib import Path

import pytest

from scripts.structure import Module, long_functions, repeated_names
from tests.contract.modules import MODULES, tree_of

ROOT = Path(__file__).resolve().parents[2]
NOT_OURS = {
    ".git", ".venv", "node_modules", "dist", "build", ".site", "__pycache__",
    ".hypothesis", ".mutate", ".mypy_cache", ".pytest_cache", ".ruff_cache",
}  # fmt: skip
MAX_LINES = 600
MAX_BYTES = 1_000_000

# Written in pieces, so that this file does not find itself. Each begins with a letter of its own:
# Python's search is ten times as fast as for one pattern of several beginnings.
FORBIDDEN = [
    re.compile(pattern)
    for pattern in (
        r"/(?<![\w.]/)" + r"(?:work|root|home/\w+|Users/\w+|opt)/",
        r"/(?<![\w.]/)" + r"tmp/",
        "registry" + r"\.npmjs\.org",
        "files" + r"\.pythonhosted\.org",
        "pypi" + r"\.org/simple",
        "deb" + r"\.debian\.org",
    )
]


def our_files() -> list[Path]:
    """Return every file of the tree that people write, in a fixed order."""
    found = []
    for folder, folders, files in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in NOT_OURS]
        found += [Path(folder, name) for name in files if name not in NOT_OURS]
    return sorted(path for path in found if path.is_file())


@cache
def texts() -> list[tuple[str, str]]:
    """Return path and text of every file that is text and not huge (some samples are neither)."""
    found = []
    for path in our_files():
        data = path.read_bytes()
        if len(data) <= MAX_BYTES and b"\0" not in data:
            found.append((str(path.relative_to(ROOT)), data.decode("utf-8", "replace")))
    return found


def test_no_file_names_a_machine_or_a_registry() -> None:
    """A clone works anywhere: no absolute path of a machine, no package registry's address."""
    found = [
        f"{path}:{text.count(chr(10), 0, match.start()) + 1}: {match[0]}"
        for path, text in texts()
        for pattern in FORBIDDEN
        for match in pattern.finditer(text)
    ]
    assert found == []


def test_python_files_stay_short() -> None:
    """A module that outgrows 600 lines has two subjects."""
    lengths = {path: text.count("\n") for path, text in texts() if path.endswith((".py", "dev"))}
    assert {path: lines for path, lines in lengths.items() if lines > MAX_LINES} == {}


def test_classes_and_functions_have_one_meaning_each() -> None:
    """No public name of a class stands for two things, and no function outgrows 60 lines."""
    found = [Module(str(path.relative_to(ROOT)), path.stem, "", tree_of(path)) for path in MODULES]
    public_twice, _ = repeated_names(found)
    assert public_twice == {}
    assert long_functions(found) == []


@pytest.mark.parametrize("lock", ["package-lock.json", "scripts/chromium/package-lock.json"])
def test_npm_locks_keep_hashes_and_no_addresses(lock: str) -> None:
    """Each locked package is pinned by its hash, and comes from whatever registry is configured."""
    packages = json.loads((ROOT / lock).read_text("utf-8"))["packages"]
    locked = {name: entry for name, entry in packages.items() if name}
    assert locked
    assert [name for name, entry in locked.items() if "resolved" in entry] == []
    assert [name for name, entry in locked.items() if "integrity" not in entry] == []


def test_git_ignores_what_the_tools_make() -> None:
    """Nothing that a tool makes in the tree can be committed by accident."""
    ignored = (ROOT / ".gitignore").read_text("utf-8").split()
    assert [name for name in NOT_OURS - {".git"} if f"{name}/" not in ignored] == []


def test_the_changelog_stays_short() -> None:
    """A user reads the first version in a minute, and every later entry in a breath."""
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    unreleased, _, first = text.partition("\n## [0.1.0]")
    assert len(re.findall(r"^- ", first, re.MULTILINE)) <= 60
    sections = re.findall(r"^### (.+)", unreleased, re.MULTILINE)
    assert sections == ["Added", "Changed", "Fixed", "Security"]
    entries = re.findall(r"^- (.+)", text, re.MULTILINE)
    assert [entry for entry in entries if len(entry.split()) > 25] == []
