"""The motion controller of one robot: the lease, and the state of each held command.

Theory of operation. Pages send release messages, and ticks of sampled input. For each tick, the
controller checks the page's lease and the age of the tick, and the engine checks the arguments. The
controller then passes the frame to the motion backend, which owns the connection and enforces the
time limits. The age of an image may limit both; see `urc.motion.driving_lock`. The first tick of a
gesture arms the control. The first tick also renders the stop frame, so that a stop needs neither
the engine nor the document.

If a control stops without a release, it stays disarmed until its page sends a release. A stick that
is still held after a reconnection does not move the robot.

A controller outlives its robot's sessions, because the latch persists while the robot is
disconnected. `attach` connects the controller to a session's engine and backend; `detach`
disconnects it.

This module is synchronous: callers pass the current time. The backend reports each written stop by
calling `stopped`.
"""

from collections.abc import Callable, Mapping, Sequence

from urc.model.driver import Command, Driver
from urc.model.payload import CountedFrame, FrameVariants, Payload
from urc.model.role import includes
from urc.model.values import Reading
from urc.motion.driving_lock import BLIND_S, slowed
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import HoldTerms, StopReport
from urc.motion.lease import REQUEST_S, Lease, LeaseChanged, LeaseRefused, LeaseState, Operator
from urc.motion.link_age import LinkState
from urc.problems import UrcError
from urc.protocol.events import MotionEvent, MotionReady, MotionRefused, NumbersUsed
from urc.runtime.held_commands import (
    HeldControl,
    MotionBackend,
    MotionFrames,
    MotionSession,
    control_of,
    is_lossy,
    restored_s,
)
from urc.runtime.image_interlock import OLD_IMAGE, ImageInterlock, why_blind
from urc.runtime.motion_callbacks import Moved, unchanged, unrefused, unseen
from urc.runtime.motion_screen import SLOW_LINK, MotionScreen

__all__ = ["MotionFrames", "MotionController", "MotionBackend", "Verb", "is_lossy"]

Verb = str
"""A lease request: ``take``, ``ask``, ``yes``, ``no``, ``force``, ``leave``, ``reset``, or
``override``, which permits to drive without an image for a moment."""
MOST_SCREENS = 256
_NO_ROBOT = "the robot is not connected"
LET_GO = "Stopped: let go, then start again"
_CUT = "Lost contact while driving"
_TAKE_ANEW = "Stopped: take control again"


class MotionController:
    """The motion controller of one robot, with the lease and the held commands."""

    def __init__(
        self, driver: Driver, *, kept: LeaseState | None = None, is_owed: bool = False
    ) -> None:
        """Create a controller that has no operator and no session yet.

        Args:
            driver: the driver; commands with ``hold`` become controls.
            kept: the lease state from before a restart; a latched stop stays latched.
            is_owed: whether the last stop has not reached the robot and must be sent first.
        """
        self.lease = Lease(kept)
        self._frames: MotionFrames | None = None
        self._backend: MotionBackend | None = None
        self._holds = {name: one for name, one in driver.commands.items() if one.hold is not None}
        self._is_lossy = {
            name: is_lossy(driver, one.transport) for name, one in self._holds.items()
        }
        self._restored_s = {
            name: restored_s(driver, one.transport) for name, one in self._holds.items()
        }
        self._controls = {name: control_of(driver, one) for name, one in self._holds.items()}
        self._stops = tuple(name for name, one in driver.commands.items() if one.stops)
        self._moves = any(one.moves for one in driver.commands.values())
        self._screens: dict[str, MotionScreen] = {}
        self._unconfirmed = {*self._holds, *self._stops} if is_owed else set[str]()
        self._cancels = tuple(
            name for name in self._stops if _is_cancellation(driver.commands[name])
        )
        self._unanswered = set(self._cancels) if self.lease.latched else set[str]()
        """Delivered stop commands whose goals the robot may still follow."""
        self._due: set[str] = set()
        """Held commands whose stop must still be passed to a backend, or passed again because it
        was too early."""
        self.images = ImageInterlock(self._holds)
        self._ended: MotionBackend | None = None
        """Backend of the previous session; it may still deliver stops while that session ends."""
        self.on_change: Callable[[LeaseState], None] = unchanged
        """Callback after each change to the lease and after each confirmed stop."""
        self.on_moved: Moved = unseen
        """Callback for each tick that is passed to the backend; it must neither block nor raise an
        exception."""
        self.on_refused: Callable[[str, str], None] = unrefused
        """Callback that receives the control and the message when the robot refuses to move."""

    @property
    def can_move(self) -> bool:
        """Whether the robot has a held command, autonomous motion, or a stop command."""
        return bool(self._holds) or self._moves or bool(self._stops)

    @property
    def has_own_stop(self) -> bool:
        """Whether STOP sends frames to the robot; if false, STOP only blocks URC's commands."""
        return bool(self._holds) or bool(self._stops)

    @property
    def owed(self) -> list[str]:
        """Return the stop commands that must still be sent."""
        return [name for name in self._stops if name in self._unconfirmed]

    def given(self, command: str) -> None:
        """Record that a stop command, or the stop of a held command, has reached the robot."""
        if command in self._unconfirmed:
            self._unconfirmed.discard(command)
            if self.is_confirmed:
                self.on_change(self.lease.state)

    def await_answer(self, command: str) -> None:
        """Record that a stop command cancels goals, and that the robot has not answered yet."""
        self._unanswered.add(command)

    def answered(self, command: str) -> None:
        """Record that the robot has answered the cancellation of goals by a stop command."""
        if command in self._unanswered:
            self._unanswered.discard(command)
            if self.is_certain:
                self.on_change(self.lease.state)

    def owe_unanswered(self, commands: Sequence[str] | None = None) -> None:
        """Send unanswered stop commands of a latched STOP again; None means all of them."""
        if self.lease.latched:
            names = self._unanswered if commands is None else self._unanswered & set(commands)
            self._unconfirmed |= names

    def holds(self, command: str) -> bool:
        """Return whether `command` is a held command."""
        return command in self._holds

    def why_short(self, command: str) -> str:
        """Return why an old image or a slow link ended a motion; "" if neither did."""
        control = self._controls.get(command)
        if control is None or not control.needs_release:
            return ""
        return control.why if control.why in (OLD_IMAGE, SLOW_LINK) else ""

    def rests(self, command: str) -> bool:
        """Return whether a held command is at rest and its last stop was reported as written."""
        return self._controls[command].motion_state == "rest"

    @property
    def is_confirmed(self) -> bool:
        """Whether the last stop is confirmed: all its frames written and its commands delivered."""
        return not self._unconfirmed

    @property
    def is_unanswered(self) -> bool:
        """Whether the robot may still follow goals that the last stop cancels."""
        return bool(self._unanswered)

    @property
    def is_certain(self) -> bool:
        """Whether the last stop is confirmed, and the robot has answered all cancelled goals."""
        return not self._unconfirmed and not self._unanswered and self.has_own_stop

    @property
    def is_stop_due(self) -> bool:
        """Whether a STOP or the stop of a held command has not reached the robot yet."""
        backend = self._backend
        is_owing = backend is not None and any(map(backend.owes_stop, self._holds))
        is_early = any(control.is_owed_again for control in self._controls.values())
        return bool(self._unconfirmed or self.due) or is_owing or is_early

    @property
    def due(self) -> list[str]:
        """Held commands whose stops have not been delivered in any session."""
        ended = self._ended
        return [
            name
            for name in self._holds
            if name in self._due or (ended is not None and ended.owes_stop(name))
        ]

    def inherit(self, due: Sequence[str]) -> None:
        """Take over the undelivered stops of another version of the driver."""
        self._due.update(name for name in due if name in self._holds)

    @property
    def deadline(self) -> float | None:
        """Time of the next call to `expire`; None if no call is needed."""
        return self.lease.deadline

    # -- the robot

    def attach(self, session: MotionSession) -> None:
        """Attach a session: its engine, backend and events.

        If a stop is outstanding, it is sent immediately.
        """
        self._frames, self._backend = session.frames, session.backend
        session.on_motion = self.handle
        backend = self._backend
        due = self.due
        if not self._unconfirmed.isdisjoint(self._holds):
            due = list(self._holds)
        self._due, self._ended = set(due), None
        if backend is not None and due:
            frames = self._stop_frames(due)
            backend.stop(frames)
            self._due.difference_update(frames)

    def detach(self) -> None:
        """Detach the session: the backend stops all motion, and every control is disarmed.

        Stops that have not reached the robot are sent first in the next session.
        """
        self._due.update(name for name, one in self._controls.items() if one.is_owed_again)
        self._ended = self._backend
        self._frames = self._backend = None
        for control in self._controls.values():
            control.is_owed_again = False
            if control.is_armed:
                self._close(control)

    # -- pages

    def join(self, client: Operator) -> None:
        """Add a page; raise `UrcError` if the maximum number of pages is reached."""
        if len(self._screens) >= MOST_SCREENS:
            raise UrcError(f"{MOST_SCREENS} pages already show this robot")
        self._screens[client.id] = MotionScreen(client)

    def change(self, client: Operator) -> None:
        """Replace a page's rights; if it may no longer drive, its lease and its motion end."""
        screen = self._screens.get(client.id)
        if screen is None:
            return
        screen.client = client
        if not includes(client.role, "drive"):
            self._settle(self.lease.leave(client.id))

    def part(self, client: str) -> None:
        """Remove a page and stop the commands that the page held."""
        self._screens.pop(client, None)
        self._settle(self.lease.leave(client))

    def heartbeat(self, client: str, now: float) -> int:
        """Return the number of a new heartbeat, which the page echoes in its inputs."""
        return self._screens[client].freshness.issue(now)

    def link(self, client: str, now: float) -> LinkState | None:
        """Return the link of a page of another site; None without recent ticks or such a link."""
        link = self._screens[client].freshness.link
        return None if link is None else link.state(now)

    # -- the lease

    def drive(
        self,
        client: str,
        verb: Verb,
        now: float,
        for_s: float = REQUEST_S,
        stops: int | None = None,
    ) -> str:
        """Apply a page's lease request; return the reason for a refusal, or "".

        `stops` is the number of STOPs that the page knew of at a reset; see `Lease.reset`.
        """
        who, lease = self._screens[client].client, self.lease
        if verb == "take":
            outcome: LeaseChanged | LeaseRefused | None = lease.acquire(who, now)
        elif verb == "ask":
            outcome = lease.request(who, now, for_s)
        elif verb in ("yes", "no"):
            outcome = lease.answer(client, now, is_granted=verb == "yes")
        elif verb == "force":
            outcome = lease.force(who, now)
        elif verb == "leave":
            outcome = lease.leave(client)
        elif verb == "reset":
            outcome = lease.reset(who, stops)
        elif verb == "override":
            refusal = lease.refusal(client, lease.state.epoch)
            refusal = refusal or self.images.override(client, for_s, now)
            outcome = LeaseRefused(refusal) if refusal else LeaseChanged(lease.state, False)
        else:
            return f"unknown lease request {verb!r}"
        if isinstance(outcome, LeaseRefused):
            return outcome.message
        self._settle(outcome)
        return ""

    def stop(self, by: str) -> None:
        """Stop the robot and latch the stop, regardless of the lease."""
        self._unconfirmed = {*self._holds, *self._stops}
        self._unanswered.clear()
        if self._backend is not None:
            self._backend.stop(self._stop_frames(self._holds))
        self._settle(self.lease.stop(by), is_stopped=True)

    def halt(self) -> list[str]:
        """Stop all motion; new motion requires a new gesture and a new lease.

        Controls that the backend has already stopped receive no second stop.

        Returns:
            The commands that may have moved the robot.
        """
        halted = self._moving()
        for name in halted:
            control = self._controls[name]
            self._let_go(name, control)
            self._close(control)
        return halted

    def _moving(self) -> list[str]:
        """Return the commands that have had a tick since their last reported stop."""
        controls = self._controls.items()
        return [name for name, one in controls if one.is_armed and one.motion_state != "rest"]

    def expire(self, now: float) -> None:
        """Apply the lease's timeouts."""
        self._settle(self.lease.expire(now))

    # -- motion

    def tick(
        self,
        client: str,
        command: str,
        arguments: Mapping[str, Reading],
        given: ControlInput,
        now: float,
        age_s: float = BLIND_S,
    ) -> str:
        """Handle a tick of sampled input; return the reason for a refusal, or "".

        `age_s` is the age of the image on the page. Only commands that require an image use it.
        """
        control, screen = self._controls.get(command), self._screens.get(client)
        if control is None or screen is None:
            return f"{command!r} is not a held command of this robot"
        epoch = self.lease.state.epoch
        refusal = self.lease.refusal(client, given.epoch) or screen.freshness.refusal(
            given, epoch, now, command
        )
        if refusal:
            return refusal
        if control.needs_release or epoch <= control.closed_epoch:
            return control.why if control.needs_release else _TAKE_ANEW
        frames, backend = self._frames, self._backend
        if frames is None or backend is None:
            return _NO_ROBOT
        seen = self.images.permit(command, client, age_s, now)
        if seen is not None and seen.for_s <= 0:
            return self._end_blind(command, control, backend, age_s)
        permit, control.short_of = screen.limit(seen, control.hold.lease_s)
        if permit is not None:
            arguments = slowed(arguments, control.rests, permit.share)
        if control.slew is not None:
            arguments = control.limited(arguments, now)
        try:
            data = frames.motion_frame(command, arguments, now)
            if not control.is_armed or self._is_disarmed_at_rest(command, control, backend):
                backend.arm(command, self._terms(command, frames))
                control.is_armed, control.is_lasting = True, frames.is_lasting(command)
            elif not control.is_lasting:
                self._renew_stops(control.line)
        except UrcError as error:
            self._abandon(command, control, backend, str(error))
            return str(error)
        self.lease.touch(now)
        control.motion_state = "moving"
        if permit is None:
            backend.tick(command, data)
        else:
            backend.tick(command, data, permit.for_s)
        if data == b"":
            return ""  # it is waiting for the robot's reply
        shown = data.numbered.data if isinstance(data, CountedFrame) else data
        self.on_moved(screen.client, epoch, command, arguments, shown, now)
        return ""

    def _end_blind(
        self, command: str, control: HeldControl, backend: MotionBackend, age_s: float
    ) -> str:
        """End a motion, or refuse to begin it, because the page shows no current image."""
        is_moving = control.motion_state == "moving"
        why = why_blind(age_s, is_moving=is_moving)
        self._abandon(command, control, backend, why)
        if is_moving:
            self.on_refused(command, why)
        return why

    def _is_disarmed_at_rest(
        self, command: str, control: HeldControl, backend: MotionBackend
    ) -> bool:
        """Return whether the control is at rest but disarmed, as after a lost connection.

        A control that was moving is not armed again: its motion must not resume.
        """
        return control.motion_state == "rest" and not backend.is_armed(command)

    def _abandon(
        self, command: str, control: HeldControl, backend: MotionBackend, why: str
    ) -> None:
        """End a motion because its frame cannot be rendered."""
        if control.is_armed:
            backend.release(command)
        self._close(control, why)

    def release(self, client: str, command: str, number: int = 0) -> None:
        """Handle the release of a control; only its holder may release it.

        `number` is the number of the release, or 0 if the release has no number. Ticks with lower
        numbers are then ignored.
        """
        holder = self.lease.state.holder
        control = self._controls.get(command)
        if control is None or holder is None or holder.id != client:
            return
        if number:
            self._screens[client].freshness.release(number, command)
        control.needs_release = False
        if control.motion_state == "moving":
            control.motion_state = "ending"
        self._let_go(command, control)

    def _let_go(self, command: str, control: HeldControl) -> None:
        control.rest()
        if control.is_armed and self._backend is not None:
            self._backend.release(command)
            self._renew_stops(control.line)  # the counter of this stop frame is used up

    def handle(self, event: MotionEvent) -> None:
        """Handle an engine event about a held command."""
        match event:
            case NumbersUsed(line):
                self._renew_stops(line)
            case MotionReady(line):
                self._repeat_stops(line)
            case MotionRefused(_, command, why):
                self._refused(command, why)

    def _refused(self, command: str, why: str) -> None:
        """Stop a motion that the robot has refused and report the robot's message."""
        control, backend = self._controls.get(command), self._backend
        if control is None or backend is None or control.motion_state != "moving":
            return
        self._abandon(command, control, backend, why)
        self.on_refused(command, why)

    def stopped(self, command: str, reason: StopReport) -> None:
        """Handle the backend's report that the stop of a control was written or lost."""
        control = self._controls.get(command)
        if control is None:
            return
        if reason == "lost":
            self._lose_stop(command, control)
            return
        if control.motion_state == "ending":  # otherwise, it is already moving again
            control.motion_state = "rest"
        if reason not in ("released", "stopped"):
            late = control.short_of if reason == "expired" and control.short_of else LET_GO
            self._close(control, _CUT if reason == "revoked" else late)
        if self._is_too_early(command, control):
            control.is_owed_again = True
            return
        if reason != "released":
            self.given(command)

    def _lose_stop(self, command: str, control: HeldControl) -> None:
        """Record that a written stop may not have reached the robot; the backend writes it again.

        A latched STOP is then no longer confirmed.
        """
        if control.motion_state == "rest":
            control.motion_state = "ending"
        if self.lease.latched:
            self._unconfirmed.add(command)
            self.on_change(self.lease.state)

    # -- renewed stops

    def _is_too_early(self, command: str, control: HeldControl) -> bool:
        """Return whether a written stop may have had no effect, because the robot was not ready."""
        frames, backend = self._frames, self._backend
        if frames is None or backend is None:
            return False
        if not control.needs_ready_line and frames.is_lasting(command):
            return False
        return not (backend.is_open(command) and frames.is_ready(command))

    def _repeat_stops(self, line: str) -> None:
        """Repeat stops that were sent before the connection steps of transport `line` were done."""
        owed = [
            name
            for name, control in self._controls.items()
            if control.line == line and control.is_owed_again
        ]
        for name in owed:
            self._controls[name].is_owed_again = False
        if owed and self._backend is not None:
            frames = self._stop_frames(owed)
            for name in owed:
                if self._controls[name].is_armed:
                    self._close(self._controls[name])  # the backend disarms it
            self._backend.stop(frames)
            self._due.difference_update(frames)

    def _renew_stops(self, line: str) -> None:
        """Render the stop frames of transport `line` again, with the next counter values."""
        frames, backend = self._frames, self._backend
        if frames is None or backend is None:
            return
        for name, control in self._controls.items():
            if control.line != line or frames.is_lasting(name) or frames.has_stops(name):
                continue
            if not (control.is_armed or backend.is_stopping(name)):
                continue
            try:
                stop = frames.stop_frame(name)
            except UrcError:
                continue  # the old stop is better than no stop
            if stop != control.stop:
                control.stop = stop
                backend.renew(name, stop)

    def _close(self, control: HeldControl, why: str = LET_GO) -> None:
        control.close(why, self.lease.state.epoch)

    def _terms(self, command: str, frames: MotionFrames) -> HoldTerms:
        control = self._controls[command]
        control.stop = stop = frames.stop_frame(command)
        terms = HoldTerms(
            b"",
            period_s=control.period_s,
            lease_s=control.hold.lease_s,
            is_lossy=self._is_lossy[command],
            restored_s=self._restored_s[command],
        )
        return terms.stopped_by(stop)

    def _settle(self, outcome: LeaseChanged | None, *, is_stopped: bool = False) -> None:
        if outcome is None:
            return
        self.images.lease_changed(outcome.state)
        if outcome.must_stop:
            if not is_stopped:
                self._stop_what_moves()
            for control in self._controls.values():
                control.is_armed = control.needs_release = False
                control.motion_state = "rest"
                control.rest()
        self.on_change(outcome.state)

    def _stop_what_moves(self) -> None:
        moving = self._moving()
        if moving and self._backend is not None:
            self._backend.stop(self._stop_frames(moving))

    def _stop_frames(
        self, commands: Sequence[str] | Mapping[str, object]
    ) -> dict[str, Payload | FrameVariants]:
        """Return each held command's stop frame.

        If rendering fails, use the frame that was rendered when the control was armed.
        """
        made: dict[str, Payload | FrameVariants] = {}
        for name in commands:
            control = self._controls[name]
            try:
                if self._frames is not None:
                    made[name] = self._frames.stop_frame(name)
            except UrcError:  # reported by `urc validate`
                if control.is_armed and control.stop is not None:
                    made[name] = control.stop  # rendered when it was armed
                else:
                    control.is_owed_again = True  # once the connection steps have read its values
        return made


def _is_cancellation(command: Command) -> bool:
    """Return whether a command cancels the goals of a ROS action."""
    return command.send.options.get("verb") == "cancel"
