"""A line to a robot that is kept alive: one transport, and its part of the driver's engine.

Theory of operation. `run` is a loop of three waits: until the line is wanted (always, when it is
persistent; when the engine says `Open`, when it is made for each request), until the back-off
allows an attempt, and until the connection ends. While it is open a reader and a writer work side
by side; whatever ends it (the robot, the engine, a rule below) goes through `_end`, and the two are
taken down in one place.

A connection is good from the first good frame on, and only that resets the back-off: a robot that
accepts and closes again is not hammered. Lines shown to people follow `LinkState`; while attempts
fail the state stays what it is and the count rises.

The link uses the five members of a transport and nothing else, and does not care in which process
it lives.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any

from urc.model.driver import TransportSpec
from urc.protocol.events import Fault
from urc.runtime.clock import Alarm, Clock, within
from urc.runtime.dispatcher import Dispatcher
from urc.runtime.hub import Hub, LinkState
from urc.runtime.report import REDACTED, LinkReport
from urc.transports.base import Transport, TransportError

__all__ = ["Link"]

MAX_QUEUED_BYTES = 262_144
"""Bytes that may wait to be written; with more the line is given up, and says so."""
SLICE_BYTES = 1024
"""Bytes that are handed to the engine before others have their turn on the loop."""
_CHUNK_COST = 32
"""What a chunk costs beside its bytes, in bytes: tiny chunks must not hold the loop either."""
STUCK_S = 5.0
"""A robot that takes no byte for this long is gone."""
SETTLE_S = 1.0
"""A connection that stands this long without being closed has been accepted."""
_GRACE_S = 1.0
"""What a transport may take beyond the time it promised."""
_NOTHING_YET = "connected; nothing received yet"

log = logging.getLogger(__name__)


class Link:
    """Keeps one transport connected and moves bytes between it and the engine."""

    def __init__(
        self,
        spec: TransportSpec,
        transport: Transport,
        dispatcher: Dispatcher,
        hub: Hub,
        *,
        clock: Clock,
        random: Callable[[], float],
        expects_frames: bool,
    ) -> None:
        """Prepare the line; `run` does the work.

        Args:
            spec: as the driver declares it.
            transport: made for `spec`, not open.
            dispatcher: owns the engine.
            hub: takes states, notes and traffic.
            clock: the time.
            random: returns a number from 0 to below 1, for the jitter.
            expects_frames: whether the robot talks here without a command: then the line is live
                with the first frame, else with the connection.
        """
        self._spec = spec
        self._transport = transport
        self._dispatcher = dispatcher
        self._hub = hub
        self._clock = clock
        self._random = random
        self._expects_frames = expects_frames
        self._is_persistent = spec.connection == "persistent"

        self._wanted = asyncio.Event()
        if self._is_persistent:
            self._wanted.set()
        self._retry_s = clock.now()
        """Before this time no attempt is made."""

        # Of the present connection.
        self._ended: asyncio.Future[str] | None = None
        """None while not connected; its result says why the connection ended."""
        self._close_reason: str | None = None
        """Set when the engine has closed the line: what arrives now is nobody's."""
        self._outgoing: list[tuple[bytes, bytes]] = []
        """What is written, and what the traffic shows of it."""
        self._queued_bytes = 0
        self._has_output = asyncio.Event()
        self._heard_s = 0.0

        self._is_overdue = False
        """The robot took a request and has not said anything since."""
        self.tried = asyncio.Event()
        """Set once the first attempt has ended, well or not; at once when the engine decides."""
        if not self._is_persistent:
            self.tried.set()
        self._report = LinkReport(spec.name, transport.address, hub, clock)

    @property
    def is_full(self) -> bool:
        """Whether so much waits to be written that no new command should be taken."""
        return self._queued_bytes > MAX_QUEUED_BYTES // 2

    def want_open(self) -> None:
        """Connect, as soon as the back-off allows it."""
        self._wanted.set()

    def want_close(self, reason: str) -> None:
        """Write what is queued and close; at once when there is a reason."""
        if not self._is_persistent:
            self._wanted.clear()
        if self._ended is None:
            return
        # Noted even when the connection has ended already: the engine has forgotten it by now,
        # and must not be told of its end.
        self._close_reason = reason
        if reason:
            self._end(reason)
        else:
            self._has_output.set()

    @property
    def is_connected(self) -> bool:
        """Whether the transport is open."""
        return self._ended is not None

    def queue(self, data: bytes, *, is_secret: bool = False) -> None:
        """Write `data` with the next turn of the loop; secret bytes are shown to nobody."""
        if self._ended is None or self._ended.done() or self._close_reason is not None:
            return
        if self._queued_bytes + len(data) > MAX_QUEUED_BYTES:
            dropped = self._queued_bytes + len(data)
            self._end(f"the robot takes no more bytes; {dropped} waiting ones were dropped")
            return
        self._outgoing.append((data, REDACTED if is_secret else data))
        self._queued_bytes += len(data)
        self._has_output.set()

    def heard(self) -> None:
        """A good frame arrived: whatever was wrong is over."""
        self._report.attempts = 0
        self._is_overdue = False
        self._report.show("live")

    def count(self, fault: Fault) -> None:
        """Count something that was not as declared, and tell of it now and then."""
        self._report.count(fault)
        if fault.code == "reply-timeout":
            self._is_overdue = True
            self._report.show("silent", fault.message)

    def hang_up(self, reason: str) -> None:
        """Give the connection up; the engine is told from this link's own task."""
        self._end(reason)

    def publish(self) -> None:
        """Put the state into the hub, if anything about it has changed."""
        self._report.publish()

    async def run(self) -> None:
        """Keep the line, until cancelled. Leaves nothing open behind."""
        try:
            while True:
                await self._wanted.wait()
                await self._clock.sleep(max(0.0, self._retry_s - self._clock.now()))
                if self._wanted.is_set():
                    await self._connection()
                self.publish()
        finally:
            self._ended = None
            self.tried.set()
            await self._close()

    async def _connection(self) -> None:
        """Make one attempt and, when it succeeds, serve the connection to its end."""
        if self._report.state == "idle":
            self._report.show("connecting")
            self.publish()
        fault = await self._open()
        if fault:
            self._lose("lost", fault)
            self._tell_closed(fault)
            self.tried.set()
        elif self._wanted.is_set():
            await self._serve()
        else:  # the engine has thought better of it meanwhile
            await self._close()

    async def _open(self) -> str:
        """Open the transport; return why it failed, or "" when it did not."""
        limit_s = self._spec.timeouts.connect_s
        try:
            async with within(self._clock, limit_s + _GRACE_S):
                await self._transport.open(limit_s)
        except TransportError as refused:
            return str(refused)
        except TimeoutError:
            await self._close()
            return f"no answer from {self._transport.address} within {limit_s:g} s"
        except Exception as bug:  # supervisor: a foreign transport may raise what it likes
            return self._mistake(bug)
        return ""

    async def _serve(self) -> None:
        """Serve the open connection until it ends, and draw the conclusions."""
        self._ended = asyncio.get_running_loop().create_future()
        self._close_reason = None
        self._outgoing.clear()
        self._queued_bytes = 0
        self._has_output.clear()
        self._heard_s = self._clock.now()
        self._greet()
        self._dispatcher.start(self._spec.name)
        self.tried.set()
        self.publish()
        alarms = self._set_alarms()
        try:
            async with asyncio.TaskGroup() as lanes:
                tasks = [lanes.create_task(self._lane(work)) for work in (self._read, self._write)]
                reason = await self._ended
                for task in tasks:
                    task.cancel()
        finally:
            self._ended = None
            for alarm in alarms:
                alarm.cancel()
            await self._close()
        self._conclude(reason)

    def _greet(self) -> None:
        """Show what a connection without any frame means."""
        if self._report.attempts or self._report.state == "silent":
            return  # it has to prove itself first, see `_settled`
        if self._is_persistent and not self._expects_frames:
            self._report.show("live")
        elif self._report.state != "live":
            self._report.show("connecting", _NOTHING_YET)

    def _conclude(self, reason: str) -> None:
        """Take note of how a connection ended."""
        asked = self._close_reason
        is_flushed = not self._queued_bytes
        self._outgoing.clear()
        self._queued_bytes = 0
        if asked is None:
            self._lose("lost", reason)
            self._tell_closed(reason)
        elif asked == "" and is_flushed and not self._is_persistent:
            self._report.attempts = 0
            self._report.show("live")
        else:
            # A robot that takes connections but says nothing is silent, however often it is called.
            state: LinkState = "silent" if self._is_overdue else "lost"
            self._lose(state, asked or reason or "the line was closed")
            if not self._is_persistent:
                # The engine's own pace (polls, time-outs) is slow enough for the robot.
                self._retry_s = self._clock.now() + self._spec.backoff.initial_s

    def _lose(self, state: LinkState, reason: str) -> None:
        """Count a failed attempt, and set the time of the next one."""
        self._is_overdue = state == "silent"
        self._report.fail(state, reason)
        backoff = self._spec.backoff
        # The exponent is bounded: after a night of attempts 2 ** attempts is no float any more.
        doublings = min(self._report.attempts - 1, 30)
        wait_s = min(backoff.max_s, backoff.initial_s * 2**doublings)
        self._retry_s = self._clock.now() + wait_s * (1 - backoff.jitter * self._random())

    def _tell_closed(self, reason: str) -> None:
        if not self._is_persistent:
            self._wanted.clear()  # before the engine is told: it may want the line again at once
        self._dispatcher.closed(self._spec.name, reason)
        self.publish()

    async def _close(self) -> None:
        try:
            async with within(self._clock, _GRACE_S):
                await self._transport.close()
        except TimeoutError:
            log.error("%s did not close in time", self._transport.address)
        except Exception as bug:  # supervisor, as in `_open`
            self._mistake(bug)

    async def _lane(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        try:
            await work()
        except TransportError as fault:
            self._end(str(fault))
        except Exception as bug:  # supervisor, as in `_open`
            self._end(self._mistake(bug))

    async def _read(self) -> None:
        spent = 0
        while True:
            data = await self._transport.receive()
            for start in range(0, len(data), SLICE_BYTES):
                part = data[start : start + SLICE_BYTES]
                self._take(part)
                spent += len(part) + _CHUNK_COST
                if spent >= SLICE_BYTES:
                    spent = 0
                    await asyncio.sleep(0)

    def _take(self, data: bytes) -> None:
        if self._ended is None or self._ended.done() or self._close_reason is not None:
            return  # of a connection that is over for the engine
        self._heard_s = self._clock.now()
        self._report.saw("received", data)
        self._dispatcher.receive(self._spec.name, data)

    async def _write(self) -> None:
        while True:
            await self._has_output.wait()
            self._has_output.clear()
            if self._outgoing:
                data, shown = map(b"".join, zip(*self._outgoing, strict=True))
                self._outgoing.clear()
                with self._watched():
                    await self._transport.send(data)
                self._queued_bytes -= len(data)
                self._report.saw("sent", shown)
            if self._close_reason is not None and not self._outgoing:
                self._end("")

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Give the robot `STUCK_S` to take what is being written."""
        reason = f"the robot has taken no bytes for {STUCK_S:g} s"
        alarm = self._clock.call_at(self._clock.now() + STUCK_S, lambda: self._end(reason))
        try:
            yield
        finally:
            alarm.cancel()

    def _end(self, reason: str) -> None:
        if self._ended is not None and not self._ended.done():
            self._ended.set_result(reason)

    def _set_alarms(self) -> list["_Repeating"]:
        alarms = [_Repeating(self._clock, SETTLE_S, self._settled)]
        if self._spec.timeouts.idle_s is not None:
            alarms.append(_Repeating(self._clock, self._spec.timeouts.idle_s, self._check_idle))
        return alarms

    def _settled(self) -> float | None:
        """The connection stands: a robot that closes at once would have done so by now."""
        if self._report.state == "lost":
            if self._expects_frames or not self._is_persistent:
                self._report.show("connecting", _NOTHING_YET)
            else:
                self._report.attempts = 0
                self._report.show("live")
            self.publish()
        return None

    def _check_idle(self) -> float | None:
        """Close a line that has been silent for too long, else say how long it still may be."""
        limit_s = self._spec.timeouts.idle_s or 0.0
        left_s = self._heard_s + limit_s - self._clock.now()
        if left_s > 0:
            return left_s
        self._end(f"nothing received for {limit_s:g} s; connecting anew")
        return None

    def _mistake(self, bug: Exception) -> str:
        """Log what no transport should raise, and return the line for people."""
        log.error("%s failed in an unexpected way", self._transport.address, exc_info=bug)
        return f"the transport failed in an unexpected way ({type(bug).__name__}: {bug})"


class _Repeating:
    """An alarm whose action returns the seconds to the next call, or None for the last one."""

    def __init__(self, clock: Clock, delay_s: float, action: Callable[[], float | None]) -> None:
        self._clock = clock
        self._action = action
        self._alarm: Alarm = clock.call_at(clock.now() + delay_s, self._ring)

    def cancel(self) -> None:
        self._alarm.cancel()

    def _ring(self) -> None:
        delay_s = self._action()
        if delay_s is not None:
            self._alarm = self._clock.call_at(self._clock.now() + delay_s, self._ring)
