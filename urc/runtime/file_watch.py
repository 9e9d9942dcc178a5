"""Detect changed, new and deleted files by polling, without an additional package.

Layer 4. The watch polls the path, not the open file, because editors often replace files.
"""

import os
import time
from collections.abc import Callable, Iterable
from typing import Final

__all__ = ["FileWatcher", "wait_for_change"]

PERIOD_S: Final = 0.25
_State = tuple[int, int, int] | None


class FileWatcher:
    """A watch for changed files, which stores the last known state of each file."""

    def __init__(self, files: Iterable[str]) -> None:
        self._states = {file: _state(file) for file in files}

    def add(self, files: Iterable[str]) -> None:
        """Watch additional files; files that are already watched keep their states."""
        for file in files:
            if file not in self._states:
                self._states[file] = _state(file)

    def changed(self) -> list[str]:
        """Return the changed files."""
        return [file for file, state in self._states.items() if _state(file) != state]

    def states(self) -> list[object]:
        """Return the current state of each file; if two results are equal, no file has changed."""
        return [_state(file) for file in self._states]


def wait_for_change(watched: FileWatcher, sleep: Callable[[float], None] = time.sleep) -> list[str]:
    """Wait until at least one file has changed and all files have been stable for one period.

    Return the changed files.

    The stable period ensures that files written in several steps are complete.
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
