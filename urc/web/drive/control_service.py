"""The controls of one robot: its motion controller, and an operator session for each page.

Layer 5. No call blocks. When a page's socket is free, the page receives the newest lease, the
newest heartbeat and one notice per control. Above the rate limit, each new tick replaces the
pending tick, so the last tick always takes effect.
"""

import asyncio
from collections.abc import Callable
from hmac import compare_digest
from typing import Literal

from urc.model.driver import Driver
from urc.model.role import Role, includes
from urc.motion.driving_lock import BLIND_S, SeenImage
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import StopReport
from urc.motion.lease import LeaseState, Operator
from urc.motion.rate_limiter import RateLimiter
from urc.problems import printable
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.clock import Clock, Timer
from urc.runtime.hub import Hub, LogEntry
from urc.runtime.image_interlock import ImageInterlock
from urc.runtime.latch import Latch, LatchStore
from urc.runtime.loop_watchdog import TOO_LATE_S, LoopWatchdog
from urc.runtime.motion_controller import MotionBackend, MotionController
from urc.runtime.one_shot_commands import OUT_OF_SCOPE, Drivable, OneShotCommands, role_refusal
from urc.web.drive.operator_session import FLOOD, OperatorSession
from urc.web.feed.client_socket import SocketPeer
from urc.web.wire import drive as wire

__all__ = ["BEAT_S", "ControlService", "OperatorSession"]

BEAT_S = 0.05
"""Interval between heartbeat numbers sent to the page in control, in seconds. Each tick from the
page contains the newest number that the page has received."""
THINNED_S = 0.01
"""Minimum mean interval between a control's applied ticks, in seconds."""
PATIENCE_S = 0.25
"""Time after a control's motion in which refused late ticks are not reported, in seconds."""


Offered = Literal["in time", "one more", "no tick"]
"""Kind of a message: a tick within the rate limit, a tick above it, or any other message."""


class ControlService:
    """The motion controller of one robot and the sessions of its pages."""

    def __init__(
        self,
        driver: Driver,
        clock: Clock,
        file: LatchStore | None = None,
        recorder: AuditRecorder | None = None,
    ) -> None:
        """Restore the latch from `file`.

        The controls are the held commands of `driver`. The store `file` preserves the latch across
        restarts; None means that the latch is not stored. The `recorder` receives audit events;
        None means that no events are recorded.
        """
        self.recorder = recorder or AuditRecorder("", _unread, utc=lambda: 0.0)
        self.controller = self._controller(
            driver, file.load() if file is not None else Latch(LeaseState())
        )
        self._driver = driver
        self._roles = _roles(driver)
        self._has_roles = _has_roles(driver)
        self._clock = clock
        self._file = file
        self._hub: Hub | None = None
        self._operators: dict[str, OperatorSession] = {}
        self._peers = 0
        self._number = 0
        """Number of the newest lease."""
        self._beating: Timer | None = None
        self._expiring: Timer | None = None
        self.once = OneShotCommands(driver, lambda: self.controller, clock, self.recorder)
        self.watch = LoopWatchdog(clock, self._held_up)
        """Detects a blocked event loop while the robot is connected."""
        self._heed(file)

    @property
    def operators(self) -> tuple[OperatorSession, ...]:
        """The sessions of all the robot's pages."""
        return tuple(self._operators.values())

    @property
    def images(self) -> ImageInterlock:
        """The images that the held commands require."""
        return self.controller.images

    @property
    def commands(self) -> tuple[str, ...]:
        """Names of all held commands."""
        return tuple(name for name, one in self._driver.commands.items() if one.hold is not None)

    def renew(self, driver: Driver, file: LatchStore | None) -> None:
        """Switch to another version of the driver while no session is open.

        A latched STOP stays latched, and an unacknowledged STOP is still sent. All leases end, and
        all controls are disarmed.
        """
        kept = Latch(self.controller.lease.state, not self.controller.is_confirmed)
        for operator in self._operators.values():
            for command in list(operator.alarms):
                operator.forget(command)
            operator.paces.clear()
        self._driver, self._file, self._roles = driver, file, _roles(driver)
        self._has_roles = _has_roles(driver)
        self.once.driver = driver
        self._heed(file)
        due = self.controller.due
        self.controller = self._controller(driver, kept)
        self.controller.inherit(due)
        for operator in self._operators.values():
            self.controller.join(operator.client)
        self._changed(self.controller.lease.state)

    def _controller(self, driver: Driver, kept: Latch) -> MotionController:
        controller = MotionController(driver, kept=kept.state, is_owed=kept.is_owed)
        controller.on_change = self._changed
        controller.on_moved = self.recorder.moved
        controller.on_refused = self._refused
        return controller

    # -- sessions

    async def serve(self, session: Drivable) -> None:
        """Allow pages to drive the robot over a session until this task is cancelled."""
        if not self.controller.can_move:
            return
        self._hub = session.hub
        if self._file is not None and self._file.fault:
            self._latch_fault(self._file.fault)
        self.watch.start()
        self.controller.attach(session)
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self.once.serve(session))
                if session.backend is not None:
                    group.create_task(self._follow(session.backend))
        finally:
            self.watch.end()
            self._hub = None
            self.controller.detach()
            now = self._clock.now()
            for command in self.commands:  # no messages about these stops
                self.recorder.stopped(command, "the robot was disconnected", now)

    async def _follow(self, backend: MotionBackend) -> None:
        while True:
            for command, reason in await backend.stops():
                self._stopped(command, reason)

    # -- pages

    def add_page(self, peer: SocketPeer, wake: Callable[[], None]) -> OperatorSession:
        """Add a page; raise `UrcError` if the robot has too many pages.

        Args:
            peer: the person or program at the page.
            wake: callback that is called when new messages for the page are ready.
        """
        self._peers += 1
        who = peer.identity
        name = f"screen {self._peers}{f' at {peer.place}' if peer.place else ''}"
        if peer.is_known and not peer.is_local:
            name = who.name
        visit = f"/{who.visit}" if who.visit else ""
        client = Operator(
            f"s{self._peers}{visit}",
            name,
            peer.rights.role(),
            who=who.name,
            principal=who.principal,
            person=who.person,
            way="key" if peer.is_local else who.way,
            place=peer.place,
            kind=who.kind,
            limit=peer.rights.limit(),
        )
        operator = OperatorSession(client, wake, peer.rights)
        self.controller.join(operator.client)
        self._operators[operator.client.id] = operator
        return operator

    def remove_page(self, operator: OperatorSession) -> None:
        """Remove a page and stop its held controls."""
        for command in list(operator.alarms):
            operator.forget(command)
        self._operators.pop(operator.client.id, None)
        if operator.spare is not None:
            operator.spare.end()
        self.controller.part(operator.client.id)

    def name_screen(self, operator: OperatorSession, name: str) -> None:
        """Set the screen name of a page on this computer or of a visitor without a sign-in.

        Signed-in people, devices and programs keep the names of their sign-ins. If another page
        already has the name, the screen number is appended, so that no page can impersonate
        another.
        """
        client = operator.client
        if client.who and client.way != "key":
            return
        wanted = printable(" ".join(name.split()))
        others = (one.client for one in self._operators.values() if one is not operator)
        if any(wanted in (one.name, one.who) for one in others):
            wanted = f"{wanted} ({operator.own_name})"
        operator.client = client._replace(name=wanted or operator.own_name)
        self.controller.change(operator.client)
        operator.seen = -1  # the lease message contains the page's name
        operator.wake()

    def recheck(self, operator: OperatorSession) -> None:
        """Check an operator's rights again and stop held commands that are no longer permitted."""
        role = operator.rights.role()
        if role == operator.client.role:
            return
        limit = operator.rights.limit()
        operator.client = operator.client._replace(role=role, limit=limit)
        if limit:
            operator.notice("tick", wire.encode_refused("tick", "", limit))
        for command, needed in self._roles.items():
            if not includes(role, needed):
                operator.forget(command)
                self.controller.release(operator.client.id, command)
        self.controller.change(operator.client)
        for report in tuple(operator.on_role):
            report()
        operator.seen = -1  # the lease message contains the page's role
        operator.wake()

    def operator_of(self, key: str) -> OperatorSession | None:
        """Return the session of the page with the given key; None for an unknown key."""
        said = key.encode()
        return next(
            (one for one in self._operators.values() if compare_digest(one.key.encode(), said)),
            None,
        )

    def changes(self, operator: OperatorSession) -> list[str]:
        """Remove and return all pending messages for the page."""
        texts: list[str] = []
        # The lease message contains the page's role, on which its buttons depend.
        is_told = self.controller.can_move or self._has_roles
        is_told = is_told or not includes(operator.client.role, "drive")
        if is_told and operator.seen != self._number:
            operator.seen = self._number
            controller, now = self.controller, self._clock.now()
            is_certain = controller.is_certain
            left_s = controller.images.override_s(now)
            state = controller.lease.state
            texts.append(operator.lease(state, now, is_confirmed=is_certain, override_s=left_s))
        texts += operator.notices.values()
        operator.notices.clear()
        if operator.heartbeat is not None:
            link = self.controller.link(operator.client.id, self._clock.now())
            texts.append(wire.encode_beat(operator.heartbeat, link))
            operator.heartbeat = None
        return texts

    # -- messages from pages

    def offer(self, operator: OperatorSession, data: bytes) -> Offered:
        """Accept the raw bytes of a message that may be a tick; return the message's kind.

        Rights are checked when a tick is applied, in `_tick`.

        A new tick replaces a pending tick without being decoded. If too many ticks arrive, the
        socket is paused to save processor time.
        """
        if operator.alarms and operator.doubled is None:
            command = wire.command_of(data)
            if command in operator.alarms:
                self._wait(operator, command, data)
                operator.crowd += 1
                if operator.crowd == FLOOD:
                    operator.hold_back(True)
                return "one more"
        now = self._clock.now()
        try:
            tick = wire.decode_tick(data)
        except wire.NO_TICK:
            return "no tick"
        rate_limiter = operator.paces.get(tick.command)
        is_moving = now - operator.moved_at_s < PATIENCE_S and not operator.alarms
        if (
            is_moving
            and not operator.doubled
            and rate_limiter is not None
            and rate_limiter.allow(now)
        ):
            self._tick(operator, tick, now)
            return "in time"
        self._thin(operator, tick)
        return "one more"

    def handle(self, operator: OperatorSession, said: wire.Driving) -> None:
        """Handle a page's message about the controls."""
        self.recheck(operator)
        match said:
            case wire.Tick():
                self._thin(operator, said)
            case wire.Release():
                if self.controller.holds(said.command) and not operator.is_first(
                    said.command, said.number
                ):
                    return
                operator.forget(said.command)
                operator.moved_s.pop(said.command, None)
                self.controller.release(operator.client.id, said.command, said.number)
            case wire.Stop():
                if not operator.is_first("", said.number):
                    return
                self.stop(operator.client.name, operator.client)
            case wire.Drive():
                self._drive(operator, said)

    def stop(self, by: str, who: Operator | None = None, stop_id: str = "") -> None:
        """Stop the robot and latch STOP. A stop is never refused.

        Args:
            by: name of the person or page, shown on all pages.
            who: the person or page in the audit log; None for a stop by URC itself.
            stop_id: identifier of the STOP of several robots in the audit log; "" for one robot.
        """
        for operator in self._operators.values():
            for command in list(operator.alarms):
                operator.forget(command)
        with self.recorder.caused_by(who, stop_id):
            self.controller.stop(by)
        self.once.stopped()

    async def settle(self) -> None:
        """Wait until the latch has been stored, or storing has failed."""
        if self._file is not None:
            await self._file.settle()

    def _drive(self, operator: OperatorSession, said: wire.Drive) -> None:
        now = self._clock.now()
        reason = self._scope_refusal(operator, said.verb)
        if not reason:
            with self.recorder.caused_by(operator.client):
                reason = self.controller.drive(
                    operator.client.id, said.verb, now, said.for_s, said.stops
                )
        if reason:
            operator.notice(said.verb, wire.encode_refused(said.verb, "", reason))
            self.recorder.refused(operator.client, said.verb, reason, now)
        elif said.verb == "reset":
            self.once.reset()
        elif said.verb == "override":
            epoch, for_s = self.controller.lease.state.epoch, self.images.override_s(now)
            self.recorder.overrode(operator.client, epoch, for_s)
        self._set_expiry()

    def _scope_refusal(self, operator: OperatorSession, verb: wire.Verb) -> str:
        """Return why the token's command limit forbids a request; "" if it is permitted."""
        may_give = operator.rights.may_give
        if verb not in ("take", "ask", "force", "reset") or may_give(""):
            return ""
        if verb != "reset" and any(map(may_give, self.commands)):
            return ""
        return OUT_OF_SCOPE if verb != "reset" else "a token with command limits cannot reset STOP"

    def _thin(self, operator: OperatorSession, tick: wire.Tick) -> None:
        now = self._clock.now()
        if not self.controller.holds(tick.command):
            text = f"{tick.command!r} is not a held command of this robot"
            operator.notice("tick", wire.encode_refused("tick", "", text))
            self.recorder.refused(operator.client, tick.command, text, now)
            return
        if not operator.is_first(tick.command, tick.number):
            return
        rate_limiter = operator.paces.get(tick.command)
        if rate_limiter is None:
            rate_limiter = operator.paces[tick.command] = RateLimiter(THINNED_S)
        if tick.command in operator.alarms:
            self._wait(operator, tick.command, tick)
        elif rate_limiter.allow(now):
            self._tick(operator, tick, now)
        else:
            alarm = self._clock.call_at(
                rate_limiter.free_at, lambda: self._ripe(operator, tick.command)
            )
            operator.alarms[tick.command] = alarm
            self._wait(operator, tick.command, tick)

    def _wait(self, operator: OperatorSession, command: str, tick: wire.Tick | bytes) -> None:
        """Hold a tick until the rate limit permits it or a newer tick replaces it."""
        operator.dropped += command in operator.pending
        operator.pending[command] = tick

    def _ripe(self, operator: OperatorSession, command: str) -> None:
        operator.alarms.pop(command, None)
        operator.relax()
        tick = operator.pending.pop(command, None)
        if isinstance(tick, bytes):
            tick = self._read(operator, tick)
        if tick is not None:
            now = self._clock.now()
            operator.paces[command].allow(now)
            self._tick(operator, tick, now)

    def _read(self, operator: OperatorSession, data: bytes) -> wire.Tick | None:
        try:
            return wire.decode_tick(data)
        except wire.NO_TICK as fault:
            operator.notice("tick", wire.encode_refused("tick", "", str(fault)))
            return None

    def _tick(self, operator: OperatorSession, tick: wire.Tick, now: float) -> None:
        given = tuple.__new__(
            ControlInput, (tick.epoch, tick.number, tick.echo)
        )  # fast: called many times per second
        command = tick.command
        self.recheck(operator)
        reason = role_refusal(operator.client, self._roles.get(command, "drive"))
        if not reason and not operator.rights.may_give(command):
            reason = OUT_OF_SCOPE
        if not reason:
            age_s = self._image_age_s(operator, tick, now)
            reason = self.controller.tick(
                operator.client.id, command, tick.arguments, given, now, age_s
            )
        if not reason:
            operator.moved_s[command] = operator.moved_at_s = now
        elif now - operator.moved_s.get(command, float("-inf")) > PATIENCE_S or self._is_closed(
            given
        ):
            operator.notice(command, wire.encode_refused("tick", command, reason))
            self.recorder.refused(operator.client, command, reason, now)

    def _image_age_s(self, operator: OperatorSession, tick: wire.Tick, now: float) -> float:
        """Return the age of the image that the page shows of the command's signal."""
        signal = self.images.signal_of(tick.command)
        if not signal or tick.sees is None:
            return BLIND_S
        number, shown_ms = tick.sees
        return operator.images.age_s(signal, SeenImage(number, shown_ms / 1000), now)

    def _is_closed(self, given: ControlInput) -> bool:
        return given.epoch != self.controller.lease.state.epoch

    # -- effects

    def _stopped(self, command: str, reason: StopReport) -> None:
        self.controller.stopped(command, reason)
        if reason == "lost":
            return  # the stop is written again, and then reported
        why = self.controller.why_short(command) if reason == "expired" else ""
        self.recorder.stopped(command, why or reason, self._clock.now())
        if reason in ("released", "stopped"):
            return  # the operator released the control, or the lease message reports the stop
        for operator in self._operators.values():
            operator.moved_s.pop(command, None)
            text = wire.encode_stopped(command, reason)
            if why:
                text = wire.encode_refused("tick", command, why)
            operator.notice(command, text)

    def _refused(self, command: str, why: str) -> None:
        """Tell every page why the robot refused the motion."""
        self.recorder.stopped(command, why, self._clock.now())
        for operator in self._operators.values():
            operator.forget(command)
            operator.moved_s.pop(command, None)
            operator.notice(command, wire.encode_refused("tick", command, why))

    def _heed(self, file: LatchStore | None) -> None:
        if file is not None:
            file.on_fault = self._latch_fault

    def _latch_fault(self, fault: str) -> None:
        """Report a failure to store the latched STOP, or the end of the failure."""
        if fault:
            text = f"STOP works, but would not survive a restart of the server: {fault}"
            self._log("error", text)
            for operator in self._operators.values():
                operator.notice("latch", wire.encode_refused("latch", "", text))
        else:
            self._log("info", "STOP is stored again and survives a restart of the server")

    def _held_up(self, late_s: float, is_first: bool) -> None:
        if late_s > TOO_LATE_S:
            now = self._clock.now()
            for command in self.controller.halt():
                self.recorder.stopped(command, "the server was blocked", now)
                for operator in self._operators.values():
                    operator.forget(command)
                    operator.moved_s.pop(command, None)
                    operator.notice(command, wire.encode_stopped(command, "expired"))
        is_warning = late_s > TOO_LATE_S
        if is_first or is_warning:
            level: Literal["info", "warning"] = "warning" if is_warning else "info"
            self._log(level, f"the server was blocked for {late_s * 1000:.0f} ms")

    def _log(self, level: Literal["info", "warning", "error"], text: str) -> None:
        if self._hub is not None:
            self._hub.log(LogEntry(self._clock.now(), level, "URC", text))

    def _changed(self, state: LeaseState) -> None:
        self._number += 1
        if self._file is not None:
            self._file.save(Latch(state, not self.controller.is_confirmed))
        for operator in self._operators.values():
            operator.wake()
        self.recorder.leased(state, self._clock.now())
        self._set_expiry()
        if state.holder is not None and self._beating is None:
            self._heartbeat()

    def _heartbeat(self) -> None:
        """Send a heartbeat number to the page in control and schedule the next heartbeat."""
        self._beating = None
        holder = self.controller.lease.state.holder
        operator = self._operators.get(holder.id) if holder is not None else None
        if operator is None:
            return
        now = self._clock.now()
        operator.heartbeat = self.controller.heartbeat(operator.client.id, now)
        if operator.spare is not None:
            operator.spare.heartbeat(
                operator.heartbeat, self.controller.link(operator.client.id, now)
            )
        operator.wake()
        self._beating = self._clock.call_at(now + BEAT_S, self._heartbeat)

    def _set_expiry(self) -> None:
        if self._expiring is not None:
            self._expiring.cancel()
        due = self.controller.deadline
        self._expiring = None if due is None else self._clock.call_at(due, self._expire)

    def _expire(self) -> None:
        self._expiring = None
        self.controller.expire(self._clock.now())
        self._set_expiry()


def _roles(driver: Driver) -> dict[str, Role]:
    """Return the role required for each held command, keyed by command name."""
    return {name: one.role for name, one in driver.commands.items() if one.hold is not None}


def _has_roles(driver: Driver) -> bool:
    """Return whether any command needs a role other than ``drive``."""
    return any(one.role != "drive" for one in driver.commands.values())


def _unread(entry: AuditEntry) -> None:
    """Ignore the entry, because this robot has no audit log."""
