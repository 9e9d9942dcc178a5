"""One robot's readings to all who watch it: flushed at once, then at most once a display frame.

Floor 5. Nothing is queued for anybody. A flush only wakes the clients; each takes, when its own
line is free, everything newer than what it has already sent. Clients at the same place share one
encoded text, so a frame is encoded once however many watch; one that fell behind gets the newest
values merged into one frame, and is nobody else's problem.
"""

from dataclasses import dataclass
from typing import Protocol

from urc.runtime.clock import Clock, LoopClock
from urc.runtime.hub import Hub, LinkStatus
from urc.web.wire import encode_links, encode_log, encode_values

__all__ = ["FRAMES_PER_SECOND", "Fanout", "Listener", "Pacer", "Place"]

FRAMES_PER_SECOND = 60.0
LOG_LINES_FOR_NEWCOMERS = 50
SHARED_FOR_S = 0.005
"""How long an encoded frame may be handed out again: the ages in it are those of its encoding."""


class Listener(Protocol):
    """Somebody who wants to know that there is something new."""

    def wake(self) -> None:
        """Take a look, soon. Must return at once."""


@dataclass(slots=True)
class Place:
    """How far one client has got."""

    revision: int = 0
    """Hub revision up to which it has the values."""
    links: int = 0
    """Number of the link state it has."""
    notes: int = 0
    """Log lines it has, or was told it lost."""


@dataclass(frozen=True, slots=True)
class _Frame:
    """An encoded frame, the revision it leads to, and when it was encoded."""

    text: str
    revision: int
    time_s: float


class Pacer:
    """Lets the first of a burst through at once, and then a steady rate.

    One period of tolerance: a source at just this rate, with jitter, is never held back, and no
    second sees more than one frame above the rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._due_s = 0.0

    def delay_s(self, now_s: float) -> float:
        """Return how long to wait before the next one may go; 0 = now."""
        return max(0.0, self._due_s - self._period_s - now_s)

    def went(self, now_s: float) -> None:
        """Count one that went."""
        self._due_s = max(now_s, self._due_s) + self._period_s


class Fanout:
    """The shared flush of one open session."""

    def __init__(
        self,
        hub: Hub,
        *,
        rate_hz: float = FRAMES_PER_SECOND,
        clock: Clock | None = None,
    ) -> None:
        self.hub = hub
        self.listeners: set[Listener] = set()
        self._clock: Clock = clock or LoopClock()
        self._pacer = Pacer(rate_hz)
        self._head = 0
        self._frames: dict[int, _Frame] = {}
        self._links: tuple[LinkStatus, ...] = ()
        self._links_number = 0

    async def run(self) -> None:
        """Flush for ever; ends by being cancelled."""
        with self.hub.subscribe() as subscription:
            while True:
                await subscription.changed()
                delay_s = self._pacer.delay_s(self._clock.now())
                if delay_s > 0:
                    await self._clock.sleep(delay_s)
                self._pacer.went(self._clock.now())
                self.flush()
                subscription.seen = self._head

    def flush(self) -> None:
        """Forget the last frame and wake everybody. Touches no socket."""
        self._head = self.hub.revision
        self._frames.clear()
        for listener in self.listeners:
            listener.wake()

    def newcomer(self) -> Place:
        """Return the place of a client that knows nothing yet."""
        return Place(notes=max(0, self.hub.notes_count - LOG_LINES_FOR_NEWCOMERS))

    def take(self, place: Place) -> list[str]:
        """Return the messages that bring `place` up to date, and move it there."""
        messages = [self._take_links(place), self._take_values(place), self._take_log(place)]
        return [message for message in messages if message]

    def _take_values(self, place: Place) -> str:
        if place.revision >= self._head:
            return ""  # what came since the last flush waits for the next one
        now_s = self._clock.now()
        frame = self._frames.get(place.revision)
        if frame is None or now_s - frame.time_s > SHARED_FOR_S:
            samples = self.hub.changed_since(place.revision)
            text = encode_values(samples, self.hub.index, now_s) if samples else ""
            frame = self._frames[place.revision] = _Frame(text, self.hub.revision, now_s)
        place.revision = frame.revision
        return frame.text

    def _take_links(self, place: Place) -> str:
        links = tuple(self.hub.links.values())
        if links != self._links:
            self._links = links
            self._links_number += 1
        if place.links == self._links_number:
            return ""
        place.links = self._links_number
        return encode_links(links, self._clock.now())

    def _take_log(self, place: Place) -> str:
        wanted = self.hub.notes_count - place.notes
        if wanted <= 0:
            return ""
        place.notes = self.hub.notes_count
        kept = list(self.hub.notes)[-wanted:]
        return encode_log(kept, self.hub.notes_count - len(kept), self._clock.now())
