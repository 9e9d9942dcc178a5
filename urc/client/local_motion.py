"""The controls of a robot that this process is connected to, under a server's rules.

Layer 5. A `urc.runtime.motion_controller.MotionController` checks each tick, and a guard process
writes the frames and the stops. Motion is refused while STOP is latched, or while an operator
drives the robot on one of this user's servers.
"""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Coroutine, Mapping
from contextlib import asynccontextmanager, suppress
from typing import Any, Final

from urc.client.program_controls import ProgramControls
from urc.client.stick import MotionEnded
from urc.model.values import Reading
from urc.motion.freshness import ControlInput
from urc.motion.lease import LeaseState, Operator
from urc.problems import UrcError
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.clock import LoopClock
from urc.runtime.command_failed import CommandFailed
from urc.runtime.held_commands import MotionBackend
from urc.runtime.motion_controller import MotionController
from urc.runtime.motion_interlock import MotionInterlock
from urc.runtime.one_shot_commands import OneShotCommands
from urc.runtime.scripted_hold import until_ready
from urc.runtime.session import Session

__all__ = ["LocalMotion"]

_US: Final = Operator("program", "this program", "administer")
_STILL_S: Final = 2.0
"""Maximum time for the transport to accept a stop, in seconds."""
_LOOK_S: Final = 0.01

log = logging.getLogger(__name__)


class LocalMotion(ProgramControls):
    """Takes and releases the controls of one robot that this process is connected to."""

    def __init__(self, session: Session) -> None:
        """Prepare the controls; the robot cannot move before the context `running` is active."""
        super().__init__()
        self._session = session
        self._clock = LoopClock()
        self._interlock: MotionInterlock | None = None
        self._number = 0
        driver = session.profile.driver
        self.controller = MotionController(driver)
        self.controller.on_change = self._changed
        self.controller.on_refused = self._refused
        self.controller.join(_US)
        recorder = AuditRecorder("", _unread, utc=time.time)
        self.once = OneShotCommands(driver, lambda: self.controller, self._clock, recorder)

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands."""
        commands = self._session.profile.driver.commands
        return tuple(name for name, one in commands.items() if one.hold is not None)

    @asynccontextmanager
    async def running(self, interlock: MotionInterlock) -> AsyncIterator[None]:
        """Allow the program to move the robot during the context, unless `interlock` refuses."""
        if not self.controller.can_move:
            yield
            return
        self._interlock = interlock
        await interlock.check()
        self.controller.attach(self._session)
        work: list[Coroutine[Any, Any, None]] = [
            self.once.serve(self._session),
            interlock.follow(self._interlocked),
        ]
        if self._session.backend is not None:
            work.append(self._follow(self._session.backend))
        tasks = [asyncio.create_task(one) for one in work]
        for task in tasks:
            task.add_done_callback(self._failed)
        self._interlocked(interlock.why)
        try:
            yield
        finally:
            self.end_all("the robot was disconnected")
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self.controller.detach()

    def admit(self, command: str, arguments: Mapping[str, Reading]) -> tuple[str, ...]:
        """Admit a command, and return the names of those who confirm it: only this program.

        Raises:
            CommandFailed: the command is a held command, or STOP refuses its motion.
        """
        self.once.admit(_US, command, arguments, None)
        return (_US.name,)

    # -- STOP

    async def stop(self) -> bool:
        """Stop the robot and latch STOP; return whether the robot accepted the stop within 2 s."""
        if not self.controller.can_move:
            raise UrcError("this robot has no motion to stop")
        self.controller.stop(_US.name)
        self.once.stopped()
        with suppress(TimeoutError):
            async with asyncio.timeout(_STILL_S):
                while not self.controller.is_confirmed:  # noqa: ASYNC110 - the guard reports it
                    await asyncio.sleep(_LOOK_S)
        return self.controller.is_confirmed

    def reset(self) -> None:
        """Reset this process's STOP."""
        if not self.controller.lease.state.latched_by:
            return
        if reason := self.controller.drive(_US.id, "reset", self._clock.now()):
            raise CommandFailed("refused", reason)
        self.once.reset()
        if self._interlock is not None and self._interlock.why:
            self._session.latch(self._interlock.why)

    # -- motion

    async def take(self, command: str) -> None:
        """Wait until the robot is ready, then take the controls."""
        backend = self._session.backend
        if backend is None or self._interlock is None:
            raise MotionEnded("the robot is not connected")
        try:
            await until_ready(self._session, backend, command)
        except CommandFailed as failed:
            raise MotionEnded(failed.message) from failed
        if why := await self._interlock.check():
            raise MotionEnded(why)
        reason = ""
        if self.controller.lease.state.holder is None:
            reason = self.controller.drive(_US.id, "take", self._clock.now())
        if reason:
            raise MotionEnded(reason)
        self.controller.release(_US.id, command)  # begin a new gesture, even after a stop

    def tick(self, command: str, arguments: Mapping[str, Reading]) -> str:
        """Pass one tick of a stick to the motion controller."""
        if self._interlock is not None and self._interlock.why:
            return self._interlock.why
        now = self._clock.now()
        self._number += 1
        epoch = self.controller.lease.state.epoch
        given = ControlInput(epoch, self._number, self.controller.heartbeat(_US.id, now))
        return self.controller.tick(_US.id, command, arguments, given, now)

    def release(self, command: str) -> None:
        """Release the control."""
        self.controller.release(_US.id, command)

    async def leave(self, command: str) -> None:
        """Wait until the stop is written; after the last stick, release the controls."""
        ends_s = self._clock.now() + _STILL_S
        try:
            while not self.controller.rests(command):
                if self._clock.now() >= ends_s:
                    raise MotionEnded(
                        f"the connection accepted no stop for {_STILL_S:g} s; the guard retries"
                    )
                await asyncio.sleep(_LOOK_S)
        finally:
            if self.sticks.keys() == {command}:
                self.controller.drive(_US.id, "leave", self._clock.now())

    # -- events

    async def _follow(self, backend: MotionBackend) -> None:
        while True:
            for command, reason in await backend.stops():
                self.controller.stopped(command, reason)
                if reason not in ("released", "stopped", "lost"):
                    self.stopped(command, reason)

    def _changed(self, state: LeaseState) -> None:
        if state.latched_by:
            self.end_all(f"stopped by {state.latched_by}")

    def _refused(self, command: str, why: str) -> None:
        if command in self.sticks:
            self.sticks[command].end(why)

    def _interlocked(self, why: str) -> None:
        """Refuse motion for the reason `why`; if `why` is "", allow motion again."""
        self._session.latch(why or self.controller.lease.latched)
        if why:
            self.end_all(why)

    def _failed(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (fault := task.exception()) is not None:
            log.error("a motion task failed; motion ends", exc_info=fault)
            self.end_all("a motion task failed")


def _unread(entry: AuditEntry) -> None:
    """Ignore the entry, because only a server has an audit log."""
