"""The controls of one robot: one motion desk, and one operator session for each page.

Layer 5. Nothing blocks: a page gets the newest lease, the newest heartbeat and one notice for each
control when its socket is free. Ticks faster than any robot's rate are thinned: the newest wins,
and the last one always arrives.
"""

import asyncio
from collections.abc import Callable
from hmac import compare_digest
from typing import Literal

from urc.model.driver import Driver
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import Reason
from urc.motion.lease import LeaseState, Operator, Role
from urc.motion.rate_limiter import RateLimiter
from urc.runtime.audit import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.clock import Clock, Timer
from urc.runtime.hub import Hub, LogEntry
from urc.runtime.latch import Latch, LatchStore
from urc.runtime.loop_watchdog import TOO_LATE_S, LoopWatchdog
from urc.runtime.motion_controller import MotionBackend, MotionController
from urc.web.drive.one_shot_commands import OneShotCommands
from urc.web.drive.operator_session import FLOOD, Drivable, OperatorSession
from urc.web.wire import drive as wire

__all__ = ["BEAT_S", "ControlService", "Drivable", "OperatorSession"]

BEAT_S = 0.05
"""Interval of the heartbeat numbers to the page that drives, in seconds; its ticks echo them."""
THINNED_S = 0.01
"""Shortest mean time between two applied ticks of one control, in seconds."""
PATIENCE_S = 0.25
"""A late tick is not reported while the control has moved within this time, in seconds."""


Offered = Literal["in time", "one more", "no tick"]
"""A tick within the rate of any robot, a faster one, or another message."""


class ControlService:
    """The motion desk of one robot and its pages."""

    def __init__(
        self,
        driver: Driver,
        clock: Clock,
        file: LatchStore | None = None,
        trail: AuditRecorder | None = None,
    ) -> None:
        """Restore the latch from its file.

        The held commands of `driver` are the controls. `file` keeps the latch over a restart, and
        `trail` receives the events of the audit log; both may be None.
        """
        self.trail = trail or AuditRecorder("", _unread, utc=lambda: 0.0)
        self.desk = self._desk(driver, file.load() if file is not None else Latch(LeaseState()))
        self._driver = driver
        self._clock = clock
        self._file = file
        self._hub: Hub | None = None
        self._seats: dict[str, OperatorSession] = {}
        self._guests = 0
        self._number = 0
        """Number of the newest lease."""
        self._beating: Timer | None = None
        self._expiring: Timer | None = None
        self.once = OneShotCommands(driver, lambda: self.desk, clock, self.trail)
        self.watch = LoopWatchdog(clock, self._held_up)
        """Detects a blocked event loop; runs while the robot is connected."""
        self._heed(file)

    @property
    def seats(self) -> tuple[OperatorSession, ...]:
        """The pages that watch the robot."""
        return tuple(self._seats.values())

    @property
    def commands(self) -> tuple[str, ...]:
        """Names of the held commands."""
        return tuple(name for name, one in self._driver.commands.items() if one.hold is not None)

    def renew(self, driver: Driver, file: LatchStore | None) -> None:
        """Switch to another version of the driver, between two sessions.

        A latched STOP stays latched, and an unacknowledged one is still sent. All leases end, and
        nothing stays armed.
        """
        kept = Latch(self.desk.lease.state, not self.desk.is_confirmed)
        for seat in self._seats.values():
            for command in list(seat.alarms):
                seat.forget(command)
            seat.paces.clear()
        self._driver, self._file = driver, file
        self.once.driver = driver
        self._heed(file)
        self.desk = self._desk(driver, kept)
        for seat in self._seats.values():
            self.desk.join(seat.client)
        self._changed(self.desk.lease.state)

    def _desk(self, driver: Driver, kept: Latch) -> MotionController:
        desk = MotionController(driver, kept=kept.state, is_owed=kept.is_owed)
        desk.on_change = self._changed
        desk.on_moved = self.trail.moved
        desk.on_refused = self._refused
        return desk

    # -- sessions

    async def serve(self, session: Drivable) -> None:
        """Let a session be driven until this task is cancelled."""
        if not self.desk.can_move:
            return
        self._hub = session.hub
        if self._file is not None and self._file.fault:
            self._latch_fault(self._file.fault)
        self.watch.start()
        self.desk.attach(session.frames, session.movers)
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self.once.serve(session))
                if session.movers is not None:
                    group.create_task(self._follow(session.movers))
        finally:
            self.watch.end()
            self._hub = None
            self.desk.detach()
            now = self._clock.now()
            for command in self.commands:  # movers stop silently
                self.trail.stopped(command, "the robot was disconnected", now)

    async def _follow(self, movers: MotionBackend) -> None:
        while True:
            for command, reason in await movers.stops():
                self._stopped(command, reason)

    # -- pages

    def sit(self, place: str, role: Role, wake: Callable[[], None]) -> OperatorSession:
        """Add a page; raise `UrcError` when there are too many.

        Args:
            place: its address, shown to others; "" for this machine.
            role: its rights.
            wake: callback for new messages to the page.
        """
        self._guests += 1
        name = f"screen {self._guests}{f' at {place}' if place else ''}"
        seat = OperatorSession(Operator(f"s{self._guests}", name, role), wake)
        self.desk.join(seat.client)
        self._seats[seat.client.id] = seat
        return seat

    def rise(self, seat: OperatorSession) -> None:
        """Remove a page; its held controls stop."""
        for command in list(seat.alarms):
            seat.forget(command)
        self._seats.pop(seat.client.id, None)
        if seat.spare is not None:
            seat.spare.end()
        self.desk.part(seat.client.id)

    def seat_of(self, key: str) -> OperatorSession | None:
        """Return the page with this key, or None."""
        said = key.encode()
        return next(
            (one for one in self._seats.values() if compare_digest(one.key.encode(), said)), None
        )

    def changes(self, seat: OperatorSession) -> list[str]:
        """Return the messages that bring a page up to date."""
        texts: list[str] = []
        is_told = self.desk.can_move or seat.client.role == "viewer"  # a watcher gives no commands
        if is_told and seat.seen != self._number:
            seat.seen = self._number
            desk, now = self.desk, self._clock.now()
            is_confirmed = desk.is_confirmed and desk.has_own_stop
            texts.append(seat.lease(desk.lease.state, now, is_confirmed=is_confirmed))
        texts += seat.notices.values()
        seat.notices.clear()
        if seat.beat is not None:
            texts.append(wire.encode_beat(seat.beat))
            seat.beat = None
        return texts

    # -- messages from pages

    def offer(self, seat: OperatorSession, data: bytes) -> Offered:
        """Take a tick as raw bytes; return its kind.

        A tick that arrives while another is pending replaces it without being decoded. Many of
        them pause the socket, so a flood costs nothing.
        """
        if seat.alarms and seat.doubled is None:
            command = wire.command_of(data)
            if command in seat.alarms:
                self._wait(seat, command, data)
                seat.crowd += 1
                if seat.crowd == FLOOD:
                    seat.hold_back(True)
                return "one more"
        now = self._clock.now()
        try:
            tick = wire.decode_tick(data)
        except wire.NO_TICK:
            return "no tick"
        pace = seat.paces.get(tick.command)
        is_moving = now - seat.moved_at_s < PATIENCE_S and not seat.alarms
        if is_moving and not seat.doubled and pace is not None and pace.allow(now):
            self._tick(seat, tick, now)
            return "in time"
        self._thin(seat, tick)
        return "one more"

    def handle(self, seat: OperatorSession, said: wire.Driving) -> None:
        """Handle a message from a page."""
        match said:
            case wire.Tick():
                self._thin(seat, said)
            case wire.Release():
                if self.desk.holds(said.command) and not seat.is_first(said.command, said.number):
                    return
                seat.forget(said.command)
                seat.moved_s.pop(said.command, None)
                self.desk.release(seat.client.id, said.command)
            case wire.Stop():
                if not seat.is_first("", said.number):
                    return
                self.stop(seat.client.name)
            case wire.Drive():
                self._drive(seat, said)

    def stop(self, by: str) -> None:
        """Stop and latch. Never refused."""
        for seat in self._seats.values():
            for command in list(seat.alarms):
                seat.forget(command)
        self.desk.stop(by)
        self.once.stopped()

    def _drive(self, seat: OperatorSession, said: wire.Drive) -> None:
        now = self._clock.now()
        reason = self.desk.drive(seat.client.id, said.verb, now, said.for_s)
        if reason:
            seat.notice(said.verb, wire.encode_refused(said.verb, "", reason))
            self.trail.refused(seat.client, said.verb, reason, now)
        elif said.verb == "reset":
            self.once.reset()
        self._set_expiry()

    def _thin(self, seat: OperatorSession, tick: wire.Tick) -> None:
        now = self._clock.now()
        if not self.desk.holds(tick.command):
            text = f"{tick.command!r} is not a held command of this robot"
            seat.notice("tick", wire.encode_refused("tick", "", text))
            self.trail.refused(seat.client, tick.command, text, now)
            return
        if not seat.is_first(tick.command, tick.number):
            return
        pace = seat.paces.get(tick.command)
        if pace is None:
            pace = seat.paces[tick.command] = RateLimiter(THINNED_S)
        if tick.command in seat.alarms:
            self._wait(seat, tick.command, tick)
        elif pace.allow(now):
            self._tick(seat, tick, now)
        else:
            alarm = self._clock.call_at(pace.free_at, lambda: self._ripe(seat, tick.command))
            seat.alarms[tick.command] = alarm
            self._wait(seat, tick.command, tick)

    def _wait(self, seat: OperatorSession, command: str, tick: wire.Tick | bytes) -> None:
        """Keep a tick until its turn; the newest wins."""
        seat.dropped += command in seat.pending
        seat.pending[command] = tick

    def _ripe(self, seat: OperatorSession, command: str) -> None:
        seat.alarms.pop(command, None)
        seat.relax()
        tick = seat.pending.pop(command, None)
        if isinstance(tick, bytes):
            tick = self._read(seat, tick)
        if tick is not None:
            now = self._clock.now()
            seat.paces[command].allow(now)
            self._tick(seat, tick, now)

    def _read(self, seat: OperatorSession, data: bytes) -> wire.Tick | None:
        try:
            return wire.decode_tick(data)
        except wire.NO_TICK as fault:
            seat.notice("tick", wire.encode_refused("tick", "", str(fault)))
            return None

    def _tick(self, seat: OperatorSession, tick: wire.Tick, now: float) -> None:
        given = tuple.__new__(
            ControlInput, (tick.epoch, tick.number, tick.echo)
        )  # fast: many a second
        command = tick.command
        reason = self.desk.tick(seat.client.id, command, tick.arguments, given, now)
        if not reason:
            seat.moved_s[command] = seat.moved_at_s = now
        elif now - seat.moved_s.get(command, float("-inf")) > PATIENCE_S or self._is_closed(given):
            seat.notice(command, wire.encode_refused("tick", command, reason))
            self.trail.refused(seat.client, command, reason, now)

    def _is_closed(self, given: ControlInput) -> bool:
        return given.epoch != self.desk.lease.state.epoch

    # -- effects

    def _stopped(self, command: str, reason: Reason) -> None:
        self.desk.stopped(command, reason)
        self.trail.stopped(command, reason, self._clock.now())
        if reason in ("released", "stopped"):
            return  # the operator let go, or the lease reports it
        for seat in self._seats.values():
            seat.moved_s.pop(command, None)
            seat.notice(command, wire.encode_stopped(command, reason))

    def _refused(self, command: str, why: str) -> None:
        """Tell every page why the robot refused to move."""
        self.trail.stopped(command, why, self._clock.now())
        for seat in self._seats.values():
            seat.forget(command)
            seat.moved_s.pop(command, None)
            seat.notice(command, wire.encode_refused("tick", command, why))

    def _heed(self, file: LatchStore | None) -> None:
        if file is not None:
            file.on_fault = self._latch_fault

    def _latch_fault(self, fault: str) -> None:
        """Report that STOP would not survive a restart, or that it would again."""
        if fault:
            text = f"STOP works, but would not survive a restart of the server: {fault}"
            self._log("error", text)
            for seat in self._seats.values():
                seat.notice("latch", wire.encode_refused("latch", "", text))
        else:
            self._log("info", "STOP survives a restart of the server again")

    def _held_up(self, late_s: float, is_first: bool) -> None:
        if late_s > TOO_LATE_S:
            now = self._clock.now()
            for command in self.desk.halt():
                self.trail.stopped(command, "the server was held up", now)
                for seat in self._seats.values():
                    seat.forget(command)
                    seat.moved_s.pop(command, None)
                    seat.notice(command, wire.encode_stopped(command, "expired"))
        if is_first:
            self._log("warning", f"the server was blocked for {late_s * 1000:.0f} ms")

    def _log(self, level: Literal["info", "warning", "error"], text: str) -> None:
        if self._hub is not None:
            self._hub.log(LogEntry(self._clock.now(), level, "URC", text))

    def _changed(self, state: LeaseState) -> None:
        self._number += 1
        if self._file is not None:
            self._file.save(Latch(state, not self.desk.is_confirmed))
        for seat in self._seats.values():
            seat.wake()
        self.trail.leased(state, self._clock.now())
        self._set_expiry()
        if state.holder is not None and self._beating is None:
            self._beat()

    def _beat(self) -> None:
        """Send a heartbeat to the page that drives, and schedule the next one."""
        self._beating = None
        holder = self.desk.lease.state.holder
        seat = self._seats.get(holder.id) if holder is not None else None
        if seat is None:
            return
        now = self._clock.now()
        seat.beat = self.desk.beat(seat.client.id, now)
        if seat.spare is not None:
            seat.spare.beat(seat.beat)
        seat.wake()
        self._beating = self._clock.call_at(now + BEAT_S, self._beat)

    def _set_expiry(self) -> None:
        if self._expiring is not None:
            self._expiring.cancel()
        due = self.desk.deadline
        self._expiring = None if due is None else self._clock.call_at(due, self._expire)

    def _expire(self) -> None:
        self._expiring = None
        self.desk.expire(self._clock.now())
        self._set_expiry()


def _unread(entry: AuditEntry) -> None:
    """Ignore an entry of the audit log."""
