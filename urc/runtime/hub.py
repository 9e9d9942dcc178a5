"""The latest values of one robot's signals, and the states of its links.

Layer 4. Readers always see the newest reading; a slow reader never receives a queue of old
readings. Log entries (faults and state changes) are kept in a bounded list, with a count of the
dropped entries. The hub is used on one event loop and has no tasks or timers.

Pages, cards, recordings and the command line all read their values from the hub. The hub therefore
redacts secret settings in all incoming data.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from urc.model.payload import Envelope
from urc.model.values import Reading, Sample, Signal
from urc.runtime.image_viewers import ImageViewers
from urc.runtime.redaction import Redactor
from urc.runtime.repeated_images import RepeatedImages
from urc.runtime.running_goals import RunningGoal, RunningGoals
from urc.runtime.topic_check import TopicMismatch
from urc.transports.ros.topic_list import TopicList, TopicRow

if TYPE_CHECKING:
    from urc.runtime.audit_entry import AuditEntry

__all__ = [
    "STREAM_KEPT",
    "TRANSPORT",
    "Hub",
    "LinkState",
    "LinkStatus",
    "MotionRecord",
    "LogEntry",
    "SequenceProgress",
    "HubSubscription",
    "EventTap",
    "Tapped",
    "AuditRecord",
    "Traffic",
]


STREAM_KEPT: Final = 500
"""Maximum number of readings that are stored for each streamed signal."""


class SampleHistory:
    """The newest readings of selected signals, each with the hub revision in which it arrived."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[tuple[int, Sample]]] = {}
        self._counts: dict[str, int] = {}
        """Number of readings stored so far, including readings dropped since, keyed by signal."""

    def __bool__(self) -> bool:
        return bool(self._kept)

    def watch(self, names: Iterable[str]) -> None:
        """Store every reading of the given signals from now on."""
        for name in names:
            self._kept.setdefault(name, deque(maxlen=STREAM_KEPT))
            self._counts.setdefault(name, 0)

    def append(self, samples: Iterable[Sample], revision: int) -> None:
        """Store the samples of one hub revision."""
        for sample in samples:
            name = sample[0]
            kept = self._kept.get(name)
            if kept is not None:
                kept.append((revision, sample))
                self._counts[name] += 1

    def filled(self, newest: Iterable[Sample], since: int) -> Sequence[Sample]:
        """Return the newest readings, and all streamed readings after the revision `since`."""
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
        """Return the number of each signal's first new reading, keyed by signal.

        `names` contains one signal name for each new reading.
        """
        counts = self._counts
        return {name: counts[name] - names.count(name) + 1 for name in counts if name in names}


LinkState = Literal["idle", "connecting", "live", "silent", "lost"]
"""In the state ``idle``, no connection has been requested yet. In the state ``silent``, the link is
connected, but data is overdue. In the state ``lost``, the link is not connected."""

NOTES_KEPT = 500
TRAFFIC_KEPT = 1000
TAP_KEPT = 10_000


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """The published state of one transport."""

    transport: str
    state: LinkState
    address: str
    since_s: float
    """Monotonic time at which the current state began, in seconds."""
    detail: str = ""
    """Reason for the state, in one line; "" in a normal state."""
    attempts: int = 0
    """Number of failed attempts since the last valid frame."""
    faults: int = 0
    """Number of protocol violations since the session began."""
    is_ready: bool = False
    """Whether the connection is open and its login is complete, even if no data has arrived yet."""

    @property
    def is_opening(self) -> bool:
        """Whether the first attempt to connect and log in is under way.

        Many robots send nothing until they are asked, so a link that awaits only the first data
        counts as open.
        """
        return self.state == "connecting" and not self.attempts and not self.is_ready


TRANSPORT: Final = "transport "
"""Start of the source of a transport's log entries: a bare name, such as “wire”, would look like a
word of the message."""


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A log entry about a fault or a change of state."""

    time_s: float
    level: Literal["info", "warning", "error"]
    source: str
    """Cause of the entry, such as ``transport wire``, ``engine`` or ``URC``."""
    text: str

    @property
    def place(self) -> str:
        """Cause of the entry, of a transport its name only."""
        return self.source.removeprefix(TRANSPORT)


@dataclass(frozen=True, slots=True)
class Traffic:
    """Traffic of a connection, recorded only while the hub has traffic readers."""

    time_s: float
    transport: str
    direction: Literal["sent", "received"]
    data: bytes
    envelope: Envelope | None = None
    """Message to which the bytes belong, on a transport that carries messages."""


class HubSubscription:
    """A reader's position: the last revision that it has seen, and an event for newer revisions."""

    def __init__(self, hub: "Hub") -> None:
        self._hub = hub
        self._event = asyncio.Event()
        self.seen = 0
        """Revision of the last change that this reader has received."""

    async def changed(self) -> None:
        """Wait until the hub has a revision newer than `seen`."""
        while self._hub.revision <= self.seen:
            self._event.clear()
            await self._event.wait()

    def wake(self) -> None:
        """Make a waiting `changed` call check the hub's revision."""
        self._event.set()

    def changes(self) -> list[Sample]:
        """Return the newest sample of each signal that changed since `seen`; update `seen`."""
        samples = [*self._hub.changed_since(self.seen)]
        self.seen = self._hub.revision
        return samples


@dataclass(frozen=True, slots=True)
class SequenceProgress:
    """Progress of a sequence that is running or has ended."""

    command: str
    place: int
    """Number of outermost steps that have started."""
    of: int
    state: Literal["idle", "running", "paused"]
    reason: str = ""
    """Reason for the failure of the sequence, or ""."""


@dataclass(frozen=True, slots=True)
class MotionRecord:
    """An accepted tick of a held command, reported only while a tap is open."""

    time_s: float
    command: str
    arguments: Mapping[str, Reading]


@dataclass(frozen=True, slots=True)
class AuditRecord:
    """An audit log entry, as reported to taps."""

    time_s: float
    """Monotonic time of the entry, in seconds, unaffected by changes to the system clock."""
    entry: "AuditEntry"


Tapped: TypeAlias = Sample | LogEntry | Traffic | LinkStatus | MotionRecord | AuditRecord
"""One event in a tap, such as a sample or a log entry."""


class EventTap:
    """A complete and ordered stream of events for one reader, with a count of lost events."""

    def __init__(self) -> None:
        self.dropped = 0
        """Number of events lost since the tap was opened, because the reader was too slow."""
        self._kept: deque[Tapped] = deque()
        self._event = asyncio.Event()

    def push(self, items: Iterable[Tapped]) -> None:
        """Add events; if the tap exceeds `TAP_KEPT`, drop the oldest events."""
        for item in items:
            if len(self._kept) == TAP_KEPT:
                self._kept.popleft()
                self.dropped += 1
            self._kept.append(item)
        self._event.set()

    async def filled(self) -> None:
        """Wait until events are available."""
        while not self._kept:
            self._event.clear()
            await self._event.wait()

    def drain(self) -> list[Tapped]:
        """Return all events and empty the tap."""
        taken = list(self._kept)
        self._kept.clear()
        return taken


class Hub:
    """Latest values of one robot, with a revision number that grows with every change."""

    def __init__(
        self,
        signals: Mapping[str, Signal],
        redactor: Redactor | None = None,
        streams: Iterable[str] = (),
    ) -> None:
        """Create a hub without values.

        Args:
            signals: the driver's signals.
            redactor: filter that removes secrets from all incoming data; None for a robot without
                secrets.
            streams: names of the transports that may split one message into several pieces.
        """
        self.signals = signals
        self._redactor = redactor if redactor is not None and redactor.is_needed else None
        self._stream_lines = frozenset(streams)
        self.names = tuple(signals)
        """Signal names in the order of the driver, fixed for the session."""
        self.index = {name: place for place, name in enumerate(self.names)}
        self.revision = 0
        self.links: dict[str, LinkStatus] = {}
        self.links_count = 0
        """Number of link state changes so far."""
        self.progress: dict[str, SequenceProgress] = {}
        """Progress of each sequence, by name; sequences that have never run are missing."""
        self.progress_count = 0
        """Number of changes of `progress` and `goals` so far."""
        self.goals = RunningGoals()
        """Commands with autonomous motion that have not ended."""
        self.topic_lists: dict[str, TopicList] = {}
        """Newest list of the robot's topics, keyed by transport; empty without a connection."""
        self.topic_mismatches: tuple[TopicMismatch, ...] = ()
        """Differences between the driver's topics and the robot's."""
        self.mismatches_count = 0
        """Number of changes of `topic_mismatches` so far."""
        self.notes: deque[LogEntry] = deque(maxlen=NOTES_KEPT)
        self.notes_count = 0
        """Total number of log entries, including dropped entries."""
        self.traffic: deque[Traffic] = deque(maxlen=TRAFFIC_KEPT)
        self.traffic_watchers = 0
        """Number of traffic readers; traffic is recorded only if this number is above 0."""
        self.viewers = ImageViewers()
        """Number of viewers of each image; a tap counts as a viewer of all images."""
        self.repeated = RepeatedImages(signals)
        """Images that a camera repeats; empty unless a signal declares ``frozen_after``."""
        self.streams = SampleHistory()
        """Recent readings of the signals that keep every reading; empty by default."""
        self.low_streams: Mapping[str, Collection[str]] = {}
        """Signals of each camera with a second stream for slow lines, keyed by transport."""
        self.on_low: Callable[[str, bytes], None] | None = None
        """Function that receives the signal and each access unit of a low stream. Only pages need
        these units; readings, recordings and programs have those of the other stream."""
        self._latest: dict[str, Sample] = {}
        self._changed: dict[str, int] = {}
        self._wakers: set[Callable[[], None]] = set()
        self._sinks: list[Callable[[Sequence[Sample]], None]] = []
        self._taps: set[EventTap] = set()
        self._traffic_taps: set[EventTap] = set()

    def take_low(self, transport: str, value: object) -> None:
        """Pass on an access unit of the low stream of a camera, for all its signals."""
        if self.on_low is not None and isinstance(value, bytes):
            for name in self.low_streams.get(transport, ()):
                self.on_low(name, value)

    def publish(self, samples: Iterable[Sample]) -> None:
        """Store readings; a repeated value counts as a change, because its time is new."""
        taken = samples if type(samples) is tuple else tuple(samples)
        if self._redactor is not None:
            value = self._redactor.value
            taken = tuple(one._replace(value=value(one.value)) for one in taken)
        if self.repeated:
            taken, notes = self.repeated.aged(taken)
            for name, text in notes:
                self.log(LogEntry(taken[-1].time_s, "warning", name, text))
        revision = self.revision = self.revision + 1
        for sample in taken:
            self._latest[sample.signal] = sample
            self._changed[sample.signal] = revision
        if self.streams:
            self.streams.append(taken, revision)
        for sink in self._sinks:
            sink(taken)
        for tap in self._taps:
            tap.push(taken)
        self._wake()

    def set_link(self, status: LinkStatus) -> None:
        """Store the state of one transport."""
        if self._redactor is not None:
            text = self._redactor.text
            status = replace(status, address=text(status.address), detail=text(status.detail))
        if self.links.get(status.transport) == status:
            return
        self.links[status.transport] = status
        self.links_count += 1
        self.revision += 1
        for tap in self._taps:
            tap.push((status,))
        self._wake()

    def set_progress(self, progress: SequenceProgress) -> None:
        """Store the progress of a sequence."""
        if self._redactor is not None:
            progress = replace(progress, reason=self._redactor.text(progress.reason))
        if self.progress.get(progress.command) == progress:
            return
        self.progress[progress.command] = progress
        self.progress_count += 1
        self.revision += 1
        self._wake()

    def begin_goal(self, goal: RunningGoal) -> int:
        """Show a command with autonomous motion on all pages; return the goal's number."""
        number = self.goals.begin(goal)
        self._goals_changed()
        return number

    def share_goals(self, goals: RunningGoals) -> None:
        """Use the goals of the robot's earlier sessions, which outlive this session."""
        self.goals = goals
        if any(goals):
            self._goals_changed()

    def sent_goal(self, number: int, action: str, *, is_over: bool = False) -> None:
        """Note the ROS action to which a goal was sent, or that its goal has ended (`is_over`)."""
        change = self.goals.over if is_over else self.goals.sent
        change(number, action)
        self._goals_changed()

    def end_goal(self, number: int, *, is_lost: bool = False) -> None:
        """End a goal whose reply has arrived, or cannot arrive any more (`is_lost`)."""
        self.goals.end(number, is_lost=is_lost)
        self._goals_changed()

    def dismiss_goal(self, number: int) -> None:
        """Drop a lost goal that a person knows to have ended; ignore other goals."""
        if self.goals.dismiss(number):
            self._goals_changed()

    def settle_goals(self, action: str | None = None) -> None:
        """Drop lost goals: a cancellation of their action, or STOP (None), has ended them."""
        if self.goals.settle(action):
            self._goals_changed()

    def _goals_changed(self) -> None:
        self.progress_count += 1
        self.revision += 1
        self._wake()

    def set_topics(self, transport: str, listed: TopicList | None) -> None:
        """Store the topics that a robot has reported; None after the end of the connection."""
        if listed is None:
            self.topic_lists.pop(transport, None)
        elif self._redactor is None:
            self.topic_lists[transport] = listed
        else:
            value = self._redactor.value
            names = tuple(TopicRow._make((*value(row[:5]), row[5])) for row in listed.rows)
            self.topic_lists[transport] = listed._replace(rows=names)

    def set_mismatches(self, mismatches: Sequence[TopicMismatch]) -> None:
        """Store the differences between the driver's topics and the robot's."""
        if self.topic_mismatches != tuple(mismatches):
            self.topic_mismatches = tuple(mismatches)
            self.mismatches_count += 1
            self.revision += 1
            self._wake()

    @property
    def is_tapped(self) -> bool:
        """Whether a tap is open."""
        return bool(self._taps)

    def publish_record(self, done: MotionRecord | AuditRecord) -> None:
        """Report an accepted tick or an audit log entry to the open taps."""
        if self._redactor is not None and isinstance(done, MotionRecord):
            done = replace(done, arguments=self._redactor.value(done.arguments))
        for tap in self._taps:
            tap.push((done,))

    def log(self, note: LogEntry) -> None:
        """Add a log entry."""
        if self._redactor is not None:
            note = replace(note, text=self._redactor.text(note.text))
        self.notes.append(note)
        self.notes_count += 1
        self.revision += 1
        for tap in self._taps:
            tap.push((note,))
        self._wake()

    def saw(self, traffic: Traffic) -> None:
        """Add traffic, but hold back the possible beginning of a secret until more bytes arrive."""
        if self._redactor is not None:
            is_stream = traffic.envelope is None and traffic.transport in self._stream_lines
            if is_stream:
                data = self._redactor.stream((traffic.transport, traffic.direction), traffic.data)
                if not data and traffic.data:
                    return
            else:
                data = self._redactor.whole(traffic.data)
            envelope = traffic.envelope and self._redactor.envelope(traffic.envelope)
            traffic = replace(traffic, data=data, envelope=envelope)
        self._show(traffic)

    @property
    def holds_back(self) -> bool:
        """Whether some traffic is held back because it may be the beginning of a secret."""
        return self._redactor is not None and self._redactor.is_holding

    def tell_rest(self, now_s: float) -> None:
        """Publish held-back traffic after a pause without further bytes."""
        if self._redactor is not None:
            for (transport, direction), data in self._redactor.rest():
                went: Literal["sent", "received"] = "sent" if direction == "sent" else "received"
                self._show(Traffic(now_s, transport, went, data))

    def _show(self, traffic: Traffic) -> None:
        self.traffic.append(traffic)
        self.revision += 1
        for tap in self._traffic_taps:
            tap.push((traffic,))
        self._wake()

    def latest(self, name: str) -> Sample | None:
        """Return the newest reading of a signal, or None if it has no reading."""
        return self._latest.get(name)

    def changed_since(self, revision: int) -> Sequence[Sample]:
        """Return the newest reading of every signal that changed after `revision`."""
        changed = self._changed
        return [sample for name, sample in self._latest.items() if changed[name] > revision]

    def readings_since(self, revision: int, *, joined: int = 0) -> Sequence[Sample]:
        """Return the newest readings and every streamed reading after `revision`, oldest first.

        `joined` is the reader's first revision; streamed readings before it are omitted.
        """
        newest = self.changed_since(revision)
        return self.streams.filled(newest, max(revision, joined)) if self.streams else newest

    @contextmanager
    def subscribe(self) -> Iterator[HubSubscription]:
        """Subscribe a reader for the duration of the context."""
        subscription = HubSubscription(self)
        with self.heed(subscription.wake):
            yield subscription

    @contextmanager
    def heed(self, wake: Callable[[], None]) -> Iterator[None]:
        """Call `wake` at each change while the context is open; `wake` must return immediately."""
        self._wakers.add(wake)
        try:
            yield
        finally:
            self._wakers.discard(wake)

    @contextmanager
    def passed_to(self, sink: Callable[[Sequence[Sample]], None]) -> Iterator[None]:
        """Call `sink` with all samples of each frame while the context is open.

        `sink` must return immediately and not raise an exception.
        """
        self._sinks.append(sink)
        try:
            yield
        finally:
            self._sinks.remove(sink)

    @contextmanager
    def tap(self, *, with_traffic: bool = False) -> Iterator[EventTap]:
        """Open a tap on all events of the hub for the duration of the context.

        Args:
            with_traffic: whether to record and include the traffic of all connections.
        """
        tap = EventTap()
        self._taps.add(tap)
        if with_traffic:
            self._traffic_taps.add(tap)
            self.traffic_watchers += 1
        try:
            with self.viewers.viewing():
                yield tap
        finally:
            self._taps.discard(tap)
            if with_traffic:
                self._traffic_taps.discard(tap)
                self.traffic_watchers -= 1

    def _wake(self) -> None:
        for wake in self._wakers:
            wake()
