"""One robot's readings to all who watch it: flushed at once, then at most once a display frame.

Floor 5. Nothing is queued for anybody. A flush only wakes the clients; each takes, when its own
line is free, everything newer than what it has already sent. Clients at the same place share one
encoded text, so a frame is encoded once however many watch; one that fell behind gets the newest
values merged into one frame, and is nobody else's problem.
"""

from dataclasses import dataclass
from typing import Protocol

from urc.model.values import Sample
from urc.runtime.clock import Clock, LoopClock
from urc.runtime.hub import Hub, LinkStatus, Progress
from urc.web.picture_shelf import PictureShelf, is_picture
from urc.web.wire import encode_links, encode_log, encode_values
from urc.web.wire_ask import encode_progress
from urc.web.wire_picture import as_frame

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
    progress: int = 0
    """Number of the state of the sequences it has."""
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
        self._framed = ("", b"")
        self._looked_at = -1
        self._links: tuple[LinkStatus, ...] = ()
        self._links_number = 0
        self._pictures = {name for name, signal in hub.signals.items() if is_picture(signal)}
        self.shelf = PictureShelf(hub, self._clock)
        self._progress: tuple[Progress, ...] = ()
        self._progress_number = 0

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
        """Forget the last frame and wake everybody."""
        self._head = self.hub.revision
        self._frames.clear()
        for listener in self.listeners:
            listener.wake()

    def newcomer(self) -> Place:
        """Return the place of a client that knows nothing yet."""
        return Place(notes=max(0, self.hub.notes_count - LOG_LINES_FOR_NEWCOMERS))

    def take(self, place: Place) -> list[str]:
        """Return the messages that bring `place` up to date, and move it there."""
        if self._looked_at != self.hub.revision:
            self._look()
        messages = []
        if place.links != self._links_number:
            place.links = self._links_number
            messages.append(encode_links(self._links, self._clock.now()))
        if values := self._take_values(place):
            messages.append(values)
        if log := self._take_log(place):
            messages.append(log)
        if place.progress != self._progress_number:
            place.progress = self._progress_number
            messages.append(encode_progress(self._progress))
        return messages

    def _look(self) -> None:
        """Number what is not a value anew, when it has changed; once for all clients."""
        self._looked_at = self.hub.revision
        links = tuple(self.hub.links.values())
        if links != self._links:
            self._links = links
            self._links_number += 1
        progress = tuple(self.hub.progress.values())
        if progress != self._progress:
            self._progress = progress
            self._progress_number += 1

    def _take_values(self, place: Place) -> str:
        if place.revision >= self._head:
            return ""  # what came since the last flush waits for the next one
        now_s = self._clock.now()
        frame = self._frames.get(place.revision)
        if frame is None or now_s - frame.time_s > SHARED_FOR_S:
            samples = self._plain(self.hub.changed_since(place.revision))
            text = encode_values(samples, self.hub.index, now_s) if samples else ""
            frame = self._frames[place.revision] = _Frame(text, self.hub.revision, now_s)
        place.revision = frame.revision
        return frame.text

    def frame_of(self, text: str) -> bytes:
        """Return a message of `take` as a WebSocket frame; made once for all who got the same."""
        if text is not self._framed[0]:
            self._framed = (text, as_frame(text.encode(), is_text=True))
        return self._framed[1]

    def _plain(self, samples: list[Sample]) -> list[Sample]:
        """Return the readings without the images, which only go to those who show them."""
        if not self._pictures:
            return samples
        return [
            sample
            for sample in samples
            if sample.signal not in self._pictures or sample.value is None
        ]

    def _take_log(self, place: Place) -> str:
        wanted = self.hub.notes_count - place.notes
        if wanted <= 0:
            return ""
        place.notes = self.hub.notes_count
        kept = list(self.hub.notes)[-wanted:]
        return encode_log(kept, self.hub.notes_count - len(kept), self._clock.now())
