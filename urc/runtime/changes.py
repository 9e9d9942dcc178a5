"""Waits until a file changes, comes or goes, by looking again and again: nothing to install for it.

Floor 4. Editors replace a file rather than write into it, so what counts is the name, not the file.
"""

import os
import time
from collections.abc import Callable, Iterable
from typing import Final

__all__ = ["Watched", "wait_for_change"]

PERIOD_S: Final = 0.25
_State = tuple[int, int, int] | None


class Watched:
    """Some files as they were when they were looked at."""

    def __init__(self, files: Iterable[str]) -> None:
        self._states = {file: _state(file) for file in files}

    def add(self, files: Iterable[str]) -> None:
        """Look at more files; those that are looked at already stay as they were."""
        for file in files:
            if file not in self._states:
                self._states[file] = _state(file)

    def changed(self) -> list[str]:
        """Return the files that are not as they were."""
        return [file for file, state in self._states.items() if _state(file) != state]

    def states(self) -> list[object]:
        """Return what every file is like now; equal when none of them changed in between."""
        return [_state(file) for file in self._states]


def wait_for_change(watched: Watched, sleep: Callable[[float], None] = time.sleep) -> list[str]:
    """Return the files that changed, once any did and all are left alone for one look.

    A program that writes a file in several steps would otherwise be seen in the middle of it.
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
