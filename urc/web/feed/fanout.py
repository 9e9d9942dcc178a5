"""One robot's readings to all who watch it: flushed at once, then at most once a display frame.

Floor 5. Nothing is queued for anybody. A flush writes the frame that all share to each client that
waits for nothing else, and wakes the others: each of them takes, when its own line is free,
everything newer than what it has already sent. A frame is encoded once however many watch; one that
fell behind gets the newest values merged into one frame, and is nobody else's problem.
"""

import asyncio
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

from urc.model.values import NOTHING
from urc.runtime.clock import Alarm, Clock, LoopClock
from urc.runtime.hub import Columns, Hub
from urc.web.feed.crowd import NO_NUMBER, Crowd, Known, Listener, Place, Write
from urc.web.feed.line import Flow
from urc.web.feed.picture_shelf import PictureShelf, is_picture
from urc.web.wire.ask import encode_progress
from urc.web.wire.messages import Indexes, encode_links, encode_log, encode_values
from urc.web.wire.picture import as_frame

__all__ = ["FRAMES_PER_SECOND", "Fanout", "Pacer"]

_known = partial(tuple.__new__, Known)
"""Of its five numbers, without a function of Python's."""
FRAMES_PER_SECOND = 60.0
LOG_LINES_FOR_NEWCOMERS = 50
SHARED_FOR_S = 0.005
"""How long an encoded frame may be handed out again: the ages in it are those of its encoding."""


@dataclass(slots=True)
class _Taken:
    """What everybody gets who knows equally much."""

    after: Known
    messages: list[bytes]
    frames: bytes
    """The same as WebSocket frames, one behind the other; empty when there is nothing."""
    time_s: float
    has_pictures: bool
    """Whether there is a new image as well, for those who show it."""
    texts: tuple[str, ...] | None = None
    """The messages once more; None until somebody wants them so."""


class Pacer:
    """Lets the first of a burst through at once, and then a steady rate.

    One period of tolerance: a source at just this rate, with jitter, is never held back, and no
    second sees more than one frame above the rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self.free_s = -self._period_s
        """When the next one may go."""

    def went(self, now_s: float) -> None:
        """Count one that went."""
        due_s = self.free_s + self._period_s
        self.free_s = now_s if now_s > due_s else due_s


class Fanout:
    """The shared flush of one open session."""

    def __init__(
        self,
        hub: Hub,
        *,
        rate_hz: float = FRAMES_PER_SECOND,
        clock: Clock | None = None,
        write: Write = os.write,
        each: Iterable[str] = (),
    ) -> None:
        """Begin with nobody; of signals in `each` every reading is told, of others the newest."""
        hub.streams.keep(each)
        self.hub = hub
        self._crowds: list[Crowd] = []
        """One for each set of images that somebody shows."""
        self._waiting: dict[Listener, None] = {}
        """Those in no crowd."""
        self._write = write
        self._indexes = Indexes(hub.index)
        self._clock: Clock = clock or LoopClock()
        self._pacer = Pacer(rate_hz)
        self._head = 0
        self._taken: dict[Known, _Taken] = {}
        self._due: Alarm | None = None
        """The flush that is to come."""
        self._loop: asyncio.AbstractEventLoop | None = None
        """While this runs."""
        self._broken: asyncio.Future[None] | None = None
        self._looked_at = -1
        self._pictures = {name for name, signal in hub.signals.items() if is_picture(signal)}
        self.shelf = PictureShelf(hub, self._clock)

    async def run(self) -> None:
        """Flush for ever; ends by being cancelled, or with what a flush raised."""
        self._loop = asyncio.get_running_loop()  # which costs a system call
        self._broken = self._loop.create_future()
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
        if self._due is not None or self._loop is None:
            return
        free_s = self._pacer.free_s
        if self._clock.now() >= free_s:
            self._due = self._loop.call_soon(self._ripe)
        else:
            self._due = self._clock.call_at(free_s, self._ripe)

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
        self._head = self._looked_at = self.hub.revision
        self._taken.clear()
        if len(self._crowds) == 1 and not self._waiting and self._tell(self._crowds[0]):
            return
        waiting = tuple(self._waiting)  # who falls out of a crowd has been given what is new
        for crowd in tuple(self._crowds):
            known = crowd.known
            taken = self._taken.get(known) or self._make(known, self._clock.now())
            crowd.known = taken.after
            if taken.frames:
                crowd.send(taken.frames)
            if taken.has_pictures:
                for picture in self.shelf.take_all(crowd.looks):
                    crowd.send(picture.frame)
        for listener in waiting:
            listener.wake()

    def _tell(self, crowd: Crowd) -> bool:
        """Write what is new to the only crowd if it came together, and return whether it did.

        It mostly does. This is `flush` in few steps: in a process that has rested for some
        milliseconds each function that is called costs microseconds more.
        """
        hub, known = self.hub, crowd.known
        if known.revision != hub.revision - 1:
            return False
        columns = hub.columns_since(known.revision)
        if columns is None:
            return False
        has_pictures = not self._pictures.isdisjoint(columns[0])
        plain = self._plain(columns) if has_pictures else columns
        crowd.known = _known((hub.revision, known.links, known.progress, known.notes, 0))
        if plain is not None:
            text = self._encoded(plain, self._clock.now())
            crowd.send(as_frame(text, is_text=True))
        if has_pictures:
            for picture in self.shelf.take_all(crowd.looks):
                crowd.send(picture.frame)
        return True

    def end(self) -> None:
        """Wake everybody: there is nothing more to come."""
        for crowd in tuple(self._crowds):
            for place in crowd.places:
                self.stir(place)
        self.flush()

    def join(self, listener: Listener) -> Place:
        """Let somebody know of each flush; return the place of one that knows nothing yet."""
        self._waiting[listener] = None
        notes = max(0, self.hub.notes_count - LOG_LINES_FOR_NEWCOMERS)
        known = Known(notes=notes, joined=self.hub.revision)
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
        crowd = same[0] if same else Crowd(place, self._write)
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
        taken = self._shared(place)
        if taken.texts is None:
            taken.texts = tuple(message.decode() for message in taken.messages)
        return taken.texts

    def take_frames(self, place: Place) -> bytes:
        """Return the same as WebSocket frames, one behind the other; empty when there is nothing.

        They are made once for all who know equally much.
        """
        return self._shared(place).frames

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

    def _shared(self, place: Place) -> _Taken:
        if self._looked_at != self.hub.revision:
            self._looked_at = self.hub.revision
            self._taken.clear()
        taken, now_s = self._taken.get(place.known), self._clock.now()
        if taken is None or now_s - taken.time_s > SHARED_FOR_S:
            taken = self._make(place.known, now_s)
        place.known = taken.after
        return taken

    def _make(self, known: Known, now_s: float) -> _Taken:
        hub = self.hub
        messages: list[bytes] = []
        revision, links, progress, notes, joined = known
        has_pictures = False
        if links != hub.links_count:
            messages.append(encode_links(hub.links.values(), now_s).encode())
        if revision < self._head:  # what came since the last flush waits for the next one
            columns = hub.columns_since(revision, joined=joined)
            revision, joined = hub.revision, 0
            if columns is not None and not self._pictures.isdisjoint(columns[0]):
                has_pictures, columns = True, self._plain(columns)
            if columns is not None:
                messages.append(self._encoded(columns, now_s))
        if hub.notes_count > notes:
            messages.append(self._take_log(hub.notes_count - notes, now_s).encode())
        if progress != hub.progress_count:
            messages.append(encode_progress(tuple(hub.progress.values())).encode())
        after = Known(revision, hub.links_count, hub.progress_count, hub.notes_count, joined)
        frames = b"".join([as_frame(message, is_text=True) for message in messages])
        taken = _Taken(after, messages, frames, now_s, has_pictures)
        self._taken[known] = taken
        return taken

    def _encoded(self, columns: Columns, now_s: float) -> bytes:
        streams = self.hub.streams
        firsts = streams.firsts(columns[0]) if streams else NOTHING
        return encode_values(columns, self._indexes, now_s, firsts)

    def _plain(self, columns: Columns) -> Columns | None:
        """Return readings without the images in them, which only go to those who show them."""
        pictures, values = self._pictures, columns[1]
        if len(values) == 1 and values[0] is not None:
            return None  # there is an image, and so nothing else
        rows = zip(*columns, strict=True)
        kept = [row for row in rows if row[0] not in pictures or row[1] is None]
        if not kept:
            return None
        names, values, times, alarms = zip(*kept, strict=True)
        return names, values, times, alarms

    def _take_log(self, wanted: int, now_s: float) -> str:
        kept = list(self.hub.notes)[-wanted:]
        return encode_log(kept, self.hub.notes_count - len(kept), now_s)
