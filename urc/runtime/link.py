"""The link to a robot: one transport that exchanges data with the driver's engine.

Theory of operation. `run` is a loop with three waits. First, the loop waits until there is a reason
to connect. A persistent link always has a reason; other links need an `Open` event or a request.
Then the loop waits for the backoff delay, and finally for the end of the connection. A reader and a
writer run while the connection is open. The robot, the engine or a rule of the link can end a
connection. Every connection ends through `_end`, and only `_serve` stops the reader and the writer.

Only a good connection resets the backoff. A connection is good after its first valid frame. If the
robot sends frames only on request, the connection is good after `SETTLE_S` seconds. URC therefore
does not flood a robot that accepts every connection and then closes it. If there are ``on_connect``
steps, frames do not count until the steps are done, because a robot may refuse the login after a
greeting. Pages show the `LinkStatus`. While attempts fail, only the number of attempts in the
status changes.

The link uses only the five members of `Transport`, so a transport may run in another process. A
transport that implements `Prompt` avoids task switches. Bytes that arrive while the reader waits
are passed directly to the engine. The bytes that the engine sends are passed directly to the
kernel. The reader and writer tasks handle bytes that must wait, large amounts of data, and errors.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Iterable
from typing import Any

from urc.model.driver import TransportSpec
from urc.model.payload import RESTARTED, Envelope, Payload
from urc.protocol.events import Noted, Send, Violation
from urc.runtime.clock import Clock, PeriodicTimer, within
from urc.runtime.dispatcher import Dispatcher
from urc.runtime.hub import Hub, LinkState
from urc.runtime.link_report import LinkReport
from urc.runtime.output_buffer import STUCK_S, OutputBuffer
from urc.transports.arrival_check import ArrivalCheck
from urc.transports.base import (
    LOW_STREAM,
    NOTICE,
    TOPICS,
    Prompt,
    SupportsReady,
    SupportsSettle,
    Transport,
    TransportError,
)
from urc.transports.ros.topic_list import list_of, request_for

__all__ = ["Link"]

SLICE_BYTES = 4096
"""Maximum number of bytes that the engine processes before the loop's other tasks run."""
SLICE_S = 0.001
"""Maximum time for which the engine may process bytes before other tasks run, in seconds; a slower
engine receives fewer bytes."""
_LEAST_SLICE_BYTES = 512
_SLICE_PIECES = 16
"""Maximum number of datagrams or messages that the engine processes before other tasks run."""
_CHUNK_COST = 32
"""Fixed cost of a received chunk, counted as bytes, because many tiny chunks would also block the
loop."""
HURRY_S = 1.0
"""Minimum interval between two attempts that operators request, in seconds. Repeated requests,
even from many pages, therefore do not flood a robot that refuses connections."""
SETTLE_S = 1.0
"""Time after which an open connection counts as accepted by the robot, in seconds."""
_GRACE_S = 1.0
"""Extra time for a transport that exceeds its own time limit, in seconds."""
_LOOK_S = 0.01
_LOGGING_IN = "connected; the on_connect steps are not complete yet"
_NOTHING_YET = "connected; nothing received yet"

log = logging.getLogger(__name__)


class Link:
    """A transport that is reopened after every loss and exchanges data with the engine."""

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
        """Prepare the link; `run` operates the connection.

        Args:
            spec: the transport's declaration in the driver.
            transport: the transport described by `spec`, still closed.
            dispatcher: the owner of the engine.
            hub: destination of states, log entries and traffic.
            clock: source of time.
            random: function that returns a number in [0, 1) for the jitter of the backoff.
            expects_frames: whether the robot sends frames without a request. A link that expects
                frames becomes live with the first frame; other links become live when the
                connection opens.
        """
        self._spec = spec
        self._name = spec.name
        self._transport = transport
        self._arrivals = ArrivalCheck(transport)
        self._dispatcher = dispatcher
        self._hub = hub
        self._clock = clock
        self._random = random
        self._expects_frames = expects_frames
        self._is_persistent = spec.connection == "persistent"
        self._is_stream = (spec.framing.sent or spec.framing).type != "datagram"
        """Whether sent bytes may be joined and split; if false, each piece is a datagram or a
        message.
        """
        self._wanted = asyncio.Event()
        if self._is_persistent:
            self._wanted.set()
        self._retry_s = clock.now()
        """Monotonic time of the next attempt."""
        self._hurried = asyncio.Event()
        """Event that is set to end the current backoff delay early."""
        self._hurried_s = float("-inf")
        """Time of the last request for an immediate attempt."""
        self._ended: asyncio.Future[str] | None = None
        """Future that receives the reason for the connection's end; None without a connection."""
        self._forget_connection()
        self._is_overdue = False
        """Whether a reply or other data from the robot is overdue."""
        self.tried = asyncio.Event()
        """Event that is set after the first attempt; set at once if the engine opens the link."""
        if not self._is_persistent:
            self.tried.set()
        self._report = LinkReport(spec.name, transport.address, hub, clock)
        self._outgoing = OutputBuffer(
            transport, self._report, hub, clock, self._end, is_stream=self._is_stream
        )

    def _forget_connection(self) -> None:
        """Reset the attributes that describe a single connection."""
        self._close_reason: str | None = None
        """The engine's reason for closing the connection; data received after the close is
        dropped."""
        self._arrivals.begin()
        self._heard_s = self._clock.now()
        self._has_news = False
        """Whether the robot has sent data that the engine does not know of."""
        self._is_reader_waiting = False
        self._is_ready = not self._spec.on_connect
        """Whether the connection's steps are done; true for a transport without steps."""
        self._has_heard = False
        """Whether a valid frame arrived before the steps were done."""
        self._has_stood = False
        """Whether the connection has been open for at least `SETTLE_S` seconds."""

    @property
    def is_full(self) -> bool:
        """Whether the output queue is too long for new commands."""
        return self._outgoing.is_full

    def want_open(self) -> None:
        """Connect as soon as the backoff delay ends."""
        self._wanted.set()

    def reconnect(self) -> None:
        """Reopen a lost connection without the backoff, at most once every `HURRY_S` seconds."""
        now = self._clock.now()
        if self.is_connected or now - self._hurried_s < HURRY_S:
            return
        self._hurried_s = now
        self._retry_s = min(self._retry_s, now)
        self._hurried.set()

    def ask_topics(self, names: Iterable[str], *, is_all: bool) -> None:
        """Request the topics of a ROS robot; `Hub.topic_lists` receives the answer.

        Without a connection, or while URC publishes, there is no answer.
        """
        ended = self._ended
        if ended is not None and self._close_reason is None and not ended.done():
            self._outgoing.write(request_for(names, is_all=is_all))

    def want_close(self, reason: str) -> None:
        """Close the connection after all output, or immediately if there is a `reason`."""
        if not self._is_persistent:
            self._wanted.clear()
        if self._ended is None:
            return
        # Recorded even after the end of the connection, because the engine has already removed the
        # connection and must not be told that it ended.
        self._close_reason = reason
        if reason:
            self._end(reason)
        else:
            self._outgoing.wake()

    @property
    def is_connected(self) -> bool:
        """Whether the transport is open."""
        return self._ended is not None

    def send(self, sent: Send) -> None:
        """Write bytes from the engine; secret bytes are hidden from the traffic view."""
        ended = self._ended
        if ended is not None and self._close_reason is None and not ended.done():
            self._outgoing.write(sent.data, is_secret=sent.is_secret, counted=sent.counted)

    def frame_received(self) -> None:
        """Handle a valid frame: clear all failures, unless connection steps are still running."""
        self._has_heard = True
        if not self._is_ready:
            return
        if self._report.is_well and not self._is_overdue:
            return
        self._report.attempts = 0
        self._is_overdue = False
        self._report.show("live")
        self._report.publish()

    def ready(self) -> None:
        """Handle the end of the connection's steps; earlier valid frames count from now on."""
        self._is_ready = True
        if self._has_heard:
            self.frame_received()
        elif self._has_stood:
            self._stand()
        else:
            self._greet()

    def note(self, entry: Noted) -> None:
        """Log a message that the driver declares as a log entry, at a limited rate."""
        self._report.note(entry)

    def count(self, fault: Violation) -> None:
        """Count a protocol violation; log violations at a limited rate."""
        self._report.count(fault)
        if fault.code in ("reply-timeout", "no-data"):
            self._is_overdue = True
            self._report.show("silent", fault.message)

    def hang_up(self, reason: str) -> None:
        """Close the connection; the link's own task later reports the end to the engine."""
        self._end(reason)

    def publish(self) -> None:
        """Publish the link state if the state has changed."""
        self._report.publish()

    async def settle(self) -> str:
        """Wait until all sent bytes are written and, if arrival can be detected, have arrived.

        Returns:
            A message about undelivered bytes, or "". The wait lasts a few seconds at most.
        """
        until = self._clock.now() + STUCK_S
        while self.is_connected and not self._outgoing.is_written:
            if self._clock.now() >= until:
                return f"{self._transport.address} accepts no data"
            await self._clock.sleep(_LOOK_S)
        if self.is_connected and isinstance(self._transport, SupportsSettle):
            try:
                return await self._transport.settle()
            except TransportError as broken:
                return str(broken)
        return ""

    async def run(self) -> None:
        """Keep the link connected until the task is cancelled, then close the transport."""
        try:
            while True:
                await self._wanted.wait()
                await self._back_off()
                if self._wanted.is_set():
                    await self._connection()
                self.publish()
        finally:
            self._ended = None
            self.tried.set()
            await self._close()

    async def _back_off(self) -> None:
        """Wait until the next attempt to connect is due; `reconnect` ends the wait early."""
        await asyncio.sleep(0)
        while self._retry_s > self._clock.now():
            self._hurried.clear()
            alarm = self._clock.call_at(self._retry_s, self._hurried.set)
            try:
                await self._hurried.wait()
            finally:
                alarm.cancel()

    async def _connection(self) -> None:
        """Make one connection attempt; on success, serve the connection until it ends."""
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
        else:  # the engine no longer needs the connection
            await self._close()

    async def _open(self) -> str:
        """Open the transport; return the reason for a failure, or "" on success."""
        limit_s = self._spec.timeouts.connect_s
        try:
            if isinstance(self._transport, SupportsReady):
                await self._transport.ready()
            async with within(self._clock, limit_s + _GRACE_S):
                await self._transport.open(limit_s)
        except TransportError as refused:
            return str(refused)
        except TimeoutError:
            await self._close()
            return f"no answer from {self._transport.address} within {limit_s:g} s"
        except Exception as bug:  # supervisor: a third-party transport may raise anything
            return self._mistake(bug)
        return ""

    async def _serve(self) -> None:
        """Serve the open connection until it ends, then set the state."""
        self._ended = asyncio.get_running_loop().create_future()
        self._forget_connection()
        transport, prompt = self._transport, None
        if self._is_stream and isinstance(transport, Prompt):
            prompt = transport
            prompt.divert(self._take_now)
        self._outgoing.reset(prompt)
        self._greet()
        self._dispatcher.start(self._spec.name)
        self.tried.set()
        self.publish()
        alarms = self._set_alarms()
        try:
            async with asyncio.TaskGroup() as queues:
                tasks = [
                    queues.create_task(self._queue(work)) for work in (self._read, self._write)
                ]
                reason = await self._ended
                for task in tasks:
                    task.cancel()
        finally:
            self._ended = None
            self._hub.set_topics(self._name, None)
            for alarm in alarms:
                alarm.cancel()
            await self._close()
        self._conclude(reason)

    def _greet(self) -> None:
        """Publish the state of a connection that has not received a valid frame yet."""
        if self._report.attempts or self._report.state == "silent":
            return  # the state changes after `SETTLE_S`, see `_settled`
        if not self._is_ready and self._is_persistent:
            self._report.show("connecting", _LOGGING_IN)
        elif self._is_persistent and not self._expects_frames:
            self._report.show("live")
        elif self._report.state != "live":
            self._report.show("connecting", _NOTHING_YET, is_ready=True)

    def _conclude(self, reason: str) -> None:
        """Set the state and the backoff after a connection has ended."""
        asked = self._close_reason
        is_flushed = self._outgoing.is_written
        self._outgoing.reset()
        if asked is None:
            self._lose("lost", reason)
            self._tell_closed(reason)
        elif asked == "" and is_flushed and not self._is_persistent:
            self._report.attempts = 0
            self._report.show("live")
        else:
            # A robot that accepts connections but sends nothing stays silent across reconnects.
            state: LinkState = "silent" if self._is_overdue else "lost"
            self._lose(state, asked or reason or "the connection was closed")
            if not self._is_persistent:
                # The engine's own pace (polls, timeouts) is slow enough for the robot.
                self._retry_s = self._clock.now() + self._spec.backoff.initial_s

    def _lose(self, state: LinkState, reason: str) -> None:
        """Count a failed attempt and schedule the next attempt."""
        self._is_overdue = state == "silent"
        self._report.fail(state, reason)
        backoff = self._spec.backoff
        # The exponent is limited, because 2 ** attempts would overflow a float after a night of
        # attempts.
        doublings = min(self._report.attempts - 1, 30)
        wait_s = min(backoff.max_s, backoff.initial_s * 2**doublings)
        self._retry_s = self._clock.now() + wait_s * (1 - backoff.jitter * self._random())

    def _tell_closed(self, reason: str) -> None:
        if not self._is_persistent:
            self._wanted.clear()  # first, because the engine may request a new connection at once
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

    async def _queue(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        try:
            await work()
        except TransportError as fault:
            self._end(str(fault))
        except Exception as bug:  # supervisor, as in `_open`
            self._end(self._mistake(bug))

    async def _read(self) -> None:
        spent, size = 0, _LEAST_SLICE_BYTES
        busy_s, pieces = 0.0, 0
        while True:
            self._is_reader_waiting = True
            data = await self._transport.receive()
            self._is_reader_waiting = False
            if isinstance(data, Envelope) or not self._is_stream:
                began_s = self._clock.now()
                self._receive(data)
                busy_s, pieces = busy_s + self._clock.now() - began_s, pieces + 1
                if busy_s > SLICE_S or pieces >= _SLICE_PIECES:
                    busy_s, pieces = 0.0, 0
                    await asyncio.sleep(0)
                continue
            at = 0
            while at < len(data):
                part = data[at : at + size]
                at += len(part)
                began_s = self._clock.now()
                self._receive(part)
                took_s = self._clock.now() - began_s
                spent += len(part) + _CHUNK_COST
                if spent >= size or took_s > SLICE_S:
                    spent = 0
                    await asyncio.sleep(0)
                if took_s > SLICE_S:
                    size = max(size // 2, _LEAST_SLICE_BYTES)
                elif took_s < SLICE_S / 2:
                    size = min(size * 2, SLICE_BYTES)

    def _take_now(self, data: bytes) -> bool:
        """Handle received bytes at once, unless there are too many or earlier bytes are waiting."""
        if len(data) > _LEAST_SLICE_BYTES or not self._is_reader_waiting:
            return False
        ended = self._ended
        if ended is None or self._close_reason is not None or ended.done():
            return True  # the engine has already closed this connection
        try:
            self._pass_on(data)
        except Exception as bug:  # supervisor, as in `_open`
            self._end(self._mistake(bug))
        return True

    def _receive(self, data: Payload) -> None:
        ended = self._ended
        if ended is not None and self._close_reason is None and not ended.done():
            self._pass_on(data)

    def _pass_on(self, data: Payload) -> None:
        now = self._clock.now()
        if not isinstance(data, Envelope) or self._arrivals.is_new():
            self._heard_s = now
            self._has_news = True
        if isinstance(data, Envelope) and data.verb == NOTICE:
            self._report.log("warning", "notice", str(data.body))
            return
        if isinstance(data, Envelope) and data.verb == LOW_STREAM:
            self._hub.take_low(self._name, data.body)
            return
        if isinstance(data, Envelope) and data.verb == RESTARTED:
            if data.body:
                is_warning = data.attributes.get("level") == "warning"
                self._report.log("warning" if is_warning else "info", "clock", str(data.body))
            self._dispatcher.receive(self._name, data, now, is_new=False)
            return
        if isinstance(data, Envelope) and data.verb == TOPICS:
            self._hub.set_topics(self._name, list_of(data))
            return
        if self._hub.traffic_watchers:
            self._report.saw("received", data)
        is_new, self._has_news = self._has_news, False
        self._dispatcher.receive(self._name, data, now, is_new=is_new)

    async def _write(self) -> None:
        await self._outgoing.run(lambda: self._close_reason is not None)

    def _end(self, reason: str) -> None:
        if self._ended is not None and not self._ended.done():
            self._ended.set_result(reason)

    def _set_alarms(self) -> list[PeriodicTimer]:
        alarms = [PeriodicTimer(self._clock, SETTLE_S, self._settled)]
        if self._spec.timeouts.idle_s is not None:
            alarms.append(PeriodicTimer(self._clock, self._spec.timeouts.idle_s, self._check_idle))
        return alarms

    def _settled(self) -> float | None:
        """Record that the robot has accepted the connection, because no refusal arrived in time."""
        self._has_stood = True
        self._stand()
        self.publish()
        return None

    def _stand(self) -> None:
        """Publish the state of a connection that the robot has not refused: connecting or live."""
        if self._report.state not in ("lost", "connecting"):
            return
        if not self._is_ready:
            self._report.show("connecting", _LOGGING_IN)
        elif self._expects_frames or not self._is_persistent:
            self._report.show("connecting", _NOTHING_YET, is_ready=True)
        else:
            self._report.attempts = 0
            self._report.show("live")

    def _check_idle(self) -> float | None:
        """Close a connection that has been silent too long, or else return the remaining time."""
        limit_s = self._spec.timeouts.idle_s or 0.0
        left_s = self._heard_s + limit_s - self._clock.now()
        if left_s > 0:
            return left_s
        self._end(f"nothing received for {limit_s:g} s; reconnecting")
        return None

    def _mistake(self, bug: Exception) -> str:
        """Log an unexpected exception from a transport; return the message for the operator."""
        log.error("%s failed in an unexpected way", self._transport.address, exc_info=bug)
        return f"the transport failed in an unexpected way ({type(bug).__name__}: {bug})"
