"""Finds the SQLite connections that a test leaves open.

Since Python 3.13, an open connection warns when it is collected as garbage: usually in a later
test, which then fails. Here each connection knows where it was opened, with any Python.
"""

import sqlite3
import threading
import traceback
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["left_open", "watch"]

ROOT = Path(__file__).resolve().parents[1]
_connect = sqlite3.connect


class _Opening(NamedTuple):
    """Where a connection was opened."""

    place: str
    is_main: bool
    """Whether the main thread did it; other threads serve the fixtures of a whole module."""


_open: dict[int, _Opening] = {}
"""The open connections, by their identity."""


class _Connection(sqlite3.Connection):
    """A connection that tells when it is closed."""

    def close(self) -> None:
        super().close()
        _open.pop(id(self), None)


def watch() -> None:
    """Let `sqlite3.connect` remember each connection until it is closed."""
    sqlite3.connect = _watched  # type: ignore[assignment]


def _watched(*args: Any, **kwargs: Any) -> sqlite3.Connection:
    connection = _connect(*args, factory=_Connection, **kwargs)
    places = [
        f"{Path(frame.filename).relative_to(ROOT)}:{frame.lineno}"
        for frame in traceback.extract_stack(limit=12)
        if frame.filename.startswith((f"{ROOT}/urc", f"{ROOT}/tests")) and frame.name != "_watched"
    ]
    is_main = threading.current_thread() is threading.main_thread()
    _open[id(connection)] = _Opening(" < ".join(reversed(places[-4:])), is_main)
    return connection


def left_open(*, is_last: bool) -> list[str]:
    """Return the places that opened a connection which is still open; they are told once.

    Those of other threads are told after the last test of a module.
    """
    found = {key: one for key, one in _open.items() if one.is_main or is_last}
    for key in found:
        del _open[key]
    return [one.place for one in found.values()]
