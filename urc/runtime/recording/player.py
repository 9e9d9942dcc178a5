"""Plays a recording: its readings come to a hub as if the robot told them now.

Floor 4. `Player` knows where it stands and whether it runs, also while nobody looks on; `session`
is what a dashboard opens in place of a robot. What was decoded is played, not the bytes: an answer
is only understood beside the question it belongs to, and the questions of a new session would come
at other times than those that were recorded.
"""

import asyncio
import logging
import math
from collections import deque
from collections.abc import AsyncIterator, Callable, Generator, Iterable, Mapping, Set
from contextlib import asynccontextmanager, suppress
from itertools import islice
from typing import Final

from urc.model.codec import Payload
from urc.model.profile import Profile
from urc.model.values import Reading, Sample, Value
from urc.problems import UrcError
from urc.protocol.engine import Engine
from urc.protocol.events import Replied
from urc.protocol.reins import Pull
from urc.runtime.clock import Clock, LoopClock, within
from urc.runtime.held import Frames, Movers
from urc.runtime.hub import Hub, LinkStatus, Note, Traffic
from urc.runtime.recording.events import event_of, topic_of
from urc.runtime.recording.reader import Message, Recording
from urc.runtime.session import CommandFailed

__all__ = ["FASTEST", "Player", "REFUSAL"]

FASTEST: Final = 100.0
REFUSAL: Final = "this is a recording: nothing reaches a robot"
_REST_S: Final = 0.25
"""Between the end of one that is looped and its beginning."""
_AHEAD: Final = 256
"""Messages that are read at once."""

log = logging.getLogger(__name__)


class Player:
    """Where a recording stands. Used from one event loop."""

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
        """Stand at the beginning, ready to run.

        Args:
            recording: what is played.
            profile: as which it is shown.
            settings: any that the profile can be opened with; nothing is connected.
            speed: how many seconds of it pass in one.
            start_s: where it begins.
            is_looped: whether it begins anew at its end.
            clock: the time.
        """
        self.recording = recording
        self.profile = profile
        self.settings = settings
        self._is_looped = is_looped
        self._clock: Clock = clock or LoopClock()
        self._speed = min(speed, FASTEST)
        self._base_s = self._within(start_s)
        """Where it stood at `_since_s`."""
        self._since_s: float | None = None
        """When it began to run from there; None: it stands."""
        self._wishes_to_run = True
        self._is_open = False
        self._number = 0
        """Another one after every change of where it stands, or how it runs."""
        self._changed = asyncio.Event()

    @property
    def began_s(self) -> float:
        """When it was recorded, in seconds since 1970."""
        return self.recording.start_ns / 1e9

    @property
    def length_s(self) -> float:
        """How long it lasts."""
        return self.recording.length_s

    @property
    def position_s(self) -> float:
        """Where it stands, from 0 to `length_s`."""
        if self._since_s is None:
            return self._base_s
        return self._within(self._base_s + (self._clock.now() - self._since_s) * self._speed)

    @property
    def is_playing(self) -> bool:
        """Whether it runs, or will as soon as somebody looks on."""
        return self._wishes_to_run

    @property
    def speed(self) -> float:
        """How many seconds of it pass in one."""
        return self._speed

    def play(self) -> None:
        """Run; from the beginning, where it stands at its end."""
        at_end = self.position_s >= self.length_s
        self._wishes_to_run = True
        self._stand(0.0 if at_end else self.position_s, is_moved=at_end)

    def pause(self) -> None:
        """Stand where it is."""
        self._wishes_to_run = False
        self._stand(self.position_s)

    def seek(self, position_s: float) -> None:
        """Go on from somewhere else; what is beyond an end means that end."""
        self._stand(self._within(position_s), is_moved=True)

    def _within(self, position_s: float) -> float:
        return min(max(position_s, 0.0), self.length_s)

    def _stand(self, position_s: float, *, is_moved: bool = False) -> None:
        self._base_s = position_s
        is_running = self._wishes_to_run and self._is_open
        self._since_s = self._clock.now() if is_running else None
        self._number += is_moved
        self._changed.set()

    @asynccontextmanager
    async def session(self) -> AsyncIterator["Played"]:
        """Be what a dashboard opens; it goes on where the last one left it."""
        played = Played(self.profile, self.settings)
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
        """Play for as long as somebody looks on; what goes wrong is said, and it stands."""
        while True:
            try:
                await self._play_on(hub)
            except Exception as fault:  # a supervisor: a file may go, or be anything
                if not isinstance(fault, UrcError):
                    log.exception("%s cannot be played", self.recording.file)
                text = str(fault) if isinstance(fault, UrcError) else f"it broke: {fault!r}"
                hub.note(Note(self._clock.now(), "error", "recording", text))
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
            self._give(hub, before)
            self._forget(hub, {message.topic for message in before})
            stream = self.recording.messages(start_ns)
            try:
                await self._follow(hub, stream, number)
            finally:
                with suppress(ValueError):  # somebody left while it was read: it is closed then
                    await asyncio.to_thread(stream.close)
            if number == self._number:
                await self._at_end(number)

    async def _follow(self, hub: Hub, stream: Generator[Message, None, None], number: int) -> None:
        """Give what the stream has, each in its time, until its end or until it has moved."""
        waiting: deque[Message] = deque()
        while True:
            if not waiting:
                waiting.extend(await asyncio.to_thread(lambda: list(islice(stream, _AHEAD))))
            if not waiting or number != self._number:
                return
            due_ns = self._due_ns()
            due: list[Message] = []
            while waiting and waiting[0].time_ns <= due_ns:
                due.append(waiting.popleft())
            self._give(hub, due)
            if waiting:
                await self._until(waiting[0].time_ns, number)

    def _due_ns(self) -> float:
        """Return until when messages are due: at its end, all of them, whatever time they say."""
        position_s = self.position_s
        if position_s >= self.length_s:
            return math.inf
        return self.recording.start_ns + round(position_s * 1e9)

    async def _until(self, time_ns: int, number: int) -> None:
        """Wait until a message is due, or something has changed."""
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
        if self._is_looped and self._wishes_to_run and self.length_s > 0:
            await self._clock.sleep(_REST_S)
            if number == self._number:
                self.seek(0.0)
            return
        self._wishes_to_run = False
        self._stand(self.length_s)
        while number == self._number:
            self._changed.clear()
            await self._changed.wait()

    def _forget(self, hub: Hub, known: Set[str]) -> None:
        """Let nothing stand that had not been told yet where it stands now."""
        now_s = self._clock.now()
        later = [name for name in hub.signals if topic_of(name) not in known and hub.latest(name)]
        if later:
            hub.put(tuple(Sample(name, None, now_s) for name in later))

    def _give(self, hub: Hub, messages: Iterable[Message]) -> None:
        """Tell the hub, as if it happened so long ago as it did from where the recording stands."""
        now_s = self._clock.now()
        position_ns = self.recording.start_ns + round(self.position_s * 1e9)
        samples: list[Sample] = []
        for message in messages:
            age_s = max(0.0, (position_ns - message.time_ns) / 1e9) / self._speed
            event = event_of(message.topic, message.data, now_s - age_s, hub.signals)
            if isinstance(event, Sample):
                samples.append(event)
                continue
            if samples:  # the order is kept
                hub.put(tuple(samples))
                samples = []
            match event:
                case LinkStatus() if event.transport in self.profile.driver.transports:
                    hub.set_link(event)
                case Note():
                    hub.note(event)
                case Traffic() if hub.traffic_watchers:
                    hub.saw(event)
        if samples:
            hub.put(tuple(samples))


class Played:
    """What a dashboard has of a recording in place of a session; nothing can be commanded."""

    def __init__(self, profile: Profile, settings: Mapping[str, Value]) -> None:
        """Begin with nothing known."""
        self.hub = Hub(profile.driver.signals)
        self.frames: Frames = Engine(profile.driver, settings).motions
        self.movers: Movers | None = None

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading] | None = None,
        *,
        confirmed_by: tuple[str, ...] = (),
        on_sent: Callable[[Payload], None] | None = None,
    ) -> Replied:
        """Refuse it."""
        raise CommandFailed("not-allowed", REFUSAL)

    def pull(self, sequence: str, what: Pull) -> None:
        """Nothing is at work."""

    def latch(self, reason: str) -> None:
        """Nothing moves."""
