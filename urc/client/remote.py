"""Opens a server's robot: values, log, commands and motion over one WebSocket.

    import asyncio
    import urc.client

    async def main():
        async with urc.client.open("https://robots.lab:8080", "cart", token_file="token") as robot:
            async with robot.drive() as stick:
                await stick.hold(2.0, speed=0.3)

    asyncio.run(main())

Layer 5. A lost connection is reopened; motion never resumes automatically.
"""

import asyncio
import logging
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager, suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path
from ssl import SSLContext
from typing import Any, Final, Literal

from urc.client.address import ServerAddress, read_token, server_address, trust
from urc.client.decode import (
    decode_message,
    entry_of,
    links_of,
    progress_of,
    readings_of,
    samples_of,
    signals_of,
)
from urc.client.readings import HubReadings
from urc.client.remote_alarms import RemoteAlarms
from urc.client.remote_commands import RemoteCommands
from urc.client.remote_motion import ControlMessage, RemoteMotion, plain_arguments
from urc.client.robot import ConnectionLost
from urc.client.robot_socket import RobotSocket
from urc.client.server_request import post
from urc.client.stick import VALID_S, Stick
from urc.model.values import BINARY_TYPES, Reading, Sample, Signal
from urc.problems import UrcError
from urc.runtime.command_failed import CommandFailed
from urc.runtime.hub import Hub, LogEntry
from urc.wire.client_messages import (
    ImageSelection,
)
from urc.wire.picture import read_picture
from urc.wire.server_messages import (
    AlarmsMessage,
    ErrorMessage,
    HelloMessage,
    LinksMessage,
    LogMessage,
    ProgressMessage,
    ReplyMessage,
    TokenMessage,
    ValuesMessage,
)

__all__ = ["RemoteRobot", "open"]

_MOST_IMAGES: Final = 64
_GOODBYE_S: Final = 1.5
_LINKS_S: Final = 1.0
"""Maximum wait, in seconds, for the transports' state, which follows the first message."""

log = logging.getLogger(__name__)


@asynccontextmanager
async def open(
    server: str,
    robot: str = "",
    *,
    token: str = "",
    token_file: str | PathLike[str] | None = None,
    authority: str | PathLike[str] | None = None,
    allow_unencrypted: bool = False,
    timeout: float = 10.0,
) -> AsyncIterator["RemoteRobot"]:
    """Open a server's robot while the context is active; a lost connection is reopened.

    Args:
        server: address such as ``https://robots.lab:8080``.
        robot: the robot's name in its URL; "" for the server's only robot.
        token: this program's token; "" for none.
        token_file: file that contains the token; cannot be combined with `token`.
        authority: PEM file with the certificate of the server's local authority; None for the
            system's trust store. Certificates are always checked.
        allow_unencrypted: whether to send the token to another computer over plain HTTP, where
            others on the network can read it.
        timeout: longest duration of one attempt to connect, in seconds.

    Raises:
        UrcError: the address, the token or the authority cannot be used.
        AccessDenied: the server does not accept the token.
        ConnectionLost: the server cannot be reached, or has no such robot.
    """
    address = server_address(server, allow_unencrypted=allow_unencrypted)
    secret = read_token(token, None if token_file is None else Path(token_file))
    context = None
    if address.scheme == "https":
        context = trust(None if authority is None else Path(authority))
    socket = RobotSocket(address, robot, secret, context, timeout_s=timeout)
    opened = RemoteRobot(socket, address, robot, secret, context)
    running = asyncio.create_task(socket.run())
    running.add_done_callback(opened.over)
    try:
        await opened.until_ready(running, timeout)
        yield opened
    finally:
        opened.motion.end_all("the robot was closed")
        with suppress(TimeoutError):
            async with asyncio.timeout(_GOODBYE_S):
                await socket.close()
        running.cancel()
        await asyncio.wait((running,))


class RemoteRobot(HubReadings):
    """A server's robot; see `urc.client.robot.RobotInterface`."""

    def __init__(
        self,
        socket: RobotSocket,
        address: ServerAddress,
        robot: str,
        token: str,
        context: SSLContext | None,
    ) -> None:
        """Prepare the robot; programs call `open` instead of using this constructor."""
        super().__init__(Hub({}))
        self._robot = robot
        self.motion = RemoteMotion(socket)
        """The object that takes and releases the robot's controls for this program."""
        self.motion.is_connecting = self._is_connecting
        self.alarms = RemoteAlarms(self._post_alarms)
        """The robot's alarms, as listed by the server."""
        self._commands = RemoteCommands(socket)
        self._socket = socket
        self._address = address
        self._token = token
        self._context = context
        self._name = ""
        self._order: tuple[Signal, ...] = ()
        self._ready = asyncio.Event()
        self._linked = asyncio.Event()
        self._over: ConnectionLost | None = None
        self._session = ""
        self._next_line: int | None = None
        """Number of the next log line; None before the first line."""
        self._images: Counter[str] = Counter()
        socket.on_message = self._handle
        socket.on_lost = self._lost

    # -- the interface

    @property
    def name(self) -> str:
        """Name of the robot's profile."""
        return self._name

    @property
    def is_connected(self) -> bool:
        """Whether the connection to the server is open."""
        return self._socket.is_up

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands, which `drive` accepts."""
        return self.motion.controls

    @property
    def operator(self) -> str:
        """Name of the page or program that has the controls; "" if they are free."""
        lease = self.motion.lease
        return lease.holder.name if lease is not None and lease.holder is not None else ""

    @property
    def latched_by(self) -> str:
        """Name of the person or program that latched STOP; "" while STOP is not latched."""
        return self.motion.lease.latched if self.motion.lease is not None else ""

    async def command(self, name: str, /, **arguments: Reading) -> dict[str, Reading]:
        """Run a command and return the values in its reply.

        The server limits the wait, except for sequences.

        Raises:
            CommandFailed: the command failed; the exception has a `code` and a message. After a
                failure with the code ``disconnected``, the robot may have executed the command.
        """
        try:
            plain = plain_arguments(arguments)
        except UrcError as error:
            raise CommandFailed("bad-argument", str(error)) from error
        self.check_open()
        reply = await self._commands.run(name, plain, self.motion.stops)
        if not reply.ok:
            raise CommandFailed(reply.code, reply.message)
        return readings_of(reply.values or {}, self.hub.signals)

    def drive(
        self, command: str = "", /, *, valid_s: float = VALID_S
    ) -> AbstractAsyncContextManager[Stick]:
        """Take the controls while the context is open; see `urc.client.robot.RobotInterface`."""
        return self.motion.drive(command, valid_s)

    async def stop(self) -> bool:
        """Stop the robot and latch STOP over the socket, and over HTTP if the socket is silent.

        Returns:
            Whether all of the robot's connections accepted the stop within two seconds.

        Raises:
            UrcError: the robot has no motion to stop.
            ConnectionLost: the server could not be reached.
        """
        is_confirmed = await self.motion.stop()
        return await self._post_stop() if is_confirmed is None else is_confirmed

    async def reset(self) -> None:
        """Reset a latched STOP; the robot does not move before new input.

        Raises:
            CommandFailed: the reset was refused.
        """
        await self.motion.reset()

    # -- opening and closing

    async def until_ready(self, running: "asyncio.Task[None]", timeout_s: float) -> None:
        """Wait for the server's first message; raise an error with the reason if none arrives."""
        ready = asyncio.ensure_future(self._ready.wait())
        try:
            await asyncio.wait(
                (ready, running), timeout=timeout_s, return_when=asyncio.FIRST_COMPLETED
            )
        finally:
            ready.cancel()
        if running.done():
            running.result()
        if not self._ready.is_set():
            raise ConnectionLost(f"{self._address.url} did not answer within {timeout_s:g} s")
        with suppress(TimeoutError):  # a playback may have no links
            async with asyncio.timeout(_LINKS_S):
                await self._linked.wait()

    def over(self, running: "asyncio.Task[None]") -> None:
        """Record that the connection has ended permanently, so that waiting calls fail."""
        fault = None if running.cancelled() else running.exception()
        if fault is not None and not isinstance(fault, ConnectionLost):
            log.error("the client of %s failed", self._address.url, exc_info=fault)
            self._lost(str(fault))
        known = fault if isinstance(fault, ConnectionLost) else None
        self._over = known or ConnectionLost("the robot was closed")
        self._note("error", str(self._over))

    def _is_connecting(self) -> bool:
        return any(link.is_opening for link in self.hub.links.values())

    def check_open(self) -> None:
        """Raise `ConnectionLost` if the connection has ended permanently."""
        if self._over is not None:
            raise self._over

    def _lost(self, reason: str) -> None:
        self.motion.lost()
        self._commands.lost(reason)
        now = time.monotonic()
        for link in list(self.hub.links.values()):
            detail = "no connection to the server"
            self.hub.set_link(replace(link, state="lost", detail=detail, since_s=now))
        if self._ready.is_set():
            self._note("warning", f"the connection was lost: {reason}")

    def _note(self, level: Literal["info", "warning", "error"], text: str) -> None:
        self.hub.log(LogEntry(time.monotonic(), level, self._address.netloc, text))

    # -- messages

    def _handle(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            self._show_picture(data)
            return
        message, now = decode_message(data), time.monotonic()
        match message:
            case ValuesMessage():
                self.hub.publish(tuple(samples_of(message, self._order, now)))
            case ReplyMessage() | TokenMessage():
                self._commands.handle(message)
            case HelloMessage():
                self._hello(message)
            case LinksMessage():
                for link in links_of(message, now):
                    self.hub.set_link(link)
                self._linked.set()
                self.motion.wake()
            case LogMessage():
                self._add_lines(message, now)
            case AlarmsMessage():
                self.alarms.update(message)
            case ProgressMessage():
                for progress in progress_of(message):
                    self.hub.set_progress(progress)
            case ErrorMessage(code="bad-message"):  # other errors repeat the reason for closing
                log.warning("%s: %s", self._address.url, message.message)
            case _ if isinstance(message, ControlMessage):
                self.motion.handle(message)

    def _hello(self, hello: HelloMessage) -> None:
        signals = signals_of(hello)
        if self._ready.is_set() and signals != self.hub.signals:
            # Readers store the names and types of the signals from the first message.
            self._socket.fail("the robot's signals have changed: open the robot again")
            return
        self._socket.is_up = True
        self._name, self.motion.names = hello.robot, hello.controls
        if self._session and hello.session != self._session:
            self._next_line = 0
        self._session = hello.session
        self.alarms.clear()
        if self._ready.is_set():
            self._note("info", "the connection was restored")
        else:
            self.hub = Hub(signals)
            self._order = tuple(signals.values())
        self._select_images()
        self._ready.set()

    def _add_lines(self, message: LogMessage, now: float) -> None:
        """Add the new lines of the log, and report how many lines the server has dropped."""
        known = message.first if self._next_line is None else self._next_line
        if message.first > known:
            self._note("warning", f"log lines lost: {message.first - known}")
        for row in message.lines[max(0, known - message.first) :]:
            self.hub.log(entry_of(row, now))
        self._next_line = max(known, message.first + len(message.lines))

    def _show_picture(self, data: bytes) -> None:
        picture = read_picture(data)
        if picture is not None and picture.signal_index < len(self._order):
            signal = self._order[picture.signal_index]
            time_s = time.monotonic() - picture.age_ms / 1000
            self.hub.publish((Sample(signal.name, picture.data, time_s),))

    @contextmanager
    def shown(self, names: tuple[str, ...]) -> Iterator[None]:
        """Request the image signals among `names` while the context is open."""
        signals = self.hub.signals
        images = [name for name in names if signals[name].type in BINARY_TYPES]
        if images:
            self._images.update(images)
            self._select_images()
        try:
            yield
        finally:
            if images:
                self._images.subtract(images)
                self._select_images()

    def _select_images(self) -> None:
        """Request the images that the program reads; the server sends no other images."""
        names = sorted(+self._images)[:_MOST_IMAGES]
        if names or self._images:
            self._socket.send(ImageSelection(tuple(names)))

    async def _post_stop(self) -> bool:
        """Send STOP over HTTP; return whether the robot accepted the stop."""
        said = await self._post(self._address.stop(self._robot or self._name), None, "STOP")
        return bool(said["confirmed"])

    async def _post_alarms(self, verb: str, body: Mapping[str, Any]) -> Mapping[str, Any]:
        """Send an action on alarms over HTTP, and return the server's answer."""
        address = self._address.alarms(self._robot or self._name, verb)
        return await self._post(address, body, "the request")

    async def _post(
        self, address: str, body: Mapping[str, Any] | None, what: str
    ) -> Mapping[str, Any]:
        """Send a request over HTTP; see `urc.client.server_request.post`."""
        return await post(
            self._address, address, body, what, token=self._token, context=self._context
        )
