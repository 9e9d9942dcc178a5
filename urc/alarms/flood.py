"""Floods and bursts of alarms, as in ISA-18.2.

Layer 3. Pure. A flood begins when more than 10 alarms occur in 10 minutes, because one operator can
handle at most 10. A flood ends when fewer than 5 alarms occur in 10 minutes. In a burst, each alarm
begins at most 5 s after the previous alarm. The first alarm in a burst is often the cause of the
other alarms.
"""

from collections import deque
from typing import Final

__all__ = ["BURST_GAP_S", "FLOOD_BEGINS", "FLOOD_ENDS", "FLOOD_S", "FloodDetector"]

FLOOD_S: Final = 600.0
FLOOD_BEGINS: Final = 10
"""A flood begins when more than this number of alarms occur within `FLOOD_S` seconds."""
FLOOD_ENDS: Final = 5
"""A flood ends when fewer than this number of alarms have occurred within `FLOOD_S` seconds."""
BURST_GAP_S: Final = 5.0
"""Longest time between two alarms of one burst, in seconds."""


class FloodDetector:
    """Detects the floods and bursts of one robot's alarms."""

    def __init__(self, group: int = 0) -> None:
        """Start without alarms; `group` is the number of the last burst before the restart."""
        self.is_flooded = False
        self.group = group
        """Number of the current burst; each new burst gets the next number."""
        self._times: deque[float] = deque(maxlen=FLOOD_BEGINS + 1)
        """Times of the newest alarms; a flood begins if the oldest is at most `FLOOD_S` old."""

    def count(self, now: float) -> None:
        """Count one alarm."""
        if not self._times or not 0 <= now - self._times[-1] <= BURST_GAP_S:
            self.group += 1
        self._times.append(now)
        if len(self._times) > FLOOD_BEGINS and now - self._times[0] <= FLOOD_S:
            self.is_flooded = True

    @property
    def deadline(self) -> float | None:
        """Time at which the flood ends if no further alarms occur; None if there is no flood."""
        return self._times[-FLOOD_ENDS] + FLOOD_S if self.is_flooded else None

    def tick(self, now: float) -> None:
        """End a flood if the alarm rate has fallen, or if the clock has been set back since."""
        end = self.deadline
        if end is not None and not end - FLOOD_S <= now < end:
            self.is_flooded = False
            self._times.clear()
