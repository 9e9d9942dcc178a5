"""The turns in which the guards of one event loop start.

A guard needs a processor for 0.1 to 0.4 s to load its modules. Twenty guards that start together
leave the server too little processor time for the ticks of driven robots. Decision record:
docs/decisions/0052-guards-start-in-turns.md.
"""

import asyncio
import os
from collections.abc import Callable
from typing import Final
from weakref import WeakKeyDictionary

__all__ = ["START_TIMEOUT_S", "StartTurns", "start_turns"]

START_TIMEOUT_S: Final = 2.0
"""Maximum time for which a guard without a heartbeat keeps its turn, in seconds."""
_MOST: Final = 4
"""Maximum number of guards that start at the same time. A program in a container may see more
processors than it can use, so the number of processors alone is not a reliable limit."""


class StartTurns:
    """The guards that are starting, and the guards waiting for their turn, oldest first."""

    def __init__(self, at_once: int) -> None:
        """Create the turns before any guard starts.

        Args:
            at_once: maximum number of guards that start at the same time.
        """
        self._at_once = at_once
        self._starting: dict[object, asyncio.TimerHandle] = {}
        self._waiting: dict[object, Callable[[], None]] = {}

    def take(self, guard: object, launch: Callable[[], None]) -> None:
        """Call `launch` now, or when it is the guard's turn; requires a running event loop."""
        self._waiting[guard] = launch
        self._launch_next()

    def hurry(self, guard: object) -> None:
        """Launch a waiting guard now, before its turn; do nothing for any other guard."""
        launch = self._waiting.pop(guard, None)
        if launch is not None:
            loop = asyncio.get_running_loop()
            self._starting[guard] = loop.call_later(START_TIMEOUT_S, self.end, guard)
            launch()

    def end(self, guard: object) -> None:
        """End the turn or the wait of a guard that has started, failed or become unnecessary."""
        self._waiting.pop(guard, None)
        timer = self._starting.pop(guard, None)
        if timer is not None:
            timer.cancel()
            self._launch_next()

    def _launch_next(self) -> None:
        while self._waiting and len(self._starting) < self._at_once:
            self.hurry(next(iter(self._waiting)))


_turns: WeakKeyDictionary[asyncio.AbstractEventLoop, StartTurns] = WeakKeyDictionary()


def start_turns() -> StartTurns:
    """Return the start turns of the running event loop.

    The number of turns is the number of processors minus one, but at least 1 and at most 4. The
    remaining processor stays free for the robots that are being driven.
    """
    loop = asyncio.get_running_loop()
    return _turns.setdefault(loop, StartTurns(min(max(_processors() - 1, 1), _MOST)))


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
