"""Play a recording: pass its readings to a hub as if the robot were sending them now.

Layer 4. `Player` keeps its position and state while no page is open. A dashboard opens the player's
`session` instead of a robot. The player plays decoded values, not bytes. Decoding a reply requires
the matching request, but a new session would send its requests at different times.
"""

import asyncio
import logging
import math
from collections import deque
from collections.abc import (
    AsyncIterator,
    Callable,
    Collection,
    Generator,
    Iterable,
    Iterator,
    Mapping,
    Set,
)
from contextlib import asynccontextmanager, suppress
from itertools import islice
from typing import Final

from urc.guard.goal_reports import GoalReports
from urc.model.payload import Payload
from urc.model.profile import Profile
from urc.model.values import Reading, Sample, Signal, Value
from urc.problems import UrcError
from urc.protocol.engine import Engine
from urc.protocol.events import MotionEvent, Replied
from urc.protocol.sequences.sequence_control import Pull
from urc.runtime.clock import Clock, LoopClock, within
from urc.runtime.held_commands import MotionBackend, MotionFrames
from urc.runtime.hub import Hub, LinkStatus, LogEntry, Traffic
from urc.runtime.recording.events import event_of, is_loss, topic_of
from urc.runtime.recording.reader import RecordedMessage, Recording
from urc.runtime.recording.videos import RecordedVideos
from urc.runtime.session import CommandFailed

__all__ = ["FASTEST", "Player", "REFUSAL"]

FASTEST: Final = 100.0
REFUSAL: Final = "this is a recording: commands are not sent to a robot"
_REST_S: Final = 0.25
"""Pause before a repeated recording starts again, in seconds."""
_AHEAD, _AHEAD_BYTES = 256, 4_194_304
"""Number of messages, and their bytes, at which a reading of the file ends."""

log = logging.getLogger(__name__)


class Player:
    """The position and state of a playback. Call all methods on the same event loop."""

    def __init__(
        self,
        recording: Recording,
        profile: Profile,
        settings: Mapping[str, Value],
        *,
        speed: float = 1.0,
        start_s: float = 0.0,
        is_looped: bool = False,
        clock: Clock | None = None,
    ) -> None:
        """Prepare the playback, which is paused at its start position.

        Args:
            recording: the recording to play.
            profile: profile that pages use to display the recording.
            settings: valid settings of the profile, although playback does not open a connection.
            speed: playback speed; 1.0 is real time.
            start_s: start position, in seconds.
            is_looped: whether to restart the playback at the end.
            clock: source of time.
        """
        self.recording = recording
        self.profile = profile
        self.settings = settings
        self._is_looped = is_looped
        self._clock: Clock = clock or LoopClock()
        self._speed = min(speed, FASTEST)
        self._base_s = self._within(start_s)
        """Position in the recording at the monotonic time `_since_s`, in seconds."""
        self._since_s: float | None = None
        """Monotonic time of the last start, in seconds; None while paused."""
        self._wants_to_run = True
        self._is_open = False
        self._number = 0
        """Number of jumps to another position so far."""
        self._changed = asyncio.Event()
        self._videos = RecordedVideos()

    @property
    def began_s(self) -> float:
        """Start time of the recording, as UTC time in seconds since 1970."""
        return self.recording.start_ns / 1e9

    @property
    def length_s(self) -> float:
        """Length of the recording, in seconds."""
        return self.recording.length_s

    @property
    def position_s(self) -> float:
        """Playback position in seconds, from 0 to `length_s`."""
        if self._since_s is None:
            return self._base_s
        return self._within(self._base_s + (self._clock.now() - self._since_s) * self._speed)

    @property
    def is_playing(self) -> bool:
        """Whether the playback runs, or will run once a page is open."""
        return self._wants_to_run

    @property
    def speed(self) -> float:
        """Playback speed; 1.0 is real time."""
        return self._speed

    def play(self) -> None:
        """Start the playback; if it is at the end, start from the beginning."""
        at_end = self.position_s >= self.length_s
        self._wants_to_run = True
        self._stand(0.0 if at_end else self.position_s, is_moved=at_end)

    def pause(self) -> None:
        """Pause the playback at its current position."""
        self._wants_to_run = False
        self._stand(self.position_s)

    def seek(self, position_s: float) -> None:
        """Move to a position in seconds; outside the recording, move to its start or end."""
        self._stand(self._within(position_s), is_moved=True)

    def _within(self, position_s: float) -> float:
        return min(max(position_s, 0.0), self.length_s)

    def _stand(self, position_s: float, *, is_moved: bool = False) -> None:
        self._base_s = position_s
        is_running = self._wants_to_run and self._is_open
        self._since_s = self._clock.now() if is_running else None
        self._number += is_moved
        self._changed.set()

    @asynccontextmanager
    async def session(self) -> AsyncIterator["PlaybackSession"]:
        """Open a session for a dashboard; playback continues from the last position."""
        played = PlaybackSession(self.profile, self.settings)
        playing = asyncio.create_task(self._play(played.hub))
        self._is_open = True
        self._stand(self._base_s)
        try:
            yield played
        finally:
            self._is_open = False
            self._stand(self.position_s)
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)

    # -- the task

    async def _play(self, hub: Hub) -> None:
        """Play while a page is open; on an error, report it and pause."""
        while True:
            try:
                await self._play_on(hub)
            except Exception as fault:  # supervisor: files can vanish or have any content
                if not isinstance(fault, UrcError):
                    log.exception("%s cannot be played", self.recording.file)
                text = str(fault) if isinstance(fault, UrcError) else f"unexpected error: {fault!r}"
                hub.log(LogEntry(self._clock.now(), "error", "recording", text))
                self.pause()
                number = self._number
                while number == self._number:
                    self._changed.clear()
                    await self._changed.wait()

    async def _play_on(self, hub: Hub) -> None:
        while True:
            number = self._number
            for name in self.profile.driver.transports:
                hub.set_link(LinkStatus(name, "connecting", "", self._clock.now()))
            start_ns = self.recording.start_ns + round(self._base_s * 1e9)
            before = await asyncio.to_thread(self.recording.before, start_ns)
            self._videos = RecordedVideos()
            self._publish(hub, before)
            self._forget(hub, {message.topic for message in before})
            stream = self.recording.messages(start_ns)
            try:
                await self._follow(hub, stream, number)
            finally:
                with suppress(ValueError):  # its thread is still running; it closes later
                    await asyncio.to_thread(stream.close)
            if number == self._number:
                await self._at_end(number)

    async def _follow(
        self, hub: Hub, stream: Generator[RecordedMessage, None, None], number: int
    ) -> None:
        """Send each message of the stream when it is due, until the end or a change of position."""
        waiting: deque[RecordedMessage] = deque()
        while True:
            if not waiting:
                waiting.extend(await asyncio.to_thread(_ahead, stream))
            if not waiting or number != self._number:
                return
            due_ns = self._due_ns()
            due: list[RecordedMessage] = []
            while waiting and waiting[0].time_ns <= due_ns:
                due.append(waiting.popleft())
            self._publish(hub, due)
            if waiting:
                await self._until(waiting[0].time_ns, number)

    def _due_ns(self) -> float:
        """Return the recorded time, in ns, up to which messages are due; infinity at the end."""
        position_s = self.position_s
        if position_s >= self.length_s:
            return math.inf
        return self.recording.start_ns + round(position_s * 1e9)

    async def _until(self, time_ns: int, number: int) -> None:
        """Wait until a message is due or the state changes."""
        self._changed.clear()
        if number != self._number:
            return
        left_s = (time_ns - self.recording.start_ns) / 1e9 - self.position_s
        if self._since_s is None:
            await self._changed.wait()
        elif left_s > 0:
            with suppress(TimeoutError):
                async with within(self._clock, left_s / self._speed):
                    await self._changed.wait()

    async def _at_end(self, number: int) -> None:
        if self._is_looped and self._wants_to_run and self.length_s > 0:
            await self._clock.sleep(_REST_S)
            if number == self._number:
                self.seek(0.0)
            return
        self._wants_to_run = False
        self._stand(self.length_s)
        while number == self._number:
            self._changed.clear()
            await self._changed.wait()

    def _forget(self, hub: Hub, known: Set[str]) -> None:
        """Clear the values of all signals that have no reading before the current position."""
        now_s = self._clock.now()
        later = [name for name in hub.signals if topic_of(name) not in known and hub.latest(name)]
        if later:
            hub.publish(tuple(Sample(name, None, now_s) for name in later))

    def _publish(self, hub: Hub, messages: Iterable[RecordedMessage]) -> None:
        """Send messages to the hub, with times shifted to the present."""
        now_s = self._clock.now()
        position_ns = self.recording.start_ns + round(self.position_s * 1e9)
        samples: list[Sample] = []
        for message in messages:
            age_s = max(0.0, (position_ns - message.time_ns) / 1e9) / self._speed
            at_s, signals = now_s - age_s, hub.signals
            event = event_of(message.topic, message.data, at_s, signals, self._videos)
            if isinstance(event, Sample):
                samples.append(event)
                continue
            if samples:  # keep the order
                hub.publish(tuple(samples))
                samples = []
            match event:
                case LinkStatus() if event.transport in self.profile.driver.transports:
                    hub.set_link(event)
                case LogEntry():
                    if is_loss(event):
                        self._videos.lose()
                    hub.log(event)
                case Traffic() if hub.traffic_watchers:
                    hub.saw(event)
        if samples:
            hub.publish(tuple(samples))


def _ahead(stream: Iterator[RecordedMessage]) -> list[RecordedMessage]:
    """Return the next messages of a stream; the bytes exceed the limit by one message at most."""
    found: list[RecordedMessage] = []
    size = 0
    for message in islice(stream, _AHEAD):
        found.append(message)
        size += len(message.data)
        if size >= _AHEAD_BYTES:
            break
    return found


def _uncompared(signal: Signal) -> Signal:
    """Return a signal whose video is not compared, because a jump shows its images again."""
    return signal._replace(frozen_after_s=0.0) if signal.type == "video" else signal


class PlaybackSession:
    """A session that plays a recording; the session refuses every command."""

    def __init__(self, profile: Profile, settings: Mapping[str, Value]) -> None:
        """Create a session without values."""
        self.hub = Hub({name: _uncompared(one) for name, one in profile.driver.signals.items()})
        self.frames: MotionFrames = Engine(profile.driver, settings).motions
        self.backend: MotionBackend | None = None
        self.on_motion: Callable[[MotionEvent], None] | None = None

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading] | None = None,
        *,
        confirmed_by: tuple[str, ...] = (),
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
        on_goal: Callable[[str, bool], None] | None = None,
    ) -> Replied:
        """Refuse the command."""
        raise CommandFailed("not-allowed", REFUSAL)

    def reconnect(self) -> None:
        """Do nothing, because a recording has no connections."""

    def pull(self, sequence: str, what: Pull) -> None:
        """Do nothing, because a recording does not run sequences."""

    @property
    def goals(self) -> GoalReports:
        """Return no reports, because a recording cancels nothing."""
        return GoalReports(())

    def latch(self, reason: str) -> None:
        """Do nothing, because a recording does not move a robot."""

    def end_cancellations(self, actions: Collection[str]) -> None:
        """Do nothing, because a recording cancels nothing."""
