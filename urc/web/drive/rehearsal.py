"""Goes the way of a tick shortly before one is due, so that the processor has it at hand.

Floor 5. Between two ticks this process and the guard sleep for tens of milliseconds. Meanwhile
others push what both need out of the processor's caches, and fetching it again takes longer than
everything that is then done with it. So the last tick is read once more, is looked at and rendered,
and goes to the guard, which does the same with it. Nothing of it counts, nothing is written to the
robot: it is known to be no tick everywhere on its way.
"""

from collections.abc import Callable
from typing import Final

from urc.motion.fresh import Input
from urc.motion.pace import Pace
from urc.motion.rhythm import Rhythm
from urc.runtime.clock import Alarm, Clock
from urc.runtime.motion import MotionDesk
from urc.web.serve.frames import again
from urc.web.wire import drive as wire

__all__ = ["AHEAD_S", "APART_S", "EVERY_S", "MOST", "Rehearsal"]

AHEAD_S: Final = 0.002
"""How long before a tick is due."""
EVERY_S: Final = 0.001
"""Again and again until it comes, ..."""
MOST: Final = 8
"""... but no more often than this, ..."""
APART_S: Final = 0.0003
"""... and not so close to the time at which it is due: it would have to wait for the end."""


class Rehearsal:
    """Of the ticks of whoever drives a robot."""

    def __init__(self, clock: Clock, desk: Callable[[], MotionDesk]) -> None:
        """Prepare; `desk` returns the one that looks at ticks now."""
        self._clock = clock
        self._desk = desk
        self._rhythm = Rhythm()
        self._pace = Pace(EVERY_S)
        self._alarm: Alarm | None = None
        self._left = 0
        self._due_s = 0.0
        self._client = ""
        self._data = b""

    def take(self, client: str, data: bytes, now: float) -> None:
        """Take note of a tick that was taken, as it came."""
        due_s = self._rhythm.take(now)
        self.end()
        if due_s is not None:
            self._client, self._data = client, data
            self._left, self._due_s = MOST, due_s
            self._alarm = self._clock.call_at(max(due_s - AHEAD_S, now + EVERY_S), self._ring)

    def end(self) -> None:
        """Rehearse no more until the next tick."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _ring(self) -> None:
        now = self._clock.now()
        self._left -= 1
        self._alarm = self._clock.call_at(now + EVERY_S, self._ring) if self._left else None
        if abs(now - self._due_s) < APART_S:
            return
        try:
            tick = wire.decode_tick(again(self._data))
        except wire.NO_TICK:
            return
        self._pace.take(now)
        given = tuple.__new__(Input, (tick.epoch, tick.number + 1, tick.echo))  # as the next one
        self._desk().tick(self._client, tick.command, tick.arguments, given, now, counts=False)
