"""A terminal status line that shows the current step and the duration of long work.

Layer 6. The line is printed to standard error and erased at the end. Without a terminal, nothing is
printed, so logs and pipes contain no status lines.
"""

import sys
import threading
import time
from types import TracebackType
from typing import Self

from urc.cli.colours import is_terminal, painted
from urc.problems import printable

__all__ = ["Progress"]

_FIRST_S = 0.4
"""Delay before the first status line, in seconds; shorter work shows no status line."""
_EVERY_S = 0.2
_COLUMNS = 78
_ERASE = "\r\x1b[K"


class Progress:
    """Shows a status line while the context is active; `step` sets the line's text.

    A thread prints the line, because the work may block. The command must not print other output
    before the context ends.

    Args:
        title: name of the work, such as ``loading robots``.
        total: number of steps; 0 if unknown.
    """

    def __init__(self, title: str, total: int = 0) -> None:
        self._title = title
        self._total = total
        self._done = 0
        self._detail = ""
        self._start_s = time.monotonic()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        """Start the status line, if standard error is a terminal."""
        if is_terminal(sys.stderr):
            self._thread = threading.Thread(target=self._work, name="progress", daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Erase the status line."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()

    def step(self, detail: str = "") -> None:
        """Begin the next step; `detail` is its name, such as ``puppet`` for a robot."""
        self._done += 1
        self._detail = detail

    def line(self) -> str:
        """Return the current status line, without control sequences."""
        parts = [self._title]
        if self._total:
            parts.append(f"{self._done} of {self._total}")
        if self._detail:
            parts.append(printable(self._detail))
        seconds = time.monotonic() - self._start_s
        if seconds >= 1:
            parts.append(f"{seconds:.0f} s")
        return " · ".join(parts)[:_COLUMNS]

    def _work(self) -> None:
        is_shown = False
        wait_s = _FIRST_S
        while not self._ended.wait(wait_s):
            print(_ERASE + painted(self.line(), "quiet", sys.stderr), end="", file=sys.stderr)
            sys.stderr.flush()
            is_shown, wait_s = True, _EVERY_S
        if is_shown:
            print(_ERASE, end="", file=sys.stderr, flush=True)
