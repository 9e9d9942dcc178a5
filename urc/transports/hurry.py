"""Connecting to a robot that may come back any moment.

A try that was made while nobody could be reached is repeated by the system only after a second, and
later ones after longer. Whoever cannot wait so long says so by `HURRY`: then another try is begun
every few moments, while those before it still wait, because the way may also just be a long one.
"""

import asyncio
import errno
import socket
from contextvars import ContextVar

from urc.transports._stream import tune
from urc.transports.own_doors import OWN_DOORS

__all__ = ["HURRY", "Hurry", "connected"]


class Hurry:
    """How often another try is begun."""

    __slots__ = ("every_s", "is_used")

    def __init__(self, every_s: float) -> None:
        self.every_s = every_s
        self.is_used = False
        """Whether the line was opened in this way; some are by others."""


HURRY: ContextVar[Hurry | None] = ContextVar("HURRY", default=None)
"""Set by who opens a line in a hurry."""


async def connected(family: int, address: object) -> socket.socket:
    """Return a connected socket that does not block; whoever waits bounds the time.

    Raises:
        OSError: the robot, or this machine, refuses.
    """
    hurry = HURRY.get()
    if hurry is None:
        return await _once(family, address)
    hurry.is_used = True
    tries: set[asyncio.Task[socket.socket]] = set()
    try:
        while True:
            tries.add(asyncio.create_task(_once(family, address)))
            done, tries = await asyncio.wait(
                tries, timeout=hurry.every_s, return_when=asyncio.FIRST_COMPLETED
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
    """Connect one socket, which is closed again when that fails or is cancelled."""
    loop = asyncio.get_running_loop()
    line = socket.socket(family, socket.SOCK_STREAM)
    try:
        line.setblocking(False)
        tune(line)
        await loop.sock_connect(line, address)  # type: ignore[arg-type] # as getaddrinfo gave it
        if line.getsockname() == line.getpeername():
            # A port of this machine that nobody listens on, and the kernel chose it for our end.
            raise ConnectionRefusedError(errno.ECONNREFUSED, "connected to itself")
        OWN_DOORS.check(line)
    except BaseException:
        line.close()
        raise
    return line
