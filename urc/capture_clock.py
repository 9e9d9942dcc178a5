"""The age that times of capture state, without synchronised clocks.

Pure. A camera's clock may differ from the clock of this computer by any amount, so a single time of
capture states no age. URC therefore compares: the difference between arrival and capture contains
the offset of both clocks and the delay of the image. The smallest difference within `WINDOW_S`
counts as the offset. An image whose difference is larger has waited at least for as long as its
difference exceeds the smallest one.

The result is a lower bound of the delay: its constant part cannot be told from the offset of the
clocks. A delay that grows and stays for longer than `WINDOW_S` counts as constant, as does the
drift of a clock.

In a stream in order, the difference grows by no more than the time between two arrivals. If it
grows by more, the camera's clock was set back. A difference far below the smallest one means that
the clock was set forward, or that a delay of the whole stream has ended. In both cases, the
comparison starts again.
"""

import math
from collections import deque
from typing import Final, NamedTuple

__all__ = ["WINDOW_S", "CaptureAge", "CaptureClock", "step_words"]

WINDOW_S: Final = 300.0
"""Time for which the smallest difference is remembered, in seconds."""
_PART_S: Final = 15.0
"""The window is divided into parts, so that its memory is bounded."""
AHEAD_S: Final = 0.5
"""Largest step below the smallest difference without a new comparison, in seconds."""
TOLD_EVERY_S: Final = 60.0
"""Minimum time between two reported steps of a clock, in seconds."""


class CaptureAge(NamedTuple):
    """The meaning of one time of capture."""

    older_s: float
    """Minimum time that the image has waited before its arrival, in seconds; 0 or more."""
    step_s: float = 0.0
    """Step of the camera's clock, in seconds, if it is worth a line in the log; otherwise 0."""


class CaptureClock:
    """The comparison of one camera's clock with the clock of this computer."""

    def __init__(self, reorder_s: float = 0.1) -> None:
        """Begin without a comparison.

        Args:
            reorder_s: time by which an image may be captured before the previous one, in seconds,
                because a stream may send its images in another order.
        """
        self._reorder_s = reorder_s
        self._parts: deque[tuple[float, float]] = deque()
        """Start and smallest difference of each part of the window, in seconds."""
        self._newest_s = -math.inf
        """Latest time of capture."""
        self._last = 0.0
        """Difference of the previous image."""
        self._count = 0
        self._told_s = -math.inf

    def age(self, captured_s: float, arrived_s: float) -> CaptureAge:
        """Return what the time of capture of the next image states.

        Args:
            captured_s: time of capture on the camera's clock, in seconds; must be finite.
            arrived_s: time of arrival on this computer's monotonic clock, in seconds.
        """
        offset = arrived_s - captured_s
        least = min((one for _, one in self._parts), default=offset)
        is_back = captured_s < self._newest_s - self._reorder_s
        is_step = is_back or offset < least - AHEAD_S
        step_s = self._step_s(offset, arrived_s) if is_step else 0.0
        if is_step:
            self._parts.clear()
            self._newest_s, self._count = -math.inf, 0
        self._newest_s = max(self._newest_s, captured_s)
        self._last = offset
        self._count += 1
        older_s = max(0.0, offset - self._least(offset, arrived_s))
        return CaptureAge(older_s, step_s)

    def _least(self, offset: float, now_s: float) -> float:
        """Add a difference to the window, and return the smallest one."""
        parts = self._parts
        if parts and now_s - parts[-1][0] < _PART_S:
            parts[-1] = parts[-1][0], min(parts[-1][1], offset)
        else:
            parts.append((now_s, offset))
        while now_s - parts[0][0] > WINDOW_S:
            parts.popleft()
        return min(one for _, one in parts)

    def _step_s(self, offset: float, now_s: float) -> float:
        """Return a step to report; 0 after a single image, and soon after another report."""
        if self._count < 2 or now_s - self._told_s < TOLD_EVERY_S:
            return 0.0
        self._told_s = now_s
        return self._last - offset


def step_words(step_s: float) -> str:
    """Return the log entry for a step of a camera's clock, in seconds."""
    where = "ahead of" if step_s > 0 else "behind"
    return (
        f"the times of capture are suddenly {abs(step_s):.1f} s {where} the earlier ones; URC"
        " compares the clocks again"
    )
