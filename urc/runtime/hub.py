"""The latest value of every signal and the state of every link of one robot.

Floor 4. State is newest-wins: a reader that was away sees the newest reading, never a queue of old
ones. Notes (faults, state changes) are kept in a bounded list that says how many it dropped. The
hub is used from one event loop; it has no task and no timer of its own.

It is the one door between a robot and all who are shown something of it: pages, cards, recordings,
the command line. So the values of secret settings are taken out here, on the way in.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from urc.model.codec import Envelope
from urc.model.values import Reading, Sample, Signal
from urc.runtime.blanking import Blanker

if TYPE_CHECKING:
    from urc.runtime.audit import Entry
from typing import Final

__all__ = [
    "STREAM_KEPT",
    "Hub",
    "LinkState",
    "LinkStatus",
    "Moved",
    "Note",
    "Progress",
    "Subscription",
    "Tap",
    "Tapped",
    "Told",
    "Traffic",
]


STREAM_KEPT: Final = 500
"""Readings of each such signal."""


class Streams:
    """The latest readings of some signals, each with the hub's revision that brought it."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[tuple[int, Sample]]] = {}
        self._counts: dict[str, int] = {}
        """Readings that there ever were."""

    def __bool__(self) -> bool:
        return bool(self._kept)

    def keep(self, names: Iterable[str]) -> None:
        """Keep each reading of these signals from now on."""
        for name in names:
            self._kept.setdefault(name, deque(maxlen=STREAM_KEPT))
            self._counts.setdefault(name, 0)

    def put(self, samples: Iterable[Sample], revision: int) -> None:
        """Take what came with a revision."""
        for sample in samples:
            name = sample[0]
            kept = self._kept.get(name)
            if kept is not None:
                kept.append((revision, sample))
                self._counts[name] += 1

    def filled(self, newest: Iterable[Sample], since: int) -> Sequence[Sample]:
        """Return the newest readings, and those after a revision that they have hidden."""
        found: list[Sample] = []
        for sample in newest:
            rows: list[Sample] = []
            for revision, one in reversed(self._kept.get(sample[0], ())):
                if revision <= since:
                    break
                rows.append(one)
            found += reversed(rows or [sample])
        return found

    def firsts(self, names: Sequence[str]) -> dict[str, int]:
        """Return the number of the first reading of each signal, where the last is its newest."""
        counts = self._counts
        return {name: counts[name] - names.count(name) + 1 for name in counts if name in names}


LinkState = Literal["idle", "connecting", "live", "silent", "lost"]
"""idle: nobody asked yet. silent: connected, but something is overdue. lost: not connected."""

NOTES_KEPT = 500
TRAFFIC_KEPT = 1000
TAP_KEPT = 10_000


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """What is known of one transport."""

    transport: str
    state: LinkState
    address: str
    since_s: float
    """Monotonic time at which this state began."""
    detail: str = ""
    """Why, in one line, when the state is not good."""
    attempts: int = 0
    """Failed attempts since the last good frame."""
    faults: int = 0
    """Frames and replies that were not as declared, since the session began."""


@dataclass(frozen=True, slots=True)
class Note:
    """One line for the log: a fault or a change of state."""

    time_s: float
    level: Literal["info", "warning", "error"]
    source: str
    """Transport or command it is about."""
    text: str


@dataclass(frozen=True, slots=True)
class Traffic:
    """Bytes that went over a line; only recorded while somebody watches."""

    time_s: float
    transport: str
    direction: Literal["sent", "received"]
    data: bytes
    envelope: Envelope | None = None
    """The message that `data` shows, on a line that carries messages."""


class Subscription:
    """One reader's place: which revision it has seen, and a wake-up when there is more."""

    def __init__(self, hub: "Hub") -> None:
        self._hub = hub
        self._event = asyncio.Event()
        self.seen = 0
        """Revision up to which this reader has taken everything."""

    async def changed(self) -> None:
        """Return when the hub holds something newer than `seen`."""
        while self._hub.revision <= self.seen:
            self._event.clear()
            await self._event.wait()

    def wake(self) -> None:
        """Let `changed` look again."""
        self._event.set()

    def take(self) -> list[Sample]:
        """Return the newest sample of each signal changed since `seen`, and move `seen` up."""
        samples = [*self._hub.changed_since(self.seen)]
        self.seen = self._hub.revision
        return samples


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a sequence stands."""

    command: str
    place: int
    """Steps that were begun, without those inside of others."""
    of: int
    state: Literal["idle", "running", "paused"]
    reason: str = ""
    """Why it ended without success; "" when it did not."""


@dataclass(frozen=True, slots=True)
class Moved:
    """A tick of a held command that was taken; only told while somebody keeps all that happens."""

    time_s: float
    command: str
    arguments: Mapping[str, Reading]


@dataclass(frozen=True, slots=True)
class Told:
    """An entry of the audit."""

    time_s: float
    """Monotonic: the entry itself has the time of day, which somebody may set."""
    entry: "Entry"


Tapped: TypeAlias = Sample | Note | Traffic | LinkStatus | Moved | Told
"""What a tap gives."""


class Tap:
    """All that happens, in order, for a reader that must not miss a thing; it counts losses."""

    def __init__(self) -> None:
        self.dropped = 0
        """Lost because the reader was too slow, since the tap was opened."""
        self._kept: deque[Tapped] = deque()
        self._event = asyncio.Event()

    def put(self, items: Iterable[Tapped]) -> None:
        """Take what happened; the oldest go when there is more than `TAP_KEPT`."""
        for item in items:
            if len(self._kept) == TAP_KEPT:
                self._kept.popleft()
                self.dropped += 1
            self._kept.append(item)
        self._event.set()

    async def filled(self) -> None:
        """Return when there is something to take."""
        while not self._kept:
            self._event.clear()
            await self._event.wait()

    def take(self) -> list[Tapped]:
        """Return all there is, and keep none of it."""
        taken = list(self._kept)
        self._kept.clear()
        return taken


class Hub:
    """Latest values of one robot, with a revision that grows with every change."""

    def __init__(
        self,
        signals: Mapping[str, Signal],
        blanker: Blanker | None = None,
        streams: Iterable[str] = (),
    ) -> None:
        """Begin with nothing known.

        Args:
            signals: of the driver.
            blanker: takes secrets out of all that comes in; None: there are none.
            streams: lines on which a piece of traffic may go on in the next one.
        """
        self.signals = signals
        self._blanker = blanker if blanker is not None and blanker.is_needed else None
        self._stream_lines = frozenset(streams)
        self.names = tuple(signals)
        """Index → signal name; the order of the driver, fixed for the session."""
        self.index = {name: place for place, name in enumerate(self.names)}
        self.revision = 0
        self.links: dict[str, LinkStatus] = {}
        self.links_count = 0
        """How often one of them changed."""
        self.progress: dict[str, Progress] = {}
        """Sequence → where it stands; those that were never run are missing."""
        self.progress_count = 0
        """How often that changed."""
        self.notes: deque[Note] = deque(maxlen=NOTES_KEPT)
        self.notes_count = 0
        """Notes ever made; the deque holds the last of them."""
        self.traffic: deque[Traffic] = deque(maxlen=TRAFFIC_KEPT)
        self.traffic_count = 0
        self.traffic_watchers = 0
        """Traffic is recorded while this is above 0."""
        self.streams = Streams()
        """Of which each reading counts; of none, unless somebody says so."""
        self._latest: dict[str, Sample] = {}
        self._changed: dict[str, int] = {}
        self._wakers: set[Callable[[], None]] = set()
        self._taps: set[Tap] = set()
        self._traffic_taps: set[Tap] = set()

    def put(self, samples: Iterable[Sample]) -> None:
        """Take readings; a repeated value counts as a change, because its age is new."""
        taken = samples if type(samples) is tuple else tuple(samples)
        if self._blanker is not None:
            value = self._blanker.value
            taken = tuple(one._replace(value=value(one.value)) for one in taken)
        revision = self.revision = self.revision + 1
        for sample in taken:
            self._latest[sample.signal] = sample
            self._changed[sample.signal] = revision
        if self.streams:
            self.streams.put(taken, revision)
        for tap in self._taps:
            tap.put(taken)
        self._wake()

    def set_link(self, status: LinkStatus) -> None:
        """Take the state of one transport."""
        if self._blanker is not None:
            text = self._blanker.text
            status = replace(status, address=text(status.address), detail=text(status.detail))
        if self.links.get(status.transport) == status:
            return
        self.links[status.transport] = status
        self.links_count += 1
        self.revision += 1
        for tap in self._taps:
            tap.put((status,))
        self._wake()

    def set_progress(self, progress: Progress) -> None:
        """Take where a sequence stands."""
        if self._blanker is not None:
            progress = replace(progress, reason=self._blanker.text(progress.reason))
        if self.progress.get(progress.command) == progress:
            return
        self.progress[progress.command] = progress
        self.progress_count += 1
        self.revision += 1
        self._wake()

    @property
    def is_tapped(self) -> bool:
        """Whether somebody is given all that happens."""
        return bool(self._taps)

    def tell(self, done: Moved | Told) -> None:
        """Take what somebody did with the robot: only taps hear of it."""
        if self._blanker is not None and isinstance(done, Moved):
            done = replace(done, arguments=self._blanker.value(done.arguments))
        for tap in self._taps:
            tap.put((done,))

    def note(self, note: Note) -> None:
        """Take one line for the log."""
        if self._blanker is not None:
            note = replace(note, text=self._blanker.text(note.text))
        self.notes.append(note)
        self.notes_count += 1
        self.revision += 1
        for tap in self._taps:
            tap.put((note,))
        self._wake()

    def saw(self, traffic: Traffic) -> None:
        """Take bytes that went over a line; what may begin a secret waits for what follows it."""
        if self._blanker is not None:
            is_stream = traffic.envelope is None and traffic.transport in self._stream_lines
            if is_stream:
                data = self._blanker.stream((traffic.transport, traffic.direction), traffic.data)
                if not data and traffic.data:
                    return
            else:
                data = self._blanker.whole(traffic.data)
            envelope = traffic.envelope and self._blanker.envelope(traffic.envelope)
            traffic = replace(traffic, data=data, envelope=envelope)
        self._show(traffic)

    @property
    def holds_back(self) -> bool:
        """Whether some traffic waits for what follows it."""
        return self._blanker is not None and self._blanker.is_holding

    def tell_rest(self, now_s: float) -> None:
        """Show the traffic that waits: nothing has followed it."""
        if self._blanker is not None:
            for (transport, direction), data in self._blanker.rest():
                went: Literal["sent", "received"] = "sent" if direction == "sent" else "received"
                self._show(Traffic(now_s, transport, went, data))

    def _show(self, traffic: Traffic) -> None:
        self.traffic.append(traffic)
        self.traffic_count += 1
        self.revision += 1
        for tap in self._traffic_taps:
            tap.put((traffic,))
        self._wake()

    def latest(self, name: str) -> Sample | None:
        """Return the newest reading of a signal, or None when there was none."""
        return self._latest.get(name)

    def changed_since(self, revision: int) -> Sequence[Sample]:
        """Return the newest reading of every signal that changed after `revision`."""
        changed = self._changed
        return [sample for name, sample in self._latest.items() if changed[name] > revision]

    def readings_since(self, revision: int, *, joined: int = 0) -> Sequence[Sample]:
        """Return the same, and every reading of the signals in `streams`, the newest last.

        A reader gets no stream reading from before `joined`, the revision at which it began.
        """
        newest = self.changed_since(revision)
        return self.streams.filled(newest, max(revision, joined)) if self.streams else newest

    @contextmanager
    def subscribe(self) -> Iterator[Subscription]:
        """Give a reader its place for as long as the context lasts."""
        subscription = Subscription(self)
        with self.heed(subscription.wake):
            yield subscription

    @contextmanager
    def heed(self, wake: Callable[[], None]) -> Iterator[None]:
        """Call `wake` at each change for as long as the context lasts; it must return at once."""
        self._wakers.add(wake)
        try:
            yield
        finally:
            self._wakers.discard(wake)

    @contextmanager
    def tap(self, *, with_traffic: bool = False) -> Iterator[Tap]:
        """Give a reader every sample and note from now on, for as long as the context lasts.

        Args:
            with_traffic: the bytes on the lines as well, which are recorded from now on.
        """
        tap = Tap()
        self._taps.add(tap)
        if with_traffic:
            self._traffic_taps.add(tap)
            self.traffic_watchers += 1
        try:
            yield tap
        finally:
            self._taps.discard(tap)
            if with_traffic:
                self._traffic_taps.discard(tap)
                self.traffic_watchers -= 1

    def _wake(self) -> None:
        for wake in self._wakers:
            wake()
