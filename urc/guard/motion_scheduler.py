"""The scheduler of one connection's held commands, which writes frames and detects stalls.

Theory of operation. `write_due` writes the due frames of every control. Stops are written first,
regardless of unsent data. Motion frames are written only if no earlier data has been waiting too
long. `write_due` runs after every message and when the next frame is due. Until the other side
acknowledges a write, `write_due` also runs every few milliseconds, because the kernel does not
report sent bytes.

A control is *in doubt* while a written frame may not have arrived at the robot. If the connection
is lost while a control is in doubt, a stop becomes pending.
"""

import asyncio
from collections.abc import Callable
from functools import partial
from math import inf
from typing import Final

from urc.guard.send_queue import LaneClock, SendQueue, TimerHandle, tolerant
from urc.guard.sent_counters import SentCounters
from urc.model.payload import Count, Numbered, Payload
from urc.motion.hold_to_run import HoldTerms, HoldToRun, Reason
from urc.motion.stall import IN_FLIGHT_S, StallWatch
from urc.transports.base import (
    SupportsForget,
    SupportsOffer,
    SupportsUnsent,
    Transport,
    TransportError,
)

__all__ = ["MotionScheduler"]

_LOOK_S: Final = 0.005
"""Minimum interval between checks of a connection with unsent data, in seconds."""
_LONGEST_LOOK_S: Final = 0.02
"""Maximum interval between checks of a connection with unsent data, in seconds. While no frame is
waiting, the interval doubles after each check."""


class MotionScheduler:
    """The hold-to-run controls of one connection."""

    def __init__(
        self,
        transport: Transport,
        clock: LaneClock,
        *,
        stalled_s: float,
        is_strict: bool,
        told: Callable[[str, Reason, int], None],
        failed: Callable[[str], None],
        sent_counters: SentCounters | None = None,
        counted: Callable[[list[tuple[str, int]]], None] | None = None,
    ) -> None:
        """Create the scheduler; nothing is written before `begin` is called.

        Args:
            transport: the transport, with optional support for `SupportsUnsent`, `SupportsOffer`
                and `SupportsForget`.
            clock: the time source.
            stalled_s: age of unsent bytes at which the connection counts as stalled, in seconds.
            is_strict: whether a motion frame waits until all earlier bytes are sent.
            told: callback for each written stop; it receives the control, the reason and the number
                of the newest tick.
            failed: callback that receives the reason when the connection stalls or refuses data.
            sent_counters: counter values sent on the connection; None to create new counters.
            counted: callback after a change to the counters; it receives the control and number of
                each obsolete tick.
        """
        self._clock = clock
        self._unsent = self._offer = self._forget = None
        if isinstance(transport, SupportsUnsent):
            self._unsent = tolerant(transport.unsent, 1, failed)  # 1: it stays in doubt
        if isinstance(transport, SupportsOffer):
            self._offer = tolerant(transport.offer, False, failed)
        if isinstance(transport, SupportsForget):
            self._forget = tolerant(transport.forget, None, failed)
        self._is_strict = is_strict or self._forget is not None
        self._told = told
        self._failed = failed
        self._sent_counters = sent_counters or SentCounters()
        self._counted = counted
        self._counts: dict[str, Count | None] = {}
        """Counter values that the newest tick uses, keyed by control; None without counters."""
        self._stale: list[tuple[str, int]] = []
        self._watch = StallWatch(stalled_s)
        self.queue: SendQueue[tuple[str, bool]] = SendQueue(transport, clock, self._sent)
        """Queue of frames that the transport cannot accept immediately."""
        self._holds: dict[str, HoldToRun] = {}
        self._numbers: dict[str, int] = {}
        self._stopped_at: dict[str, int] = {}
        """Number of the newest tick before each control's last stop, keyed by control; the stop may
        still be in the queue."""
        self._doubtful: set[str] = set()
        self._is_stop_under_way = False
        """Whether a written stop may not have arrived at the robot."""
        self._is_open = False
        self._alarm: TimerHandle | None = None
        self._alarm_s = 0.0
        self._look_s = _LOOK_S

    @property
    def owes(self) -> bool:
        """Whether a control must be stopped when the connection reopens."""
        return any(hold_to_run.owes_stop for hold_to_run in self._holds.values())

    @property
    def is_moving(self) -> bool:
        """Whether any control is moving the robot."""
        return any(hold_to_run.state == "moving" for hold_to_run in self._holds.values())

    @property
    def is_settled(self) -> bool:
        """Whether all controls are idle, and the transport has accepted all stops and repeats."""
        return self.queue.is_idle and all(one.state == "idle" for one in self._holds.values())

    @property
    def is_in_doubt(self) -> bool:
        """Whether a written frame may not have arrived at the robot."""
        return bool(self._doubtful)

    # -- requests for a control

    def arm(self, control: str, terms: HoldTerms) -> None:
        """Arm `control`: accept its ticks from now on."""
        self._hold_to_run(control, terms).arm()

    def tick(
        self,
        control: str,
        number: int,
        data: Payload,
        at_s: float,
        count: Count | None = None,
        until_s: float = inf,
    ) -> None:
        """Handle input that was sampled at `at_s`; empty `data` only renews the lease.

        The lease ends at `until_s` at the latest. The tick of an image that is already too old ends
        the motion.
        """
        hold_to_run = self._holds.get(control)
        if hold_to_run is None:
            return
        self._numbers[control] = number
        self._counts[control] = count
        now = self._clock.now()
        if now - at_s >= hold_to_run.terms.lease_s:
            return  # too old to renew the lease
        if now >= until_s:
            if hold_to_run.state == "moving":
                hold_to_run.stop("expired", now)
            return
        is_stale = not self._sent_counters.fits(count)
        newest = None if is_stale else data or None
        if hold_to_run.tick(newest, min(at_s, now), until_s) and is_stale:
            self._stale.append((control, number))

    def renew(self, control: str, stop: Payload, stops: tuple[Numbered, ...] = ()) -> None:
        """Replace the stop frame of `control`."""
        hold_to_run = self._holds.get(control)
        if hold_to_run is not None:
            hold_to_run.renew(hold_to_run.terms._replace(stop=stop, stops=stops))

    def release(self, control: str) -> None:
        """Stop `control`, because it was released."""
        hold_to_run = self._holds.get(control)
        if hold_to_run is not None:
            hold_to_run.stop("released", self._clock.now())

    def stop(self, control: str, terms: HoldTerms) -> None:
        """Stop `control`, even if idle."""
        hold_to_run = self._hold_to_run(control, terms)
        hold_to_run.stop("stopped", self._clock.now())
        if not self._is_open:
            hold_to_run.cut()

    def owe(self, control: str, terms: HoldTerms) -> None:
        """Record that `control` may be moving the robot; stop it when the connection opens."""
        self._hold_to_run(control, terms).cut(is_doubtful=True)

    def stop_all(self) -> None:
        """Stop all controls that are moving the robot, and disarm all controls, before closing."""
        now = self._clock.now()
        for hold_to_run in self._holds.values():
            if hold_to_run.state == "moving":
                hold_to_run.stop("revoked", now)
            hold_to_run.shorten(now)
            hold_to_run.is_armed = False

    def _hold_to_run(self, control: str, terms: HoldTerms) -> HoldToRun:
        hold_to_run = self._holds.get(control)
        if hold_to_run is None:
            hold_to_run = self._holds[control] = HoldToRun(terms)
        else:
            hold_to_run.renew(terms)
        return hold_to_run

    def check_arrivals(self) -> None:
        """Record that all frames have arrived if no bytes are unsent on a working connection."""
        if self._unsent is not None and self.queue.is_idle and not self._unsent():
            self._all_arrived()

    def _all_arrived(self) -> None:
        self._doubtful.clear()
        self._is_stop_under_way = False

    # -- the line

    def begin(self) -> None:
        """Record that the connection is open, and write pending stops first."""
        self._is_open = True
        self._sent_counters.reset()
        self._stale.clear()
        self._watch.reset()
        now = self._clock.now()
        for hold_to_run in self._holds.values():
            hold_to_run.restored(now)
        self.write_due()

    def cut(self) -> list[str]:
        """Record that the connection is closed, and drop all unsent frames.

        Returns:
            Controls whose stops were reported as written but may have been lost with the
            connection.
        """
        self._is_open = False
        for control, is_stop in self.queue.end():
            if is_stop:
                self._doubtful.add(control)
        lost: list[str] = []
        for control, hold_to_run in self._holds.items():
            is_reported = hold_to_run.state != "moving" and hold_to_run.is_told
            hold_to_run.cut(is_doubtful=control in self._doubtful)
            if is_reported and hold_to_run.owes_stop:
                lost.append(control)
        self._all_arrived()
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        return lost

    def write_due(self) -> None:
        """Write every frame that is due now, stops first."""
        if not self._is_open:
            return
        now = self._clock.now()
        waiting: list[tuple[str, HoldToRun]] = []
        for control, hold_to_run in self._holds.items():
            if hold_to_run.must_stop(now):
                data = hold_to_run.due(now, is_clear=False)
                if data is not None:
                    self._write(control, data, now, is_stop=True)
            elif hold_to_run.is_waiting:
                waiting.append((control, hold_to_run))
        for control, hold_to_run in waiting:
            if self._sent_counters.fits(self._counts.get(control)) and self._is_clear(now):
                data = hold_to_run.due(now, is_clear=True)
                if data is not None:
                    self._write(control, data, now, is_stop=False)
        self._set_alarm(now)
        self.tell_counted()

    def tell_counted(self) -> None:
        """Report the counters and obsolete ticks that changed since the last report."""
        if self._sent_counters.is_changed:
            for control, hold_to_run in self._holds.items():
                if hold_to_run.is_waiting and not self._sent_counters.fits(
                    self._counts.get(control)
                ):
                    hold_to_run.forget()
                    self._stale.append((control, self._numbers[control]))
        elif not self._stale:
            return
        self._sent_counters.is_changed = False
        stale, self._stale = self._stale, []
        if self._counted is not None:
            self._counted(stale)

    def _is_clear(self, now: float) -> bool:
        if not self.queue.is_idle:
            return False
        if self._unsent is None or not (self._doubtful or self._is_strict):
            return True  # all written bytes have left: no system call needed
        unsent = self._unsent()
        self._watch.saw(unsent, now)
        if not unsent:
            self._all_arrived()
        return not unsent or (not self._is_strict and self._watch.age_s(now) < IN_FLIGHT_S)

    def _write(self, control: str, data: Payload, now: float, *, is_stop: bool) -> None:
        if is_stop:
            self._stopped_at[control] = self._numbers.get(control, 0)
            if self._unsent is not None:
                self._watch.saw(self._unsent(), now)
        if is_stop and self._forget is not None and not self._is_stop_under_way:
            # Unsent motion must not follow its stop. After an earlier stop no motion was written,
            # and that stop must not be dropped.
            self._forget()
            self._watch.gave_up()
        if data == b"":  # each step of this robot ends automatically
            self._report_stop(control)
            return
        self._is_stop_under_way |= is_stop
        offer = self._offer
        data, count = self._turn(control, data, is_stop=is_stop)
        if offer is None or type(data) is not bytes or not self.queue.is_idle or not offer(data):
            self._doubtful.add(control)
            if is_stop:
                self.queue.push(partial(self._leave_stop, control, data), (control, is_stop))
            else:
                self.queue.push(partial(self._leave, control, data, count), (control, is_stop))
        else:
            self._sent_counters.left(count)
            if is_stop:
                self._report_stop(control)
        if self._unsent is not None:
            # The next check measures the size of an envelope. A guess that is too high would look
            # like progress.
            self._watch.wrote(len(data) if isinstance(data, bytes) else 0, now)
            self._doubtful.add(control)
            self._look_s = _LOOK_S

    def _turn(self, control: str, data: Payload, *, is_stop: bool) -> tuple[Payload, Count | None]:
        """Return the next frame to write and the counter values that it uses."""
        if not is_stop:
            return data, self._counts.get(control)
        stops = self._holds[control].terms.stops
        return self._sent_counters.choose(stops) if stops else (data, None)

    def _leave_stop(self, control: str, data: Payload) -> Payload:
        """Return the next stop frame in the queue, with the next counter values."""
        data, count = self._turn(control, data, is_stop=True)
        self._sent_counters.left(count)
        self._tell_soon()
        return data

    def _leave(self, control: str, data: Payload, count: Count | None) -> Payload | None:
        """Return the next motion frame in the queue; None if its counter values are used."""
        fits = self._sent_counters.fits(count)
        if fits:
            self._sent_counters.left(count)
        else:
            self._stale.append((control, self._numbers[control]))
        self._tell_soon()
        return data if fits else None

    def _tell_soon(self) -> None:
        """Report the counters after a frame was sent, because the engine may reply immediately."""
        asyncio.get_running_loop().call_soon(self.tell_counted)

    def _sent(self, tag: tuple[str, bool], fault: TransportError | None) -> None:
        control, is_stop = tag
        if fault is not None:
            self._doubtful.add(control)
            self._failed(str(fault))
            return
        if self._unsent is None:
            self._doubtful.discard(control)
        if is_stop:
            self._report_stop(control)
        self.write_due()

    def _report_stop(self, control: str) -> None:
        hold_to_run = self._holds[control]
        if hold_to_run.reason is not None and not hold_to_run.is_told:
            hold_to_run.is_told = True
            self._told(control, hold_to_run.reason, self._stopped_at.get(control, 0))

    # -- time

    def _set_alarm(self, now: float) -> None:
        # Overdue motion waits for the line to be clear.
        dues = [one.deadline for one in self._holds.values() if one.state != "idle"]
        at_s = min((due for due in dues if due is not None), default=float("inf"))
        at_s = max(at_s, now + _LOOK_S)
        if self._is_watched or not self.queue.is_idle:
            # A stall is detected at its deadline, not at the next check.
            stalled_s = self._watch.deadline or at_s
            at_s = min(at_s, now + self._look_s, max(stalled_s, now))
        elif at_s == float("inf"):
            return
        if self._alarm is not None and self._alarm_s <= at_s:
            return  # an early timer finds nothing due, and is set again
        if self._alarm is not None:
            self._alarm.cancel()
        self._alarm_s = at_s
        self._alarm = self._clock.call_at(at_s, self._ring)

    def _ring(self) -> None:
        self._alarm = None
        if not self._is_open:
            return
        now = self._clock.now()
        if self._is_stalled(now):
            limit_ms = self._watch.limit_s * 1000
            self._failed(f"the robot has accepted no data for {limit_ms:.0f} ms while moving")
            return
        self.write_due()

    def _is_stalled(self, now: float) -> bool:
        since = self.queue.busy_since_s
        if since is not None and now - since >= self._watch.limit_s:
            return True
        if self._unsent is None or not self._is_watched:
            return False
        unsent = self._unsent()
        if not unsent and self._forget is not None and not self.queue.is_idle:
            # The discarded data left no unsent bytes, and later data has no connection yet.
            return self._watch.age_s(now) >= self._watch.limit_s
        if not unsent and self.queue.is_idle:
            self._all_arrived()
        self._look_s = _LOOK_S if self._is_wanted else min(2 * self._look_s, _LONGEST_LOOK_S)
        return self._watch.saw(unsent, now)

    @property
    def _is_wanted(self) -> bool:
        """Whether a motion frame is waiting to be written."""
        return any(hold_to_run.is_waiting for hold_to_run in self._holds.values())

    @property
    def _is_watched(self) -> bool:
        """Whether unsent bytes must be watched, because they contain or delay motion frames.

        Motion frames wait for unsent bytes only on slow-opening transports. On other transports, a
        ping sent during an interruption would block motion until the interruption ends, and the old
        motion would then continue.
        """
        return bool(self._doubtful) or (self._is_strict and self._is_wanted)
