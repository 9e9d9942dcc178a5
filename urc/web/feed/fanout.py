"""Fan-out of one robot's readings to all its pages, at most once per display frame.

Layer 5. No values are queued for a client. A flush wakes every client. As soon as a client's socket
is free, the client receives all values newer than its last frame. Each frame is encoded once for
all clients with the same position. A slow client receives the newest values in one frame, without
delaying other clients.
"""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from urc.model.values import NOTHING, Sample
from urc.motion.driving_lock import SentImages
from urc.runtime.clock import Clock, LoopClock, Timer
from urc.runtime.hub import Hub
from urc.web.feed.delivery_window import DeliveryWindow
from urc.web.feed.image_cache import ImageCache, ImageSubscription, is_picture
from urc.web.feed.video_feed import VideoFeed, VideoSubscription
from urc.web.feed.video_stills import VideoStills
from urc.web.wire.ask import encode_progress
from urc.web.wire.messages import (
    Indexes,
    encode_links,
    encode_log,
    encode_topics,
    encode_values,
)
from urc.web.wire.picture import NUMBERS, as_frame, message_of

__all__ = ["FRAMES_PER_SECOND", "Fanout", "FanoutPosition", "Pacer", "Place"]

FRAMES_PER_SECOND = 60.0
LOG_LINES_FOR_NEWCOMERS = 50
SHARED_FOR_S = 0.005
"""Maximum age at which an encoded frame is reused, in seconds. The ages in a frame are the ages at
the time of encoding."""


class FanoutPosition(NamedTuple):
    """One client's position in the robot's state."""

    revision: int = 0
    """Hub revision of the client's newest values."""
    links: int = 0
    """Number of link state changes up to the link states last sent to the client."""
    progress: int = 0
    """Number of sequence progress changes up to the states last sent to the client."""
    notes: int = 0
    """Number of log lines sent to the client or dropped."""
    joined: int = 0
    """Hub revision at which the client joined; 0 after the client has received its first values."""
    mismatches: int = 0
    """Number of changes of the topic mismatches up to the mismatches last sent to the client."""


@dataclass(slots=True)
class Place:
    """One client's position: the newest values and images that the client has received."""

    known: FanoutPosition = field(default_factory=FanoutPosition)
    subscription: ImageSubscription = field(default_factory=ImageSubscription)
    videos: VideoSubscription = field(default_factory=VideoSubscription)
    images: SentImages = field(default_factory=SentImages, compare=False)
    """The images that the client has received, for the driving lock."""
    shown: tuple[str, ...] = ()
    """Signals of both subscriptions."""
    viewed: tuple[str, ...] = ()
    """Streams that count this client as a viewer."""
    is_videos_turn: bool = True
    """Whether a video comes before an image, so that neither blocks the other."""


class _Update(NamedTuple):
    """The encoded update for all clients with the same `FanoutPosition`."""

    after: FanoutPosition
    frames: bytes
    """Consecutive WebSocket frames."""
    time_s: float


class Pacer:
    """A rate limiter that passes the first event of a burst immediately and later events steadily.

    The limiter tolerates jitter of one period, so it never delays a source that sends at exactly
    the permitted rate. In any second, the limiter passes at most one event more than permitted.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self.free_s = -self._period_s
        """Earliest time at which the next event passes."""

    def went(self, now_s: float) -> None:
        """Count one event."""
        due_s = self.free_s + self._period_s
        self.free_s = now_s if now_s > due_s else due_s


class Fanout:
    """Distributes the new values of an open session to all clients in shared flushes."""

    def __init__(
        self,
        hub: Hub,
        *,
        rate_hz: float = FRAMES_PER_SECOND,
        clock: Clock | None = None,
        each: Iterable[str] = (),
        movers: Iterable[str] = (),
    ) -> None:
        """Create the fan-out.

        Args:
            hub: the values of the session.
            rate_hz: largest rate of flushes, in hertz.
            clock: source of time; None for the clock of the running event loop.
            each: the signals for which every reading is sent.
            movers: the sequences with autonomous motion.
        """
        hub.streams.watch(each)
        self.hub = hub
        self._wakes: set[Callable[[], None]] = set()
        self._indexes = Indexes(hub.index)
        self._clock: Clock = clock or LoopClock()
        self._pacer = Pacer(rate_hz)
        self._head = 0
        """Hub revision at the last flush. Values with a higher revision wait for the next flush."""
        self._updates: dict[FanoutPosition, _Update] = {}
        self._encoded_at = -1
        """Hub revision for which `_updates` were encoded."""
        self._due: Timer | None = None
        """The next flush."""
        self._loop: asyncio.AbstractEventLoop | None = None
        """The event loop while `run` is active."""
        self._broken: asyncio.Future[None] | None = None
        self._movers = frozenset(movers)
        self.images_count = 0
        """Number of images and video frames sent to all clients so far."""
        self._pictures = {name for name, signal in hub.signals.items() if is_picture(signal)}
        self.cache = ImageCache(hub, self._clock)
        self.videos = VideoFeed(hub, self._clock)
        self.stills = VideoStills(hub, self.videos, self.cache, self._changed, self._clock)

    async def run(self) -> None:
        """Flush until cancelled; raise the exception of a failed flush."""
        self._loop = asyncio.get_running_loop()  # cached, because each call costs a system call
        self._broken = self._loop.create_future()
        try:
            with self.hub.passed_to(self.videos.take), self.hub.heed(self._changed):
                self.hub.on_low = self._take_low
                if self.hub.revision:
                    self._changed()
                await self._broken
        finally:
            if self._due is not None:
                self._due.cancel()
            self.hub.on_low = None
            await self.stills.close()

    def _take_low(self, name: str, value: bytes) -> None:
        self.videos.take_low(name, value)
        self._changed()

    def _changed(self) -> None:
        """Schedule a flush for a later iteration of the event loop, as soon as the rate permits."""
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
        except Exception as fault:  # raised in `run`, which the session awaits
            if self._broken is not None and not self._broken.done():
                self._broken.set_exception(fault)

    def flush(self) -> None:
        """Make the newest values available and wake every client."""
        self._head = self.hub.revision
        self._updates.clear()
        for wake in tuple(self._wakes):
            wake()

    def join(self, wake: Callable[[], None]) -> Place:
        """Return a new client's position; each flush calls `wake`, which must not block."""
        self._wakes.add(wake)
        notes = max(0, self.hub.notes_count - LOG_LINES_FOR_NEWCOMERS)
        return Place(FanoutPosition(notes=notes, joined=self.hub.revision))

    def show(self, place: Place, names: Iterable[str], stills: Iterable[str] = ()) -> None:
        """Set the images that a client shows, and count the client as their viewer.

        Args:
            place: the client's position.
            names: the images and videos that the client shows.
            stills: the videos among `names` that the client cannot decode.
        """
        shown = tuple(dict.fromkeys(names))
        is_video = self.videos.groups.keys() - set(stills)
        place.shown = shown
        for name in place.videos.names:
            if name in stills:
                place.images.forget(name)  # images and access units have different numbers
        for name in place.subscription.names:
            if name in is_video:
                place.images.forget(name)
        place.videos.show(name for name in shown if name in is_video)
        place.subscription.show(name for name in shown if name not in is_video)
        self._count_viewer(place)
        self.stills.show(place, self.videos.groups.keys() & place.subscription.names)

    def restart(self, place: Place, line: DeliveryWindow | None) -> None:
        """Send all shown images again, because the client has another socket for them.

        Args:
            place: the client's position.
            line: the window of the socket for images; None if the client has none.
        """
        place.videos.restart(line)
        place.subscription.seen.clear()
        self._count_viewer(place)

    def _count_viewer(self, place: Place) -> None:
        viewed = (*place.videos.streams(), *place.subscription.names)
        if viewed != place.viewed:
            before, place.viewed = place.viewed, viewed
            self.hub.viewers.add(viewed)
            self.hub.viewers.remove(before)

    def next_message(self, place: Place) -> memoryview | None:
        """Return the next image or access unit for the client as a message; None if none."""
        frame = self.next_picture(place)
        return None if frame is None else message_of(frame)

    def next_picture(self, place: Place) -> bytes | None:
        """Return the frame with the next image or access unit for the client; None if none."""
        first, second = self._next_unit, self._next_image
        if not place.is_videos_turn:
            first, second = second, first
        frame = first(place)
        if frame is None:
            frame = second(place)
        else:
            place.is_videos_turn = not place.is_videos_turn
        self.images_count += frame is not None
        return frame

    def _next_unit(self, place: Place) -> bytes | None:
        if not place.videos.names:
            return None
        frame = self.videos.next_frame(place.videos, place.images)
        if self.videos.lows:
            self._count_viewer(place)
        return frame

    def _next_image(self, place: Place) -> bytes | None:
        if not place.subscription.names:
            return None
        picture = self.cache.next_image(place.subscription)
        if picture is None:
            return None
        number, sample = picture.number % NUMBERS, picture.sample
        place.images.sent(sample.signal, number, sample.time_s, self._clock.now())
        return picture.frame

    def leave(self, wake: Callable[[], None], place: Place) -> None:
        """Stop calling `wake`; the client at `place` has left."""
        self._wakes.discard(wake)
        self.show(place, ())

    def frames_for(self, place: Place) -> bytes:
        """Return the frames that the client at `place` lacks, and advance `place`."""
        if self._encoded_at != self.hub.revision:
            self._encoded_at = self.hub.revision
            self._updates.clear()
        update, now_s = self._updates.get(place.known), self._clock.now()
        if update is None or now_s - update.time_s > SHARED_FOR_S:
            update = self._updates[place.known] = self._encode(place.known, now_s)
        place.known = update.after
        return update.frames

    def _encode(self, known: FanoutPosition, now_s: float) -> _Update:
        hub = self.hub
        messages: list[bytes] = []
        revision, links, progress, notes, joined, mismatches = known
        if links != hub.links_count:
            messages.append(encode_links(hub.links.values(), now_s).encode())
        if revision < self._head:
            samples = self._without_pictures(hub.readings_since(revision, joined=joined))
            revision, joined = hub.revision, 0
            if samples:
                messages.append(self._encode_values(samples, now_s))
        if hub.notes_count > notes:
            messages.append(self._take_log(hub.notes_count - notes, now_s).encode())
        if progress != hub.progress_count:
            sequences = tuple(hub.progress.values())
            goals = tuple(hub.goals)
            messages.append(encode_progress(sequences, self._moving(), goals, now_s).encode())
        if mismatches != hub.mismatches_count:
            messages.append(encode_topics(hub.topic_mismatches).encode())
        after = FanoutPosition(
            revision,
            hub.links_count,
            hub.progress_count,
            hub.notes_count,
            joined,
            hub.mismatches_count,
        )
        frames = b"".join([as_frame(message, is_text=True) for message in messages])
        return _Update(after, frames, now_s)

    def _moving(self) -> list[str]:
        """Return the commands and sequences that now move the robot, in order of their names."""
        running = {name for name, one in self.hub.progress.items() if one.state != "idle"}
        goals = {goal.command for goal in self.hub.goals}  # a lost goal may go on
        return sorted(goals | (running & self._movers))

    def _without_pictures(self, samples: Sequence[Sample]) -> Sequence[Sample]:
        """Remove images, which are sent separately; keep samples without a value."""
        pictures = self._pictures
        if not pictures:
            return samples
        return [one for one in samples if one.signal not in pictures or one.value is None]

    def _encode_values(self, samples: Sequence[Sample], now_s: float) -> bytes:
        streams = self.hub.streams
        firsts = streams.firsts([one.signal for one in samples]) if streams else NOTHING
        return encode_values(samples, self._indexes, now_s, firsts)

    def _take_log(self, wanted: int, now_s: float) -> str:
        kept = list(self.hub.notes)[-wanted:]
        return encode_log(kept, self.hub.notes_count - len(kept), now_s)
