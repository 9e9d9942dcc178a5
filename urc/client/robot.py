"""A robot's interface for Python programs, with the same behaviour in every opening.

Layer 5. `urc.connect` connects to a robot from this process, and `urc.client.open` uses a server's
robot. Both functions return this interface, so a change of one line switches a program between
them. The tests `tests/e2e/test_robot_interface.py` and `tests/e2e/test_robot_driving.py` run the
same test cases against both functions.
"""

from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Protocol

from urc.client.stick import VALID_S, Stick
from urc.model.values import Reading, Sample, Signal
from urc.problems import UrcError
from urc.runtime.hub import LinkState, LinkStatus, LogEntry

__all__ = ["AccessDenied", "ConnectionLost", "RobotInterface"]


class ConnectionLost(UrcError):
    """The server is unreachable, or has ended the connection permanently."""

    is_final = False
    """Whether every further attempt to connect would fail."""


class AccessDenied(ConnectionLost):
    """The server does not accept the token, or the token grants no rights to this robot."""


class RobotInterface(Protocol):
    """A robot for Python programs. Times are in seconds, on this process's monotonic clock."""

    @property
    def name(self) -> str:
        """Name of the robot's profile."""

    @property
    def signals(self) -> Mapping[str, Signal]:
        """All signals, by name."""

    @property
    def links(self) -> Mapping[str, LinkStatus]:
        """State of every transport, by name."""

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands, which `drive` accepts."""

    @property
    def operator(self) -> str:
        """Name of the page or program that has the controls; "" if they are free."""

    @property
    def latched_by(self) -> str:
        """Name of the person or program that latched STOP; "" while STOP is not latched."""

    def latest(self, name: str, /) -> Sample | None:
        """Return a signal's newest reading; None if there has been no reading.

        Raises:
            UrcError: the robot has no signal with this name.
        """

    def state(self, transport: str, /) -> LinkState:
        """Return a transport's state: ``idle``, ``connecting``, ``live``, ``silent`` or ``lost``.

        Raises:
            UrcError: the robot has no transport with this name.
        """

    async def wait_for(
        self,
        name: str,
        /,
        is_met: Callable[[Reading], bool] | None = None,
        *,
        timeout: float | None = None,
    ) -> Sample:
        """Return the first reading that meets the condition, which may be the current reading.

        Args:
            name: the signal's name.
            is_met: the condition; None for any reading.
            timeout: longest wait, in seconds; None for no limit.

        Raises:
            TimeoutError: the timeout has passed.
            UrcError: the robot has no signal with this name.
            ConnectionLost: the server has ended the connection permanently.
        """

    def watch(self, *names: str) -> AsyncIterator[Sample]:
        """Yield readings of the named signals, or of all signals, until the caller stops.

        The stream begins with the current readings. Only the newest reading of each signal is kept,
        so a slow program skips readings and never falls behind.

        Raises:
            UrcError: the robot has no signal with this name.
            ConnectionLost: the server has ended the connection permanently.
        """

    def log(self) -> AsyncIterator[LogEntry]:
        """Yield each new line of the robot's log, until the caller stops.

        A warning replaces lost lines and states their number.

        Raises:
            ConnectionLost: the server has ended the connection permanently.
        """

    async def command(self, name: str, /, **arguments: Reading) -> dict[str, Reading]:
        """Run a command and return the values in its reply.

        Calling a command that has ``confirm`` also confirms the command. A two-person command waits
        until a person at a dashboard approves it.

        Raises:
            CommandFailed: the command failed; the exception has a `code` and a message.
        """

    def drive(
        self, command: str = "", /, *, valid_s: float = VALID_S
    ) -> AbstractAsyncContextManager[Stick]:
        """Take the controls while the context is open, and return the stick of a held command.

        The robot stops when the context ends, for any reason. See `Stick`.

        Args:
            command: name of a held command; "" for the robot's only held command.
            valid_s: time for which one call to the stick moves the robot, 0.05 to 1 second.

        Raises:
            UrcError: the robot has no such held command, or `command` is "" and the robot has
                several.
            MotionEnded: the controls were refused, or motion ended before the context did.
        """

    async def stop(self) -> bool:
        """Stop the robot, and latch STOP. STOP does not require the controls and is never refused.

        Returns:
            Whether all of the robot's connections accepted the stop within two seconds.

        Raises:
            UrcError: the robot has no motion.
            ConnectionLost: the server could not be reached.
        """

    async def reset(self) -> None:
        """Reset a latched STOP; nothing moves before new input.

        Raises:
            CommandFailed: the reset was refused.
        """
