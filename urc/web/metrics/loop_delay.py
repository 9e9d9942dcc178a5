"""The delay of the event loop, measured while clients request metrics.

Layer 5.
"""

from typing import Final

from prometheus_client import Histogram
from prometheus_client.metrics_core import Metric

from urc.runtime.clock import Clock, LoopClock, Timer

__all__ = ["LoopDelay"]

EVERY_S: Final = 0.25
"""Interval between two measurements, in seconds."""
ASKED_S: Final = 600.0
"""Time after the last request for metrics during which the delay is measured, in seconds."""
_BOUNDS: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)


class LoopDelay:
    """A histogram of how late the event loop calls a timer."""

    def __init__(self, clock: Clock | None = None) -> None:
        """Measure nothing until the first `asked`.

        Args:
            clock: source of time; None for the clock of the running event loop.
        """
        self._histogram = Histogram(
            "urc_event_loop_delay_seconds",
            "Delay of a timer in the server's event loop, measured four times a second.",
            buckets=_BOUNDS,
            registry=None,
        )
        self._clock: Clock = clock or LoopClock()
        self._timer: Timer | None = None
        self._due_s = self._asked_s = 0.0

    def asked(self) -> list[Metric]:
        """Return the delays so far, and go on measuring."""
        self._asked_s = self._clock.now()
        if self._timer is None:
            self._schedule()
        return list(self._histogram.collect())

    def close(self) -> None:
        """End the measurements."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _schedule(self) -> None:
        self._due_s = self._clock.now() + EVERY_S
        self._timer = self._clock.call_at(self._due_s, self._check)

    def _check(self) -> None:
        self._timer = None
        now_s = self._clock.now()
        self._histogram.observe(max(0.0, now_s - self._due_s))
        if now_s - self._asked_s <= ASKED_S:
            self._schedule()
