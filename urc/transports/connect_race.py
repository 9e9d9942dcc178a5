"""Overlapping attempts to connect to a robot that may become reachable at any moment.

The operating system repeats an unanswered connection attempt only after a second, then at
increasing intervals. If `HURRY` is set, new attempts start at short intervals. Earlier attempts
continue, because a distant robot may reply late.
"""

import asyncio
import errno
import socket
from contextvars import ContextVar

from urc.transports._stream import tune
from urc.transports.own_listeners import OWN_DOORS

__all__ = ["HURRY", "ConnectRace", "connected"]


class ConnectRace:
    """Setting for overlapping connection attempts: their interval, and whether they were used."""

    __slots__ = ("every_s", "is_used")

    def __init__(self, every_s: float) -> None:
        self.every_s = every_s
        self.is_used = False
        """Whether overlapping attempts were used; some transports ignore `HURRY`."""


HURRY: ContextVar[ConnectRace | None] = ContextVar("HURRY", default=None)
"""Interval between overlapping attempts, set by a caller that needs a fast connection; None for a
single attempt."""


async def connected(family: int, address: object) -> socket.socket:
    """Return a connected non-blocking socket; the caller must set a timeout.

    Raises:
        OSError: the connection failed.
    """
    connect_race = HURRY.get()
    if connect_race is None:
        return await _once(family, address)
    connect_race.is_used = True
    tries: set[asyncio.Task[socket.socket]] = set()
    try:
        while True:
            tries.add(asyncio.create_task(_once(family, address)))
            done, tries = await asyncio.wait(
                tries, timeout=connect_race.every_s, return_when=asyncio.FIRST_COMPLETED
            )
            if done:
                first, *more = sorted(done, key=lambda one: one.exception() is not None)
                tries.update(more)
                return first.result()
    finally:
        for other in tries:
            other.cancel()
        for left in await asyncio.gather(*tries, return_exceptions=True):
            if isinstance(left, socket.socket):
                left.close()


async def _once(family: int, address: object) -> socket.socket:
    """Connect one socket; close the socket on failure or cancellation."""
    loop = asyncio.get_running_loop()
    line = socket.socket(family, socket.SOCK_STREAM)
    try:
        line.setblocking(False)
        tune(line)
        await loop.sock_connect(line, address)  # type: ignore[arg-type] # a result of getaddrinfo
        if line.getsockname() == line.getpeername():
            # The kernel chose an unused port on this machine for both ends of the connection.
            raise ConnectionRefusedError(errno.ECONNREFUSED, "connected to itself")
        OWN_DOORS.check(line)
    except BaseException:
        line.close()
        raise
    return line
