"""One robot's readings to all who watch it: flushed at once, then at most once a display frame.

Floor 5. Nothing is queued for anybody. A flush only wakes the clients; each takes, when its own
line is free, everything newer than what it has already sent. Clients at the same place share one
encoded text, so a frame is encoded once however many watch; one that fell behind gets the newest
values merged into one frame, and is nobody else's problem.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from urc.model.values import Sample
from urc.runtime.clock import Clock, LoopClock
from urc.runtime.hub import Hub, LinkStatus, Progress
from urc.web.picture_shelf import PictureShelf, is_picture
from urc.web.wire import encode_links, encode_log, encode_values
from urc.web.wire_ask import encode_progress
from urc.web.wire_picture import as_frame

__all__ = ["FRAMES_PER_SECOND", "Fanout", "Known", "Listener", "Pacer", "Place"]

FRAMES_PER_SECOND = 60.0
LOG_LINES_FOR_NEWCOMERS = 50
SHARED_FOR_S = 0.005
"""How long an encoded frame may be handed out again: the ages in it are those of its encoding."""


class Listener(Protocol):
    """Somebody who wants to know that there is something new."""

    def wake(self) -> None:
        """Take a look, soon. Must return at once."""


class Known(NamedTuple):
    """How far somebody has got."""

    revision: int = 0
    """Hub revision up to which it has the values."""
    links: int = 0
    """Number of the link state it has."""
    progress: int = 0
    """Number of the state of the sequences it has."""
    notes: int = 0
    """Log lines it has, or was told it lost."""


@dataclass(slots=True)
class Place:
    """One client's; those that have got equally far share what they know."""

    known: Known = field(default_factory=Known)


class _Frame(NamedTuple):
    """An encoded frame, the revision it leads to, and when it was encoded."""

    text: str
    revision: int
    time_s: float


class _Taken(NamedTuple):
    """What everybody gets who knows equally much."""

    before: Known
    after: Known
    messages: tuple[str, ...]
    frames: bytes
    """The same as WebSocket frames, one behind the other; empty until somebody wants them."""
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
        self._taken: dict[Known, _Taken] = {}
        self._usual: _Taken | None = None
        """What nearly everybody gets in the flush that is under way."""
        self._is_flushing = False
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
        self._taken.clear()
        self._is_flushing = True
        for listener in self.listeners:
            listener.wake()
        self._is_flushing = False
        self._usual = None

    def newcomer(self) -> Place:
        """Return the place of a client that knows nothing yet."""
        return Place(Known(notes=max(0, self.hub.notes_count - LOG_LINES_FOR_NEWCOMERS)))

    def take(self, place: Place) -> tuple[str, ...]:
        """Return the messages that bring `place` up to date, and move it there."""
        taken = self._shared(place)
        place.known = taken.after
        return taken.messages

    def take_frames(self, place: Place) -> bytes:
        """Return the same as WebSocket frames, one behind the other; empty when there is nothing.

        They are made once for all who know equally much.
        """
        taken = self._usual
        if taken is None or taken.before is not place.known:
            taken = self._shared(place)
            if taken.messages and not taken.frames:
                frames = b"".join(as_frame(text.encode(), is_text=True) for text in taken.messages)
                taken = self._taken[place.known] = taken._replace(frames=frames)
            self._usual = taken if self._is_flushing else None
        place.known = taken.after
        return taken.frames

    def _shared(self, place: Place) -> _Taken:
        if self._looked_at != self.hub.revision:
            self._look()
        taken, now_s = self._taken.get(place.known), self._clock.now()
        if taken is None or now_s - taken.time_s > SHARED_FOR_S:
            taken = self._taken[place.known] = self._make(place.known, now_s)
        return taken

    def _make(self, known: Known, now_s: float) -> _Taken:
        messages = []
        if known.links != self._links_number:
            messages.append(encode_links(self._links, now_s))
        values, revision = self._take_values(known.revision, now_s)
        if values:
            messages.append(values)
        if self.hub.notes_count > known.notes:
            messages.append(self._take_log(self.hub.notes_count - known.notes, now_s))
        if known.progress != self._progress_number:
            messages.append(encode_progress(self._progress))
        after = Known(revision, self._links_number, self._progress_number, self.hub.notes_count)
        return _Taken(known, after, tuple(messages), b"", now_s)

    def _look(self) -> None:
        """Number what is not a value anew, when it has changed; once for all clients."""
        self._looked_at = self.hub.revision
        self._taken.clear()
        links = tuple(self.hub.links.values())
        if links != self._links:
            self._links = links
            self._links_number += 1
        progress = tuple(self.hub.progress.values())
        if progress != self._progress:
            self._progress = progress
            self._progress_number += 1

    def _take_values(self, revision: int, now_s: float) -> tuple[str, int]:
        """Return the frame with what is newer, and the revision it leads to."""
        if revision >= self._head:
            return "", revision  # what came since the last flush waits for the next one
        frame = self._frames.get(revision)
        if frame is None or now_s - frame.time_s > SHARED_FOR_S:
            samples = self._plain(self.hub.changed_since(revision))
            text = encode_values(samples, self.hub.index, now_s) if samples else ""
            frame = self._frames[revision] = _Frame(text, self.hub.revision, now_s)
        return frame.text, frame.revision

    def _plain(self, samples: list[Sample]) -> list[Sample]:
        """Return the readings without the images, which only go to those who show them."""
        if not self._pictures:
            return samples
        return [
            sample
            for sample in samples
            if sample.signal not in self._pictures or sample.value is None
        ]

    def _take_log(self, wanted: int, now_s: float) -> str:
        kept = list(self.hub.notes)[-wanted:]
        return encode_log(kept, self.hub.notes_count - len(kept), now_s)
