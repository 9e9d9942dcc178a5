"""The guard's side of a connection to a robot.

Theory of operation. One task at a time opens the transport, reads until the connection ends, and
closes the transport. The engine requests the opening and closing of the connection. The guard sends
received data to the engine within the engine's flow-control credit. If the connection is lost while
the robot may be moving, the guard does not wait for the engine. At this moment, the engine may be
frozen or dead. The guard itself reopens the connection (a *rescue*) and writes the stop first. The
guard then keeps the open connection for the engine's next attempt to connect.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Final

from urc.guard import messages
from urc.guard.liveness_watch import LivenessWatch
from urc.guard.motion_scheduler import MotionScheduler
from urc.guard.pipe import UNFIT
from urc.guard.send_queue import LaneClock, SendQueue, TimerHandle, tolerant, why_broken
from urc.guard.sent_counters import SentCounters
from urc.model.payload import Envelope, Payload
from urc.transports.arrival_check import ArrivalCheck
from urc.transports.base import (
    PeerClosed,
    Prompt,
    SupportsAbort,
    SupportsOffer,
    Transport,
    TransportError,
)
from urc.transports.connect_race import HURRY, ConnectRace

__all__ = ["WINDOW_BYTES", "GuardedConnection"]

WINDOW_BYTES: Final = 65536
"""Maximum number of bytes sent to the engine that the engine has not acknowledged yet."""
_GRACE_S: Final = 1.0
"""Time for which a transport may exceed its timeout before the attempt is cancelled, in seconds."""
_CLOSE_S: Final = 1.0
_RESCUE_S: Final = 90.0
"""Time limit for a rescue, in seconds. After a failed rescue, only the engine tries to connect."""
_KEPT_S: Final = 6.0
"""Time for which a rescued connection is kept for the engine, in seconds."""
_EVERY_S: Final = 0.05
"""Minimum interval between connection attempts, in seconds; five times as long for transports that
are slow to open."""
_SHORTEST_S: Final = 0.07
_LONGEST_S: Final = 2.0
"""Maximum timeout for one connection attempt, in seconds; `_SHORTEST_S` is the minimum. The timeout
is a multiple of the usual duration of successful attempts. An attempt that begins before the robot
is reachable fails and delays the next attempt, so the timeout must be short.
"""
_REMEMBERED: Final = 5
_TIMES: Final = 4.0
_LOG_IN_S: Final = 6.0
_GROWTH: Final = 1.25
_LONG_S: Final = 0.5
"""Maximum timeout for connection attempts that cannot overlap, in seconds. The timeout of these
attempts grows with each attempt, up to this maximum.
"""
_USUAL_S: Final = 0.25
_WITHIN_S: Final = 0.7
"""Maximum time for repeating a stop, including the last repeat on a slow connection, in seconds."""
_PAUSE_S: Final = 0.01

Emit = Callable[[messages.FromGuard], int]
"""Function that forwards a message and returns its approximate size in bytes."""

log = logging.getLogger(__name__)


class GuardedConnection:
    """A guarded transport with its connection and its hold-to-run controls."""

    def __init__(
        self, make: messages.MakeTransport, transport: Transport, emit: Emit, clock: LaneClock
    ) -> None:
        """Store the transport; `open` opens the connection."""
        self.name = make.line
        self.transport = transport
        self._emit = emit
        self._clock = clock
        self._is_slow_to_open = make.is_strict
        self._sent_counters = SentCounters()
        self.scheduler = MotionScheduler(
            transport,
            clock,
            stalled_s=make.stalled_s,
            is_strict=make.is_strict,
            told=lambda control, reason, number: self._report_stop(control, reason, number),
            failed=self._stall,
            sent_counters=self._sent_counters,
            counted=self._tell_counted,
        )
        self._liveness = LivenessWatch(
            transport,
            clock,
            silent_s=make.silent_s,
            is_moving=lambda: self.scheduler.is_moving,
            failed=self._stall,
        )
        self._arrivals = ArrivalCheck(transport)
        offer = transport.offer if isinstance(transport, SupportsOffer) else None
        self._offer = None if offer is None else tolerant(offer, False, self._stall)
        self._prompt = transport if isinstance(transport, Prompt) else None
        self._abort = transport.abort if isinstance(transport, SupportsAbort) else None
        self._queue: SendQueue[int] = SendQueue(
            transport,
            clock,
            self._sent,
            after=self.scheduler.queue,  # type: ignore[arg-type]
        )
        self._task: asyncio.Task[None] | None = None
        self._turn = 0
        self._is_open = False
        self._is_handed = False
        """Whether the engine uses the open connection."""
        self._handed = asyncio.Event()
        self._is_rescuing = False
        self._waiting: TimerHandle | None = None
        """Timer that ends the engine's wait for a rescue; None while the engine does not wait."""
        self._fault = ""
        self._patience_s = _USUAL_S
        self._took_s: deque[float] = deque(maxlen=_REMEMBERED)
        """Durations of the most recent successful attempts, in seconds."""
        self._hurry = ConnectRace(_SHORTEST_S)
        self._credit = 0
        self._credited = asyncio.Event()
        self._is_reading = False
        self._acked = 0
        self._counted = 0
        """Number of the newest frame with counters that was sent for the engine."""
        self._round = 0
        """Number of `SendStale` messages sent on this connection, each a refusal of frames."""

    # -- requests from the engine

    def open(self, turn: int, timeout_s: float) -> None:
        """Open the connection; report the result as `LineOpened` or `OpenFailed`."""
        self._turn = turn
        if not self._is_rescuing:
            self._switch(self._live(timeout_s))
        elif self._is_open:
            self._hand_over()
        else:
            self._forget_waiting()
            self._waiting = self._clock.call_at(self._clock.now() + timeout_s, self._in_vain)

    def close(self, turn: int) -> None:
        """Stop all controls that move the robot, close the connection, and report `LineClosed`."""
        if turn != self._turn or self._is_rescuing:
            self._forget_waiting()
            self._emit(messages.LineClosed(self.name, turn))
        else:
            self.scheduler.stop_all()
            self.scheduler.write_due()
            self.scheduler.check_arrivals()
            self._switch(self._shut(turn))

    def send(self, said: messages.SendBytes) -> None:
        """Send a frame that causes no motion; report `SendDone`, `SendRefused` or `SendStale`."""
        if said.turn != self._turn or not self._is_handed or said.round != self._round:
            return  # from an earlier connection, or rendered again meanwhile
        data, number = said.data, said.number
        offer = self._offer if self._is_free() and isinstance(data, bytes) else None
        if offer is not None and not self._sent_counters.fits(said.count):
            self._refuse(number)
        elif offer is None or not offer(data):  # type: ignore[arg-type] # bytes, see above
            self._queue.push(partial(self._leave, said), number)
        else:
            self._count(said)
            if self._prompt is not None and self._prompt.is_clogged:
                self._queue.push(lambda: b"", number)  # replies after the data before it
            else:
                self._acked = number

    def _leave(self, said: messages.SendBytes) -> Payload | None:
        """Return the data of the next queued frame; None if its counter values are already used."""
        if said.round != self._round:
            return None
        if not self._sent_counters.fits(said.count):
            self._refuse(said.number)
            return None
        self._count(said)
        # Reported after the transport has the frame, because the engine may reply immediately.
        asyncio.get_running_loop().call_soon(self.scheduler.tell_counted)
        return said.data

    def _count(self, said: messages.SendBytes) -> None:
        self._sent_counters.left(said.count)
        if said.count is not None:
            self._counted = said.number

    def _refuse(self, number: int) -> None:
        """Discard frame `number` and all later frames, whose counter values are already used."""
        self._round += 1
        self._emit(messages.SendStale(self.name, self._turn, number, self._sent_counters.stand))

    def credit(self, turn: int, amount: int) -> None:
        """Add `amount` bytes to the flow-control credit, as acknowledged by the engine."""
        if turn == self._turn:
            self._credit += amount
            self._credited.set()

    def settle(self) -> None:
        """Report the results of a batch of messages, and watch liveness while the robot moves."""
        if self._acked:
            number, self._acked = self._acked, 0
            self._emit(messages.SendDone(self.name, self._turn, number))
        self.scheduler.tell_counted()
        self._liveness.start()

    def rescue(self) -> None:
        """Reopen the connection without the engine, because a stop is pending."""
        if not self._is_open and not self._is_rescuing and self._task is None:
            self._switch(self._rescue())

    async def finish(self, within_s: float) -> None:
        """Stop all motion, wait at most `within_s` seconds for the stops, then close."""
        self.scheduler.stop_all()
        self.scheduler.write_due()
        until_s = self._clock.now() + within_s
        while self._clock.now() < until_s and not self._is_quiet:
            await self._clock.sleep(_PAUSE_S)
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.wait({task}, timeout=_CLOSE_S)
        self._is_open = False
        self._liveness.end()
        self.scheduler.cut()
        self._queue.end()
        await self._close_transport()

    @property
    def _is_quiet(self) -> bool:
        scheduler = self.scheduler
        return scheduler.is_settled and not scheduler.owes and not scheduler.is_in_doubt

    def _is_free(self) -> bool:
        return self._queue.is_idle and self.scheduler.queue.is_idle

    # -- one connection

    def _switch(self, work: Coroutine[Any, Any, None]) -> None:
        """Cancel the running task, and run `work` in a new task."""
        self._task = asyncio.get_running_loop().create_task(self._after(self._task, work))

    async def _after(self, old: asyncio.Task[None] | None, work: Coroutine[Any, Any, None]) -> None:
        try:
            if old is not None and not old.done():
                old.cancel()
                await asyncio.wait({old})
            await work
        finally:
            work.close()
            if self._task is asyncio.current_task():
                self._task = None

    async def _live(self, timeout_s: float) -> None:
        fault = await self._attempt(timeout_s)
        if fault:
            self._emit(messages.OpenFailed(self.name, self._turn, fault))
            if self.scheduler.owes:
                await self._rescue()
            return
        self._begin()
        self._hand_over()
        await self._serve()

    async def _attempt(self, timeout_s: float) -> str:
        """Open the transport; return the reason for a failure, "" on success."""
        began_s = self._clock.now()
        try:
            async with asyncio.timeout(timeout_s + _GRACE_S):
                await self.transport.open(timeout_s)
        except TransportError as refused:
            return str(refused)
        except TimeoutError:
            await self._close_transport()
            return f"no answer from {self.transport.address} within {timeout_s:g} s"
        except Exception as bug:  # supervisor: a third-party transport may raise anything
            return why_broken(bug)
        self._took_s.append(self._clock.now() - began_s)
        # The shortest duration is the least affected by delays on this machine.
        self._patience_s = min(max(_TIMES * min(self._took_s), _SHORTEST_S), _LONGEST_S)
        return ""

    def _begin(self) -> None:
        self._is_open = True
        self._handed.clear()
        self._arrivals.begin()
        self._liveness.begin()
        self.scheduler.begin()

    def _hand_over(self) -> None:
        self._forget_waiting()
        self._is_rescuing = False
        self._is_handed = True
        self._acked = self._counted = self._round = 0
        self._credit = WINDOW_BYTES
        self._handed.set()
        if self._prompt is not None:
            self._prompt.divert(self._arrived)
        address, stand = self.transport.address, self._sent_counters.stand
        self._emit(messages.LineOpened(self.name, self._turn, address, stand))

    async def _serve(self) -> None:
        try:
            reason = await self._read()
        except TransportError as fault:
            reason = str(fault)
        except Exception as bug:  # supervisor, as in `_attempt`
            reason = why_broken(bug)
        # In a new task, because recovery here would nest deeper with every cut.
        self._switch(self._recover(reason))

    async def _read(self) -> str:
        while True:
            while self._credit <= 0:
                self._credited.clear()
                await self._credited.wait()
                self._liveness.note_delivery()  # the engine was slow, not the robot
            self._is_reading = True
            try:
                data = await self.transport.receive()
            finally:
                self._is_reading = False
            self._pass_on(data)
            await asyncio.sleep(0)  # a busy line must not delay the stops

    def _arrived(self, data: bytes) -> bool:
        """Pass data to the engine if the engine can accept it now; return whether it was passed."""
        if not self._is_reading or self._credit <= 0 or not self._is_handed:
            return False
        self._pass_on(data)
        return True

    def _pass_on(self, data: Payload) -> None:
        self._liveness.note_delivery()
        is_new = not isinstance(data, Envelope) or self._arrivals.is_new()
        try:
            self._credit -= self._emit(messages.BytesReceived(self.name, self._turn, data, is_new))
        except UNFIT as fault:
            raise PeerClosed(f"the received data cannot be passed on ({fault})") from fault

    async def _recover(self, reason: str, *, is_abort: bool = False) -> None:
        """Close a broken connection, inform the engine, and reconnect if a stop is pending."""
        # Without an abort, the kernel would send its buffered bytes later.
        is_abort = is_abort or self.scheduler.is_in_doubt
        self._cut(reason)
        await self._close_transport(is_abort=is_abort)
        if self.scheduler.owes:
            await self._rescue()

    def _cut(self, reason: str) -> None:
        self._is_open = False
        self._liveness.end()
        for control in self.scheduler.cut():
            self._emit(messages.StopDue(control))
        self._queue.end()
        if self._is_handed:
            self._is_handed = False
            self._emit(messages.LineLost(self.name, self._turn, reason))

    async def _shut(self, turn: int) -> None:
        until_s = self._clock.now() + _WITHIN_S
        while self._is_open and not self._is_quiet and self._clock.now() < until_s:
            await self._clock.sleep(_PAUSE_S)
        self._is_handed = False
        is_abort = self.scheduler.is_in_doubt
        self._cut("")
        await self._close_transport(is_abort=is_abort)
        self._emit(messages.LineClosed(self.name, turn))
        if self.scheduler.owes:
            await self._rescue()

    async def _close_transport(self, *, is_abort: bool = False) -> None:
        close = self._abort if is_abort else None
        try:
            async with asyncio.timeout(_CLOSE_S):
                await (close or self.transport.close)()
        except TimeoutError:
            log.error("%s did not close in time", self.transport.address)
        except Exception as bug:  # supervisor, as in `_attempt`
            why_broken(bug)

    # -- rescue

    def _stall(self, reason: str) -> None:
        """Reset the connection, so that data in the kernel's send buffer is never delivered."""
        if self._is_open:
            self._is_open = False
            self._liveness.end()
            self._switch(self._recover(reason, is_abort=True))

    async def _rescue(self) -> None:
        self._is_rescuing = True
        every_s = 5 * _EVERY_S if self._is_slow_to_open else _EVERY_S
        until_s = self._clock.now() + _RESCUE_S
        hurry = HURRY.set(self._hurry)
        try:
            while self.scheduler.owes and self._clock.now() < until_s:
                began_s = self._clock.now()
                # Overlapping attempts get more time, so that a slower network does not end them.
                enough_s = _LOG_IN_S if self._is_slow_to_open else _LONGEST_S
                is_hurried = self._hurry.is_used
                self._fault = await self._attempt(enough_s if is_hurried else self._patience_s)
                if not self._fault:
                    HURRY.set(None)
                    self._begin()
                    if self._waiting is not None:
                        self._hand_over()
                    await self._serve_rescued()
                    return
                self._patience_s = min(self._patience_s * _GROWTH, _LONG_S)
                await self._clock.sleep(max(0.0, began_s + every_s - self._clock.now()))
            self._in_vain()
        finally:
            HURRY.reset(hurry)
            self._is_rescuing = False

    async def _serve_rescued(self) -> None:
        """Wait until the engine takes over the connection, then serve the engine."""
        alarm = self._clock.call_at(self._clock.now() + _KEPT_S, self._handed.set)
        try:
            await self._handed.wait()
        finally:
            alarm.cancel()
        if self._is_handed:
            await self._serve()
        else:
            self._switch(self._recover("the engine has not requested the connection"))

    def _in_vain(self) -> None:
        """Report the timeout to an engine that is waiting for a rescue."""
        if self._waiting is not None:
            self._forget_waiting()
            fault = self._fault or f"no answer from {self.transport.address}"
            self._emit(messages.OpenFailed(self.name, self._turn, fault))

    def _forget_waiting(self) -> None:
        if self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None

    # -- reports from the send queues

    def _report_stop(self, control: str, reason: str, number: int) -> None:
        self._emit(messages.StopWritten(control, reason, number))  # type: ignore[arg-type]

    def _tell_counted(self, stale: list[tuple[str, int]]) -> None:
        if self._is_handed:
            stand = self._sent_counters.stand
            self._emit(
                messages.CountersAdvanced(self.name, self._turn, self._counted, stand, stale)
            )

    def _sent(self, number: int, fault: TransportError | None) -> None:
        if fault is None:
            self._emit(messages.SendDone(self.name, self._turn, number))
            return
        is_closed = isinstance(fault, PeerClosed)
        self._emit(messages.SendRefused(self.name, self._turn, number, str(fault), is_closed))
