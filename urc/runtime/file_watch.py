"""Detection of changed, new and deleted files by polling, which needs no extra package.

Layer 4. Editors often replace a file, so the path is polled, not the open file.
"""

import os
import time
from collections.abc import Callable, Iterable
from typing import Final

__all__ = ["FileWatcher", "wait_for_change"]

PERIOD_S: Final = 0.25
_State = tuple[int, int, int] | None


class FileWatcher:
    """The last known states of some files."""

    def __init__(self, files: Iterable[str]) -> None:
        self._states = {file: _state(file) for file in files}

    def add(self, files: Iterable[str]) -> None:
        """Watch further files; known files keep their states."""
        for file in files:
            if file not in self._states:
                self._states[file] = _state(file)

    def changed(self) -> list[str]:
        """Return the changed files."""
        return [file for file, state in self._states.items() if _state(file) != state]

    def states(self) -> list[object]:
        """Return the current state of every file; equal results mean no change in between."""
        return [_state(file) for file in self._states]


def wait_for_change(watched: FileWatcher, sleep: Callable[[float], None] = time.sleep) -> list[str]:
    """Return the changed files, once one has changed and all are stable for one period.

    Otherwise, a program that writes a file in several steps would be caught half-way.
    """
    while not watched.changed():
        sleep(PERIOD_S)
    before: list[_State] = []
    while True:
        files = watched.changed()
        now = [_state(file) for file in files]
        if now == before:
            return files
        before = now
        sleep(PERIOD_S)


def _state(file: str) -> _State:
    try:
        status = os.stat(file)
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
