"""What the doors of an emulated robot share: their place, their clients, the talk with one client.

A door opens a real line (a port, a pseudo-terminal) and lets clients in; each client talks to a
`TwinLine` of its own. Everything a client can do is bounded: how many there are, how much is read
ahead, how long an answer may wait to be taken. When all places are taken the client that has been
silent for longest goes, so that half-open connections cannot lock the door.
"""

import asyncio
import logging
import math
import os
import socket
from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

from urc.model.codec import Payload
from urc.model.driver import TransportSpec
from urc.model.values import NOTHING, Value
from urc.problems import UrcError
from urc.registry import Table
from urc.simulator.twin import TwinLine

__all__ = [
    "DOORS",
    "MAX_CLIENTS",
    "READ_BYTES",
    "TAKEN_WITHIN_S",
    "Caller",
    "Crowd",
    "Door",
    "Guest",
    "Listening",
    "Place",
    "converse",
    "keep_alive",
    "option_port",
    "reason",
    "shown_place",
]

MAX_CLIENTS = 64
"""Connections on one transport."""
READ_BYTES = 4096
TAKEN_WITHIN_S = 5.0
"""A client that does not take its answers for this long is dropped."""

log = logging.getLogger(__name__)


class Listening(NamedTuple):
    """Where a door can be found once it is open."""

    host: str
    """Address; "" where there is none."""
    port: int
    """0 where there is none."""
    text: str
    """For people and ``urc simulate``: ``tcp 127.0.0.1:6789``, ``serial /dev/pts/3``."""
    options: Mapping[str, object] = NOTHING
    """The options with which the driver's own transport gets here, on top of its others."""
    path: str = ""
    """A file of the file system, for lines that are one."""


class Caller:
    """The machine that a robot was spoken to from last, whichever of its doors it came to."""

    def __init__(self) -> None:
        self.host = ""
        """Its address; "" before anybody spoke."""


class Place(NamedTuple):
    """Where a door is put, and what is behind it."""

    name: str
    """Of the transport in the driver."""
    spec: TransportSpec
    options: Mapping[str, object]
    """Of the transport, evaluated over the settings."""
    host: str
    """Address to listen on, where the kind of transport has any."""
    line: Callable[[], TwinLine]
    """Makes the robot's side of a new connection."""
    now: Callable[[], float]
    """Seconds since the epoch, the templates' ``now``."""
    topics: Mapping[str, Mapping[str, Value]] = NOTHING
    """What the driver listens to, on a transport that carries messages: topic → how."""
    is_anywhere: bool = False
    """Listen where it is free, whatever the options say; else exactly where they say."""
    picture: Callable[[Sequence[str]], bytes | None] = lambda _: None
    """Names of a topic → the picture that the robot's world gives there now, None without one."""
    caller: Caller | None = None
    """Who speaks to the robot, which all its doors share; None: nobody keeps it."""
    carried: Mapping[tuple[str, int], Listening] = MappingProxyType({})
    """What a client that comes through this door can reach from inside: host and port as the
    driver says them → where the emulated robot really listens for them."""


class Door(Protocol):
    """One way to the emulated robot."""

    async def open(self) -> Listening:
        """Let clients in from now on.

        Raises:
            UrcError: the place cannot be had, in one line that starts with ``transports.NAME``.
        """

    async def close(self) -> None:
        """Let nobody in any more and drop who is there; leave no task, socket or file behind."""


DOORS = Table(
    "urc.doors",
    {
        "tcp": "urc.simulator.doors.tcp:TcpDoor",
        "udp": "urc.simulator.doors.udp:UdpDoor",
        "serial": "urc.simulator.doors.serial:SerialDoor",
        "ssh": "urc.simulator.doors.ssh:SshDoor",
        "telnet": "urc.simulator.doors.telnet:TelnetDoor",
        "http": "urc.simulator.doors.http:HttpDoor",
        "websocket": "urc.simulator.doors.websocket:WebSocketDoor",
        "rosbridge": "urc.simulator.doors.rosbridge:RosbridgeDoor",
        "mqtt": "urc.simulator.doors.mqtt:MqttDoor",
    },
)
"""Kind of transport → class of a `Door`, which is made from a `Place`."""


class Guest:
    """One client of a door."""

    def __init__(self, line: TwinLine, abort: Callable[[], None]) -> None:
        self.line = line
        self.abort = abort
        """Cuts the client off at once; called again, does nothing."""
        self.heard_s = asyncio.get_running_loop().time()
        """When it last said something, by the loop's clock."""


class Crowd:
    """The clients of one door, and their talks."""

    def __init__(self, place: Place, limit: int = MAX_CLIENTS) -> None:
        """Hold at most `limit` clients."""
        self._place = place
        self._limit = limit
        self._talks: dict[Guest, asyncio.Task[None]] = {}

    @property
    def lines(self) -> Sequence[TwinLine]:
        """The robot's side of every connection there is."""
        return [guest.line for guest in self._talks]

    def welcome(
        self, talk: Callable[[Guest], Coroutine[Any, Any, None]], abort: Callable[[], None]
    ) -> None:
        """Run `talk` with a new client; `abort` cuts it off, and is called at the end as well.

        `talk` may raise OSError or TimeoutError: the client was lost.
        """
        if len(self._talks) >= self._limit:
            silent = min(self._talks, key=lambda guest: guest.heard_s)
            silent.heard_s = math.inf  # on its way out, and not to be chosen again
            silent.abort()
            self._talks[silent].cancel()
        guest = Guest(self._place.line(), abort)
        self._talks[guest] = asyncio.create_task(self._attend(guest, talk))

    async def close(self) -> None:
        """Drop every client."""
        tasks = list(self._talks.values())
        for guest, task in self._talks.items():
            guest.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _attend(
        self, guest: Guest, talk: Callable[[Guest], Coroutine[Any, Any, None]]
    ) -> None:
        name = self._place.name
        try:
            await talk(guest)
        except (OSError, TimeoutError) as fault:
            log.info("%s: a client was lost: %s", name, str(fault) or "it takes nothing")
        finally:
            guest.abort()
            self._talks.pop(guest, None)
            if guest.line.faults:
                text, count = guest.line.last_fault, guest.line.faults
                log.info("%s: %s (%d faults in all)", name, text, count)


async def converse(
    place: Place,
    guest: Guest,
    take: Callable[[], Awaitable[Payload | None]],
    put: Callable[[Sequence[Payload]], Awaitable[None]],
) -> None:
    """Talk to one client until it has had enough, or the robot has (``connection: per_request``).

    Args:
        place: of the door.
        guest: whose line answers.
        take: returns what the client says next, None or b"" at its end; called again after it was
            cancelled, which must lose nothing.
        put: hands over what the robot says, and waits while the client takes no more.

    Raises:
        TimeoutError: the client takes nothing.
    """
    clock = asyncio.get_running_loop().time
    line, before_s = guest.line, clock()
    limit = 1 if place.spec.connection == "per_request" else None
    while True:
        said_by_client: Payload | None = b""
        try:
            async with asyncio.timeout(line.due_in_s) as wait:
                said_by_client = await take()
        except TimeoutError:
            if not wait.expired():
                raise  # the system has given the client up
        if not said_by_client and not wait.expired():
            return
        now_s, was_late = clock(), line.has_late
        said: list[Payload] = list(line.step(now_s - before_s, place.now()))
        before_s = now_s
        answers: list[Payload] = []
        if said_by_client:
            guest.heard_s = now_s
            answers = list(line.receive(said_by_client, place.now(), limit))
        if said or answers:
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await put(said + answers)
        is_answered = limit is not None and bool(answers or (was_late and said))
        if (line.is_over or is_answered) and not line.has_late:
            return
        await asyncio.sleep(0)  # reading what is there already does not wait by itself


def option_port(place: Place, key: str = "port", default: int | None = None) -> int:
    """Return the port to listen on, 0..65535; 0 lets the system choose.

    Args:
        place: of the door.
        key: name of the option.
        default: where the kind of transport has a usual port.

    Raises:
        UrcError: the option is none.
    """
    if place.is_anywhere:
        return 0
    port = place.options.get(key, default)
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise UrcError(f"transports.{place.name}.{key}: {port!r} is no port to listen on")
    return port


def shown_place(host: str, port: int) -> str:
    """Return a host and port as people write them."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def reason(fault: OSError) -> str:
    """Return the system's own words: asyncio puts the address into the error a second time."""
    if isinstance(fault, socket.gaierror) or not fault.errno:
        return str(fault.strerror or fault).lower()
    return os.strerror(fault.errno).lower()


def keep_alive(connection: socket.socket) -> None:
    """Let the system find out when a client is gone without a word."""
    with suppress(OSError):  # it is gone already
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
