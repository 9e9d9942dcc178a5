"""Lets the guard run before everything ordinary, where the system allows it.

It is the process for that: no template, pattern or parser of a document runs in it, and what it
does in a turn is bounded. It has the lowest real-time priority (``SCHED_RR``, 1), so it goes before
other programs, and after everything that somebody has put in order with more care. Two things keep
it from starving the machine when it has a fault all the same: whoever runs for `LONGEST_S` without
waiting is ordinary for `PAUSE_S`, and whoever goes on for `FATAL_S` is ended by the kernel, which
the server notices. Threads and programs that it starts are ordinary.
"""

import os
import signal
import sys
import time
from types import FrameType
from typing import Final

__all__ = ["FATAL_S", "LONGEST_S", "PAUSE_S", "SWITCH", "RealTimePriority", "why_not"]

SWITCH: Final = "URC_REAL_TIME"
"""Environment variable; ``no``: it is not asked for."""
LONGEST_S: Final = 0.1
FATAL_S: Final = 2.0
PAUSE_S: Final = 1.0
_PRIORITY: Final = 1
_NOT_HERE: Final = "this system has none"

if sys.platform == "linux":
    import resource

    def _ask() -> str:
        """Ask for it; return why it was not given, or ""."""
        policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
        try:
            os.sched_setscheduler(0, policy, os.sched_param(_PRIORITY))
        except OSError as refused:
            return refused.strerror or "refused"
        return ""

    def _give_back() -> None:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))

    def _bound(longest_s: float, fatal_s: float) -> None:
        bounds = int(longest_s * 1e6), int(fatal_s * 1e6)
        resource.setrlimit(resource.RLIMIT_RTTIME, bounds)

else:  # pragma: no cover - not on the systems that are tested

    def _ask() -> str:
        return _NOT_HERE

    def _give_back() -> None:
        """There is nothing."""

    def _bound(longest_s: float, fatal_s: float) -> None:
        """There is nothing."""


class RealTimePriority:
    """Of this process."""

    def __init__(self) -> None:
        """Nothing is asked for yet."""
        self._again_s: float | None = None
        """When it may be asked for again, after too long a run."""

    def request(self) -> str:
        """Ask for it; return why it was not given, or ""."""
        if os.environ.get(SWITCH, "").lower() == "no":
            return f"{SWITCH} is no"
        refusal = _ask()
        if not refusal:
            signal.signal(signal.SIGXCPU, self._is_too_long)
            _bound(LONGEST_S, FATAL_S)
        return refusal

    def retry(self) -> None:
        """Ask for it again when the pause after too long a run is over; called now and then."""
        if self._again_s is not None and time.monotonic() >= self._again_s:
            self._again_s = None
            _ask()

    def _is_too_long(self, number: int, frame: FrameType | None) -> None:
        _give_back()
        self._again_s = time.monotonic() + PAUSE_S


def why_not() -> str:
    """Return why a guard that is started here would not have it, or ""."""
    if os.environ.get(SWITCH, "").lower() == "no":
        return f"{SWITCH} is no"
    refusal = _ask()
    if not refusal:
        _give_back()
    return refusal
