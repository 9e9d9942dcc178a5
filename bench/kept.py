"""Result rows of a long benchmark, stored so that an interrupted run can continue.

Each benchmark stores rows in one file in the user's cache. A complete run deletes this file. Rows
from other versions of the code are ignored.
"""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

__all__ = ["Kept"]

_ROOT: Final = Path(__file__).resolve().parents[1]


class Kept:
    """The stored rows of one benchmark."""

    def __init__(self, name: str) -> None:
        """Load the rows of an interrupted run with the same code."""
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "urc-bench")
        cache.mkdir(parents=True, exist_ok=True)
        self._file = cache / f"{name}-{_code()}.jsonl"
        lines = self._file.read_text("utf-8").splitlines() if self._file.exists() else []
        self.rows: list[Mapping[str, object]] = [json.loads(line) for line in lines]

    def add(self, row: Mapping[str, object]) -> None:
        """Store a row."""
        self.rows.append(row)
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    def end(self) -> Sequence[Mapping[str, object]]:
        """Return the rows of a complete run, and delete them from the cache."""
        self._file.unlink(missing_ok=True)
        return self.rows


def _code() -> str:
    """Return a hash of URC's Python files, which identifies the measured version."""
    total = hashlib.sha256()
    for file in sorted((_ROOT / "urc").rglob("*.py")):
        total.update(file.read_bytes())
    return total.hexdigest()[:12]
