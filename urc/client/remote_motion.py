"""The controls of a server's robot: the lease, heartbeats, ticks and STOP.

Layer 5. Each tick contains the lease epoch, the tick's number, and the server's newest heartbeat,
so that the server can refuse late and repeated ticks. If the connection is lost, motion never
resumes: every stick ends, and the server stops the robot.
"""

import asyncio
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Final

from urc.client.program_controls import ProgramControls
from urc.client.robot_socket import RobotSocket
from urc.client.stick import MotionEnded
from urc.model.values import Reading
from urc.motion.freshness import OLDEST_S
from urc.problems import UrcError
from urc.runtime.command_failed import CommandFailed
from urc.wire.client_messages import Arguments, Drive, Release, Stop, Tick, Verb
from urc.wire.server_messages import (
    HeartbeatMessage,
    LeaseMessage,
    RefusedMessage,
    StoppedMessage,
)

__all__ = ["ControlMessage", "RemoteMotion", "plain_arguments"]

ControlMessage = LeaseMessage | HeartbeatMessage | StoppedMessage | RefusedMessage
"""Messages from the server about the lease, heartbeats and stops."""
_ASK_S: Final = 2.0
"""Maximum wait for the answer to a request about the controls, in seconds."""
STOP_AGAIN_S: Final = 0.3
"""Server silence after which STOP is also sent over HTTP, in seconds."""
_CONFIRM_S: Final = 2.0
_CONNECT_S: Final = 10.0
"""Maximum wait for the robot's first connection, in seconds."""
_CUT: Final = "the connection to the server was lost"


class RemoteMotion(ProgramControls):
    """Takes, keeps and releases the controls of a server's robot."""

    def __init__(self, socket: RobotSocket) -> None:
        """Prepare the controls."""
        super().__init__()
        self.names: tuple[str, ...] = ()
        """Names of the held commands, from the server's first message."""
        self.lease: LeaseMessage | None = None
        """Newest lease; None before the first lease, and for a robot without motion."""
        self.is_connecting: Callable[[], bool] = lambda: False
        """Function that returns whether the server's first connection to the robot is pending."""
        self._socket = socket
        self._beat = 0
        self._beat_s = 0.0
        self._number = 0
        self._epochs: dict[str, int] = {}
        self._refusals: dict[str, str] = {}
        self._changed = asyncio.Event()

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands."""
        return self.names

    @property
    def stops(self) -> int | None:
        """Number of STOPs that this program knows of; None before the first lease."""
        return self.lease.stops if self.lease is not None else None

    # -- messages

    def handle(self, message: ControlMessage) -> None:
        """Process a message from the server about the lease, heartbeats or stops."""
        match message:
            case LeaseMessage():
                self.lease = message
                if not _is_ours(message):
                    self._beat = 0
                self._end_outdated(message)
            case HeartbeatMessage(n):
                self._beat, self._beat_s = n, time.monotonic()
            case StoppedMessage(command, reason):
                self.stopped(command, reason)
            case RefusedMessage(about, text, command):
                if about == "tick":
                    self._end(command, text)
                else:
                    self._refusals[about] = text
        self.wake()

    def wake(self) -> None:
        """Make waiting calls check their conditions again."""
        self._changed.set()

    def lost(self) -> None:
        """End all motion after the connection was lost."""
        self.end_all(_CUT)
        self.lease = None
        self._beat = 0
        self.wake()

    def _end_outdated(self, lease: LeaseMessage) -> None:
        """End the motion that the new lease does not permit."""
        if lease.latched:
            self.end_all(f"stopped by {lease.latched}")
            return
        for command, stick in self.sticks.items():
            if command not in self._epochs:
                continue  # the stick is still taking the controls
            if not _is_ours(lease):
                stick.end(_taken(lease))
            elif lease.epoch != self._epochs[command]:
                stick.end("a newer lease replaced this stick's lease")

    def _end(self, command: str, reason: str) -> None:
        for name, stick in self.sticks.items():
            if command in ("", name):
                stick.end(reason)

    # -- motion

    async def take(self, command: str) -> None:
        """Take the controls, and wait for the robot and for the first heartbeat."""
        # The server connects to the robot for its first client, which takes a moment.
        await self._until(lambda: not self.is_connecting(), _CONNECT_S)
        lease = self.lease
        is_shared = bool(self._epochs) and lease is not None and _is_ours(lease)
        if not is_shared:
            before = lease.epoch if lease is not None else -1
            self._beat = 0
            refusal = await self._ask("take", lambda: self._is_granted(before))
            if refusal:
                raise MotionEnded(refusal)
        if self.lease is None:
            raise MotionEnded(_CUT)
        self._socket.send(Release(command))  # a new gesture, even after a stop
        self._epochs[command] = self.lease.epoch

    def _is_granted(self, before: int) -> bool:
        lease = self.lease
        return bool(self._beat) and lease is not None and _is_ours(lease) and lease.epoch > before

    def tick(self, command: str, arguments: Mapping[str, Reading]) -> str:
        """Send one tick, unless the lease or the heartbeats forbid it."""
        lease = self.lease
        if lease is None or not self._socket.is_up:
            return _CUT
        if not _is_ours(lease):
            return _taken(lease)
        silent_s = time.monotonic() - self._beat_s
        if silent_s > OLDEST_S:
            return f"the server has sent no heartbeat for {silent_s * 1000:.0f} ms"
        try:
            plain = plain_arguments(arguments)
        except UrcError as error:
            return str(error)
        self._number += 1
        tick = Tick(command, self._epochs[command], self._number, self._beat, plain)
        self._socket.offer_tick(command, tick)
        return ""

    def release(self, command: str) -> None:
        """Send the release, and drop a waiting tick."""
        self._socket.drop_tick(command)
        if command in self._epochs:
            self._socket.send(Release(command))

    async def leave(self, command: str) -> None:
        """Release the controls after the last stick, and wait for the server."""
        self._epochs.pop(command, None)
        lease = self.lease
        if self._epochs or lease is None or not _is_ours(lease):
            return
        refusal = await self._ask("leave", lambda: not _is_ours(self.lease))
        if refusal and self.lease is not None:
            # The server stops a robot whose socket has closed.
            self._socket.abort()
            raise MotionEnded(f"the server did not confirm the stop: {refusal}")

    # -- STOP

    async def stop(self) -> bool | None:
        """Send STOP; return whether the robot accepted it, or None if the server is silent."""
        before = self.lease
        if not self._socket.send(Stop()):
            return None

        def is_latched() -> bool:
            lease = self.lease
            return lease is not None and bool(lease.latched) and lease is not before

        if not await self._until(is_latched, STOP_AGAIN_S):
            return None
        await self._until(lambda: self.lease is None or self.lease.confirmed, _CONFIRM_S)
        return self.lease is not None and self.lease.confirmed

    async def reset(self) -> None:
        """Reset STOP; return at once if STOP is not latched.

        Raises:
            CommandFailed: the reset was refused.
        """
        if self.lease is None or not self.lease.latched:
            return
        refusal = await self._ask("reset", lambda: self.lease is None or not self.lease.latched)
        if refusal:
            raise CommandFailed("refused", refusal)

    # -- requests

    async def _ask(self, verb: Verb, is_done: Callable[[], bool]) -> str:
        """Send a request about the controls; return the reason for a failure, or ""."""
        self._refusals.pop(verb, None)
        stops = self.lease.stops if verb == "reset" and self.lease is not None else None
        if not self._socket.send(Drive(verb, stops=stops)):
            return _CUT

        def is_over() -> bool:
            return is_done() or verb in self._refusals or not self._socket.is_up

        if not await self._until(is_over, _ASK_S):
            return f"the server did not answer within {_ASK_S:g} s"
        if is_done():
            return ""
        return self._refusals.pop(verb, _CUT)

    async def _until(self, is_true: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `is_true` returns True, or until the timeout; return its last result."""
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                while not is_true():
                    self._changed.clear()
                    await self._changed.wait()
        return is_true()


def plain_arguments(arguments: Mapping[str, Reading]) -> Arguments:
    """Return a held command's arguments as JSON values that the server accepts.

    Raises:
        UrcError: an argument is not a number, text, a boolean, None or a list of these.
    """
    return {name: _plain(name, value) for name, value in arguments.items()}


_Scalar = bool | int | float | str


def _plain(name: str, value: object) -> _Scalar | tuple[_Scalar, ...] | None:
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (list, tuple)):
        items = tuple(value)
        if all(isinstance(item, (bool, int, float, str)) for item in items):
            return items
    kind = type(value).__name__
    raise UrcError(f"{name}: expected a number, text, a boolean or a list of these, found {kind}")


def _is_ours(lease: LeaseMessage | None) -> bool:
    return lease is not None and lease.holder is not None and lease.holder.id == lease.you


def _taken(lease: LeaseMessage) -> str:
    if lease.latched:
        return f"stopped by {lease.latched}"
    if lease.holder is not None:
        return f"{lease.holder.name} has the controls"
    return lease.limit or "the server has withdrawn the controls"
