"""Robots without ``async``, for scripts, notebooks and consoles.

    from urc.client import sync

    with sync.open("https://robots.lab:8080", "cart", token_file="token") as robot:
        print(robot.wait_for("battery").value)
        with robot.drive() as stick:
            stick.hold(2.0, speed=0.3)

Layer 5. Each robot has its own daemon thread, which runs an event loop. Every call of a method has
a time limit. Leaving the context, an exception or Ctrl-C releases the stick first, so the robot
stops. A blocked program does not renew its input, so the robot also stops.
"""

import asyncio
import time
from collections.abc import (
    AsyncGenerator,
    AsyncIterator,
    Callable,
    Iterator,
    Mapping,
)
from contextlib import (
    AbstractAsyncContextManager,
    AbstractContextManager,
    contextmanager,
)
from functools import partial
from os import PathLike
from typing import Any, Final, TypeVar

from urc.client.loop_thread import LoopThread
from urc.client.remote_alarms import RemoteAlarms
from urc.client.robot import RobotInterface
from urc.client.stick import TICK_S, VALID_S, MotionEnded, Stick
from urc.model.profile import Profile
from urc.model.values import Reading, Sample, Signal, Value
from urc.problems import UrcError
from urc.runtime.hub import LinkState, LinkStatus, LogEntry
from urc.wire.server_messages import AlarmRow

__all__ = ["CALL_S", "SyncAlarms", "SyncRobot", "SyncStick", "connect", "open"]

CALL_S: Final = 30.0
"""Default time limit for one call, in seconds."""
_Result = TypeVar("_Result")


def connect(
    profile: Profile | str | PathLike[str], **settings: Value
) -> "AbstractContextManager[SyncRobot]":
    """Connect to a robot from this process while the context is open; see `urc.connect`."""
    from urc.client import local

    return _opened(lambda: local.connect(profile, **settings), CALL_S)


def open(
    server: str,
    robot: str = "",
    *,
    token: str = "",
    token_file: str | PathLike[str] | None = None,
    authority: str | PathLike[str] | None = None,
    allow_unencrypted: bool = False,
    timeout: float = CALL_S,
) -> "AbstractContextManager[SyncRobot]":
    """Open a server's robot while the context is active; see `urc.client.open`.

    `timeout` is the time limit for every call, in seconds.
    """
    from urc.client import remote

    return _opened(
        lambda: remote.open(
            server,
            robot,
            token=token,
            token_file=token_file,
            authority=authority,
            allow_unencrypted=allow_unencrypted,
            timeout=timeout,
        ),
        timeout,
    )


@contextmanager
def _opened(
    opening: Callable[[], AbstractAsyncContextManager[RobotInterface]], timeout_s: float
) -> "Iterator[SyncRobot]":
    thread = LoopThread(timeout_s)
    try:
        with thread.entered(opening) as robot:
            yield SyncRobot(robot, thread)
    finally:
        thread.close()


class SyncRobot:
    """A robot without ``async``, with the members of `urc.client.robot.RobotInterface`."""

    def __init__(self, robot: RobotInterface, thread: LoopThread) -> None:
        """Store the robot and its thread; programs call `open` or `connect` instead."""
        self._robot = robot
        self._thread = thread

    @property
    def name(self) -> str:
        """Name of the robot's profile."""
        return self._robot.name

    @property
    def signals(self) -> Mapping[str, Signal]:
        """All signals, by name."""
        return self._robot.signals

    @property
    def links(self) -> Mapping[str, LinkStatus]:
        """State of every transport, by name."""
        return self._here(lambda: dict(self._robot.links))

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands, which `drive` accepts."""
        return self._robot.controls

    @property
    def operator(self) -> str:
        """Name of the page or program that has the controls; "" if they are free."""
        return self._robot.operator

    @property
    def latched_by(self) -> str:
        """Name of the person or program that latched STOP; "" while STOP is not latched."""
        return self._robot.latched_by

    def latest(self, name: str, /) -> Sample | None:
        """Return a signal's newest reading; None if there has been no reading.

        Raises:
            UrcError: the robot has no signal with this name.
        """
        return self._here(lambda: self._robot.latest(name))

    def state(self, transport: str, /) -> LinkState:
        """Return a transport's state: ``idle``, ``connecting``, ``live``, ``silent`` or ``lost``.

        Raises:
            UrcError: the robot has no transport with this name.
        """
        return self._here(lambda: self._robot.state(transport))

    def wait_for(
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
            is_met: the condition, which runs in the robot's thread; None for any reading.
            timeout: longest wait, in seconds; None for the time limit that applies to every call.

        Raises:
            TimeoutError: the timeout has passed.
            UrcError: the robot has no signal with this name, or the connection has ended
                permanently.
        """
        return self._thread.call(self._robot.wait_for(name, is_met), timeout)

    def watch(self, *names: str, timeout: float | None = None) -> Iterator[Sample]:
        """Yield readings of the named signals, or of all signals, until the caller stops.

        `timeout` is the longest wait for the next reading, in seconds; None for the time limit that
        applies to every call.

        Raises:
            TimeoutError: no reading arrived in time.
            UrcError: the robot has no signal with this name, or the connection has ended
                permanently.
        """
        return self._steps(self._robot.watch(*names), timeout)

    def log(self, *, timeout: float | None = None) -> Iterator[LogEntry]:
        """Yield each new line of the robot's log, until the caller stops.

        Raises:
            TimeoutError: no line arrived in time.
            UrcError: the connection has ended permanently.
        """
        return self._steps(self._here(self._robot.log), timeout)

    def command(self, name: str, /, **arguments: Reading) -> dict[str, Reading]:
        """Run a command and return the values in its reply.

        Raises:
            CommandFailed: the command failed; the exception has a `code` and a message.
            TimeoutError: the call exceeded the time limit; the outcome is unknown.
        """
        return self._thread.call(self._robot.command(name, **arguments))

    @contextmanager
    def drive(self, command: str = "", /, *, valid_s: float = VALID_S) -> "Iterator[SyncStick]":
        """Take the controls while the context is open, and return the stick of a held command.

        The robot stops when the context ends, for any reason.

        Raises:
            UrcError: the robot has no such held command, or `command` is "" and the robot has
                several.
            MotionEnded: the controls were refused, or motion ended before the context did.
        """
        driving = partial(self._robot.drive, command, valid_s=valid_s)
        with self._thread.entered(driving) as stick:
            yield SyncStick(stick, self._thread.loop)

    def stop(self) -> bool:
        """Stop the robot, and latch STOP.

        Returns:
            Whether all of the robot's connections accepted the stop within two seconds.

        Raises:
            UrcError: the robot has no motion, or the server could not be reached.
        """
        return self._thread.call(self._robot.stop())

    def reset(self) -> None:
        """Reset a latched STOP; nothing moves before new input.

        Raises:
            CommandFailed: the reset was refused.
        """
        self._thread.call(self._robot.reset())

    @property
    def alarms(self) -> "SyncAlarms":
        """The robot's alarms; raise `UrcError` for a robot without a server."""
        found = getattr(self._robot, "alarms", None)
        if not isinstance(found, RemoteAlarms):
            raise UrcError("only a server lists alarms: use urc.client.sync.open")
        return SyncAlarms(found, self._thread)

    def _here(self, read: Callable[[], _Result]) -> _Result:
        """Call `read` in the thread of the event loop, and return its result."""

        async def call() -> _Result:
            return read()

        return self._thread.call(call())

    def _steps(self, found: AsyncIterator[_Result], timeout_s: float | None) -> Iterator[_Result]:
        async def step() -> tuple[_Result, ...]:
            async for one in found:
                return (one,)
            return ()

        try:
            while one := self._thread.call(step(), timeout_s):
                yield one[0]
        finally:
            if isinstance(found, AsyncGenerator):
                self._thread.call(_closed(found))


async def _closed(found: AsyncGenerator[Any, None]) -> None:
    await found.aclose()


class SyncAlarms:
    """The alarms of a server's robot; see `urc.client.remote_alarms.RemoteAlarms`."""

    def __init__(self, alarms: RemoteAlarms, thread: LoopThread) -> None:
        self._alarms = alarms
        self._thread = thread

    @property
    def active(self) -> tuple[AlarmRow, ...]:
        """Active alarms that are neither shelved nor suppressed, in first-out order."""
        return self._thread.call(self._read(lambda: self._alarms.active))

    @property
    def rows(self) -> dict[str, AlarmRow]:
        """All alarms that are not in the normal state, by signal."""
        return self._thread.call(self._read(lambda: dict(self._alarms.rows)))

    def acknowledge(self, *signals: str) -> tuple[str, ...]:
        """Acknowledge alarms that this program has received; without names, all pending alarms.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        return self._thread.call(self._alarms.acknowledge(*signals))

    def shelve(self, *signals: str, for_s: float) -> tuple[str, ...]:
        """Shelve alarms for a time in seconds, at most 24 hours; return the shelved signals.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        return self._thread.call(self._alarms.shelve(*signals, for_s=for_s))

    def unshelve(self, *signals: str) -> tuple[str, ...]:
        """Unshelve alarms; return the signals that were shelved.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        return self._thread.call(self._alarms.unshelve(*signals))

    @staticmethod
    async def _read(read: Callable[[], _Result]) -> _Result:
        return read()


class SyncStick:
    """The input of one held command, like `urc.client.stick.Stick`, for any thread."""

    def __init__(self, stick: Stick, loop: asyncio.AbstractEventLoop) -> None:
        """Store the stick; programs call `SyncRobot.drive` instead."""
        self._stick = stick
        self._loop = loop

    @property
    def command(self) -> str:
        """Name of the held command."""
        return self._stick.command

    @property
    def ended(self) -> str:
        """Reason why motion ended; "" while the stick can move the robot."""
        return self._stick.ended

    def __call__(self, /, **arguments: Reading) -> None:
        """Set the held command's arguments; missing arguments use their defaults.

        Raises:
            MotionEnded: motion has ended; the message states the reason.
        """
        self._stick.put(arguments)
        self._loop.call_soon_threadsafe(self._stick.wake)

    def hold(self, seconds: float, /, **arguments: Reading) -> None:
        """Keep the same arguments for the given time, then return.

        Raises:
            MotionEnded: motion ended before the time had passed.
        """
        ends_s = time.monotonic() + seconds
        while (left_s := ends_s - time.monotonic()) > 0:
            self(**arguments)
            time.sleep(min(TICK_S, left_s))
        if self.ended:
            raise MotionEnded(self.ended)

    def release(self) -> None:
        """Stop the robot and keep the controls; the next call to the stick moves the robot again.

        Raises:
            MotionEnded: motion has already ended.
        """
        if self.ended:
            raise MotionEnded(self.ended)
        self._stick.clear()
        self._loop.call_soon_threadsafe(self._stick.wake)
