"""Distribution of one robot's alarms to all its pages.

Layer 5. A page receives all alarms once, and then only changes, at most five times a second. For
example, 200 alarms in 10 s result in 50 messages per page. Each message is encoded once for all
pages with the same position.
"""

import time
from collections.abc import Callable
from typing import Final

from urc.runtime.clock import Clock, Timer
from urc.runtime.robot_alarms import RobotAlarms
from urc.web.feed.fanout import Pacer
from urc.web.wire.alarms import encode_alarms

__all__ = ["MESSAGES_PER_S", "AlarmFeed", "AlarmPlace"]

MESSAGES_PER_S: Final = 5.0
_ENCODED: Final = 64
"""Maximum number of cached messages."""


class AlarmPlace:
    """The position of one page in the sequence of alarm changes."""

    __slots__ = ("edition", "revision")

    def __init__(self) -> None:
        self.edition = -1
        """Edition of the alarm list that was last sent to the page; -1 before the first message."""
        self.revision = 0


class AlarmFeed:
    """The encoded alarm messages of one robot and the callbacks of its pages."""

    def __init__(self, alarms: RobotAlarms, clock: Clock) -> None:
        self._alarms = alarms
        self._clock = clock
        self._wakes: set[Callable[[], None]] = set()
        self._pacer = Pacer(MESSAGES_PER_S)
        self._due: Timer | None = None
        self._messages: dict[tuple[int, int], str] = {}
        self._encoded_at = (-1, -1)
        self._head = 0
        """Revision at the last flush; newer changes wait for the next flush."""
        alarms.on_change = self._changed

    def join(self, wake: Callable[[], None]) -> AlarmPlace:
        """Add a callback for changes and return the position of a new page."""
        self._wakes.add(wake)
        return AlarmPlace()

    def leave(self, wake: Callable[[], None]) -> None:
        """Stop calling `wake`."""
        self._wakes.discard(wake)

    def news(self, place: AlarmPlace) -> list[str]:
        """Return a page's next message, if any, and advance the page's position."""
        edition = self._alarms.edition
        is_full = place.edition != edition
        if not is_full and place.revision >= self._head:
            return []
        alarms = self._alarms.list
        if place.edition < 0 and not (alarms.records or alarms.is_flooded):
            place.edition, place.revision = edition, alarms.revision
            return []  # a new page already assumes that there are no alarms
        at = (edition, alarms.revision)
        if at != self._encoded_at or len(self._messages) >= _ENCODED:
            self._encoded_at = at
            self._messages.clear()
        key = (place.edition, place.revision)
        if key not in self._messages:
            self._messages[key] = self._encode(-1 if is_full else place.revision)
        place.edition, place.revision = edition, alarms.revision
        return [self._messages[key]]

    def _encode(self, since: int) -> str:
        alarms = self._alarms.list
        if since < 0:
            names = [*alarms.records]
        else:
            names = [name for name, at in alarms.changed.items() if at > since and name]
        return encode_alarms(
            [alarms.records[name] for name in names if name in alarms.records],
            [name for name in names if name not in alarms.records],
            self._alarms.signals,
            time.time(),
            is_full=since < 0,
            is_flooded=alarms.is_flooded,
        )

    def _changed(self) -> None:
        if self._due is not None or not self._wakes:
            if not self._wakes:
                self._head = self._alarms.list.revision
            return
        # Never flush immediately, because one frame may change many alarms.
        self._due = self._clock.call_at(max(self._clock.now(), self._pacer.free_s), self._flush)

    def _flush(self) -> None:
        self._due = None
        self._pacer.went(self._clock.now())
        self._head = self._alarms.list.revision
        for wake in tuple(self._wakes):
            wake()
