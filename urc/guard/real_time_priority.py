"""Real-time priority of the guard process, where the system permits it.

Real-time priority suits the guard, because the guard does only a bounded amount of work in each
turn. The guard uses the lowest real-time priority (``SCHED_RR``, 1), which has precedence over
ordinary programs but not over other real-time programs. Two limits prevent a faulty guard from
blocking the machine. After `LONGEST_S` seconds of uninterrupted work, the guard runs at ordinary
priority for `PAUSE_S` seconds. After `FATAL_S` seconds, the kernel kills the guard, and the server
starts a new guard. Child threads and child processes run at ordinary priority.
"""

import os
import signal
import sys
import time
from types import FrameType
from typing import Final

from urc._environment import REAL_TIME

__all__ = ["FATAL_S", "LONGEST_S", "PAUSE_S", "RealTimePriority", "why_not"]

LONGEST_S: Final = 0.1
FATAL_S: Final = 2.0
PAUSE_S: Final = 1.0
_PRIORITY: Final = 1
_NOT_HERE: Final = "this system does not support real-time priority"

if sys.platform == "linux":
    import resource

    def _ask() -> str:
        """Request real-time priority; return the reason for a refusal, "" on success."""
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

else:  # pragma: no cover - not on the tested systems

    def _ask() -> str:
        return _NOT_HERE

    def _give_back() -> None:
        """Do nothing."""

    def _bound(longest_s: float, fatal_s: float) -> None:
        """Do nothing."""


class RealTimePriority:
    """The real-time priority of this process."""

    def __init__(self) -> None:
        """Create the object without requesting real-time priority."""
        self._again_s: float | None = None
        """Time at which the pause ends and the priority is requested again, in seconds; None
        without a pause.
        """

    def request(self) -> str:
        """Request real-time priority; return the reason for a refusal, "" on success."""
        if os.environ.get(REAL_TIME, "").lower() == "no":
            return f"{REAL_TIME} is no"
        refusal = _ask()
        if not refusal:
            signal.signal(signal.SIGXCPU, self._is_too_long)
            _bound(LONGEST_S, FATAL_S)
        return refusal

    def retry(self) -> None:
        """Request the priority again after the pause; the guard calls this method regularly."""
        if self._again_s is not None and time.monotonic() >= self._again_s:
            self._again_s = None
            _ask()

    def _is_too_long(self, number: int, frame: FrameType | None) -> None:
        _give_back()
        self._again_s = time.monotonic() + PAUSE_S


def why_not() -> str:
    """Return why a guard on this machine cannot get real-time priority; "" if it can."""
    if os.environ.get(REAL_TIME, "").lower() == "no":
        return f"{REAL_TIME} is no"
    refusal = _ask()
    if not refusal:
        _give_back()
    return refusal
