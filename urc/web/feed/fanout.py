"""One robot's readings to all who watch it: flushed at once, then at most once a display frame.

Floor 5. Nothing is queued for anybody. A flush writes the frame that all share to each client that
waits for nothing else, and wakes the others: each of them takes, when its own line is free,
everything newer than what it has already sent. A frame is encoded once however many watch; one that
fell behind gets the newest values merged into one frame, and is nobody else's problem.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass

from urc.model.values import Sample
from urc.runtime.clock import Alarm, Clock, LoopClock
from urc.runtime.hub import Hub
from urc.web.feed.crowd import NO_NUMBER, Crowd, Kernel, Known, Listener, Place
from urc.web.feed.line import Flow
from urc.web.feed.picture_shelf import PictureShelf, is_picture
from urc.web.wire.ask import encode_progress
from urc.web.wire.messages import Indexes, encode_links, encode_log, encode_values
from urc.web.wire.picture import as_frame

__all__ = ["FRAMES_PER_SECOND", "Fanout", "Pacer"]

FRAMES_PER_SECOND = 60.0
LOG_LINES_FOR_NEWCOMERS = 50
SHARED_FOR_S = 0.005
"""How long an encoded frame may be handed out again: the ages in it are those of its encoding."""


@dataclass(slots=True)
class _Taken:
    """What everybody gets who knows equally much."""

    after: Known
    messages: tuple[str, ...]
    time_s: float
    frames: bytes = b""
    """The same as WebSocket frames, one behind the other; empty until somebody wants them."""


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
        kernel: Kernel = Kernel(),  # noqa: B008 - it cannot be changed
    ) -> None:
        self.hub = hub
        self._crowds: list[Crowd] = []
        """One for each set of images that somebody shows."""
        self._waiting: dict[Listener, None] = {}
        """Those in no crowd."""
        self._kernel = kernel
        self._indexes = Indexes(hub.index)
        self._clock: Clock = clock or LoopClock()
        self._pacer = Pacer(rate_hz)
        self._head = 0
        self._taken: dict[Known, _Taken] = {}
        self._due: Alarm | None = None
        """The flush that is to come."""
        self._broken: asyncio.Future[None] | None = None
        self._looked_at = -1
        self._pictures = {name for name, signal in hub.signals.items() if is_picture(signal)}
        self.shelf = PictureShelf(hub, self._clock)

    async def run(self) -> None:
        """Flush for ever; ends by being cancelled, or with what a flush raised."""
        self._broken = asyncio.get_running_loop().create_future()
        try:
            with self.hub.heed(self._changed):
                if self.hub.revision:
                    self._changed()
                await self._broken
        finally:
            if self._due is not None:
                self._due.cancel()

    def _changed(self) -> None:
        """Have a flush, as soon as may be, and after whatever the loop is at."""
        if self._due is not None:
            return
        now_s = self._clock.now()
        delay_s = self._pacer.delay_s(now_s)
        if delay_s > 0:
            self._due = self._clock.call_at(now_s + delay_s, self._ripe)
        else:
            self._due = asyncio.get_running_loop().call_soon(self._ripe)

    def _ripe(self) -> None:
        self._due = None
        self._pacer.went(self._clock.now())
        try:
            self.flush()
        except Exception as fault:  # the session's, which awaits `run`
            if self._broken is not None and not self._broken.done():
                self._broken.set_exception(fault)

    def flush(self) -> None:
        """Forget the last frame, and bring everybody up to date who is ready for it."""
        self._head = self.hub.revision
        self._taken.clear()
        waiting = tuple(self._waiting)  # who falls out of a crowd has been given what is new
        for crowd in tuple(self._crowds):
            taken = self._shared_frames(crowd.known)
            crowd.known = taken.after
            if taken.frames:
                crowd.send(taken.frames)
            while (picture := self.shelf.take(crowd.looks)) is not None:
                crowd.send_parts(picture.parts)
        for listener in waiting:
            listener.wake()

    def end(self) -> None:
        """Wake everybody: there is nothing more to come."""
        for crowd in tuple(self._crowds):
            for place in crowd.places:
                self.stir(place)
        self.flush()

    def join(self, listener: Listener) -> Place:
        """Let somebody know of each flush; return the place of one that knows nothing yet."""
        self._waiting[listener] = None
        known = Known(notes=max(0, self.hub.notes_count - LOG_LINES_FOR_NEWCOMERS))
        return Place(known, listener=listener)

    def leave(self, place: Place) -> None:
        """Forget somebody."""
        self.stir(place)
        if place.listener is not None:
            self._waiting.pop(place.listener, None)

    def settle(self, place: Place) -> None:
        """Write to somebody directly from now on, who is up to date and waits for nothing else.

        One that lacks what others do not is woken once more, and may settle then.
        """
        if place.number == NO_NUMBER or place.crowd is not None:
            return
        same = [crowd for crowd in self._crowds if crowd.looks.names == place.looks.names]
        if same and not same[0].fits(place):
            return
        crowd = same[0] if same else Crowd(place, self._kernel)
        if not same:
            self._crowds.append(crowd)
        crowd.add(place)
        if place.listener is not None:
            self._waiting.pop(place.listener, None)

    def stir(self, place: Place) -> None:
        """Wake somebody again at each flush, and write nothing to it."""
        crowd = place.crowd
        if crowd is None:
            return
        crowd.remove(place)
        if crowd.is_empty:
            self._crowds.remove(crowd)
        if place.listener is not None:
            self._waiting[place.listener] = None

    def take(self, place: Place) -> tuple[str, ...]:
        """Return the messages that bring `place` up to date, and move it there."""
        taken = self._shared(place.known)
        place.known = taken.after
        return taken.messages

    def take_frames(self, place: Place) -> bytes:
        """Return the same as WebSocket frames, one behind the other; empty when there is nothing.

        They are made once for all who know equally much.
        """
        taken = self._shared_frames(place.known)
        place.known = taken.after
        return taken.frames

    def catch_up(self, place: Place, flow: Flow) -> None:
        """Write what is new on a line that is free, and images for as long as it is."""
        frames = self.take_frames(place)
        if frames:
            flow.write(frames)
        while place.looks.names and flow.is_free():
            picture = self.shelf.take(place.looks)
            if picture is None:
                break
            flow.write(picture.frame)

    def _shared_frames(self, known: Known) -> _Taken:
        taken = self._shared(known)
        if taken.messages and not taken.frames:
            texts = [as_frame(text.encode(), is_text=True) for text in taken.messages]
            taken.frames = b"".join(texts)
        return taken

    def _shared(self, known: Known) -> _Taken:
        if self._looked_at != self.hub.revision:
            self._looked_at = self.hub.revision
            self._taken.clear()
        taken, now_s = self._taken.get(known), self._clock.now()
        if taken is None or now_s - taken.time_s > SHARED_FOR_S:
            taken = self._taken[known] = self._make(known, now_s)
        return taken

    def _make(self, known: Known, now_s: float) -> _Taken:
        hub, messages = self.hub, []
        revision = known.revision
        if known.links != hub.links_count:
            messages.append(encode_links(hub.links.values(), now_s))
        if revision < self._head:  # what came since the last flush waits for the next one
            samples = self._plain(hub.changed_since(revision))
            revision = hub.revision
            if samples:
                messages.append(encode_values(samples, self._indexes, now_s))
        if hub.notes_count > known.notes:
            messages.append(self._take_log(hub.notes_count - known.notes, now_s))
        if known.progress != hub.progress_count:
            messages.append(encode_progress(tuple(hub.progress.values())))
        after = Known(revision, hub.links_count, hub.progress_count, hub.notes_count)
        return _Taken(after, tuple(messages), now_s)

    def _plain(self, samples: Sequence[Sample]) -> Sequence[Sample]:
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
