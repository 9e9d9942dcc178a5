"""The driving context, shared by both openings, with one stick for each held command.

Layer 5. The context takes the controls, samples its stick, and always ends with a release. The
release is sent before any wait, even after an exception or a cancellation.
"""

import asyncio
import time
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Final

from urc.client.stick import MotionEnded, Stick, checked_validity, sample_stick
from urc.model.values import Reading
from urc.problems import UrcError

__all__ = ["STOP_REASONS", "ProgramControls", "only_control"]

STOP_REASONS: Final[Mapping[str, str]] = {
    "released": "the control was released",
    "expired": "the input arrived too late",
    "stopped": "STOP was pressed",
    "revoked": "the connection to the robot was cut",
}
"""Text that explains why motion ended, for each `Reason` that the guard reports."""
_LEFT: Final = "the drive context has ended"


def only_control(controls: tuple[str, ...], command: str) -> str:
    """Return the held command `command`, or the only held command if `command` is "".

    Raises:
        UrcError: the robot has no such held command, or `command` is "" and the robot has several.
    """
    known = ", ".join(controls)
    if not controls:
        raise UrcError("this robot has no held command")
    if command and command not in controls:
        raise UrcError(f"{command!r} is not a held command; expected one of: {known}")
    if not command and len(controls) > 1:
        raise UrcError(f"the robot has several held commands; name one of: {known}")
    return command or controls[0]


class ProgramControls(ABC):
    """The sticks of one robot in this process; implements `urc.client.stick.MotionLine`."""

    def __init__(self) -> None:
        self.sticks: dict[str, Stick] = {}
        """Stick of each open `drive` context, by held command."""

    @property
    @abstractmethod
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands."""

    @abstractmethod
    def tick(self, command: str, arguments: Mapping[str, Reading]) -> str:
        """Send one tick; return the reason why motion must end, or "" if motion may continue."""

    @abstractmethod
    def release(self, command: str) -> None:
        """Stop the held command at once, without waiting for a confirmation."""

    @abstractmethod
    async def take(self, command: str) -> None:
        """Prepare a held command's motion; the first stick also takes the controls.

        Raises:
            MotionEnded: the controls were refused.
        """

    @abstractmethod
    async def leave(self, command: str) -> None:
        """Wait until a released command has stopped; the last stick also releases the controls.

        Raises:
            MotionEnded: the stop was not confirmed in time.
        """

    @asynccontextmanager
    async def drive(self, command: str, valid_s: float) -> AsyncIterator[Stick]:
        """Return the context of `urc.client.robot.RobotInterface.drive`."""
        name = only_control(self.controls, command)
        if name in self.sticks:
            raise UrcError(f"{name!r} already has a stick; exit its context first")
        stick = self.sticks[name] = Stick(name, checked_validity(valid_s))
        sampling: asyncio.Task[None] | None = None
        try:
            await self.take(name)
            sampling = asyncio.create_task(sample_stick(stick, self))
            yield stick
        finally:
            early = stick.ended
            stick.end(_LEFT)
            self.release(name)
            try:
                if sampling is not None:
                    sampling.cancel()
                    await asyncio.wait((sampling,))
                    await self.leave(name)
            finally:
                self.sticks.pop(name, None)
        if not sampling.cancelled() and (fault := sampling.exception()) is not None:
            raise fault
        if early:
            raise MotionEnded(early)

    def stopped(self, command: str, reason: str) -> None:
        """End a command's motion after the guard stopped it; if `command` is "", end all motion."""
        text = STOP_REASONS.get(reason, reason)
        for name, stick in self.sticks.items():
            if command not in ("", name):
                continue
            if reason == "expired":
                stick.expire(text, time.monotonic())
            else:
                stick.end(text)

    def end_all(self, reason: str) -> None:
        """End the motion of all sticks, for the same reason."""
        for stick in self.sticks.values():
            stick.end(reason)
