"""The check of a document: `urc validate` itself, on files in memory.

`check` runs the command with the same arguments as on a command line, so its report is the report
of the command.
"""

import io
import json
import re
import shutil
from collections.abc import Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

from urc.cli.main import main
from urc.shipped import shipped

__all__ = ["UNNAMED", "check", "file_name", "report"]

UNNAMED = "document.yaml"
"""File name of a document without a usable name."""
_NAME = re.compile(r"^name: *['\"]?([a-z0-9][a-z0-9_-]{0,63})['\"]?\s*(?:#.*)?$", re.MULTILINE)
_KIND = re.compile(r"^kind: *widget\b", re.MULTILINE)
_SHELVES = ("drivers", "interfaces", "models")
"""Folders next to the shipped robots, whose documents refer to them."""


def check(text: str, folder: str) -> str:
    """Check one document, and return the JSON report of `urc validate` as text.

    The document lies next to copies of the shipped drivers and interfaces, so a shipped robot can
    be edited.

    Args:
        text: content of the document.
        folder: folder for the document; created if it is missing.
    """
    home = Path(folder)
    home.mkdir(parents=True, exist_ok=True)
    for name in _SHELVES:
        if not (home / name).exists():
            shutil.copytree(shipped("robots") / name, home / name)
    path = file_name(text)
    return report(folder, path, {path: text.encode("utf-8", "surrogatepass")})


def file_name(text: str) -> str:
    """Return the file name that the text of a document expects, relative to its folder."""
    found = _NAME.search(text)
    if found is None:
        return UNNAMED
    return f"{found[1]}/widget.yaml" if _KIND.search(text) else f"{found[1]}.yaml"


def report(folder: str, path: str, files: Mapping[str, bytes] | None = None) -> str:
    """Return the JSON report of ``urc validate PATH`` in a folder, as text.

    Args:
        folder: working directory of the command.
        path: path of the document, relative to `folder`.
        files: files to write into the folder before the check, by relative path.
    """
    for name, data in (files or {}).items():
        file = Path(folder, name)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    out, err = _terminal(), _terminal()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        main(["validate", "--format", "json", path])
    return _written(out) or json.dumps({"fault": _written(err) or "the check printed nothing"})


def _terminal() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), "utf-8", newline="\n", write_through=True)


def _written(file: io.TextIOWrapper) -> str:
    file.seek(0)
    return file.read().strip()
