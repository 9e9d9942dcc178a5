"""Address lookups that block neither the event loop nor the program's exit."""

import asyncio
import errno
import socket
from collections.abc import Awaitable, Callable
from functools import partial
from typing import TypeVar

from urc._daemon import in_daemon

__all__ = ["Address", "AddressLookup"]

Address = tuple[socket.AddressFamily, tuple[str | int, ...] | tuple[int, bytes]]
"""An address family, and a socket address of this family."""
_Connected = TypeVar("_Connected")


class AddressLookup:
    """An address lookup for one host and port, which can be repeated.

    A lookup in the event loop's thread pool could delay the program's exit by half a minute if the
    network is down. Each lookup therefore runs in a separate thread. Only one lookup runs at a
    time; further calls wait for its result.
    """

    def __init__(self, host: str, port: int, kind: socket.SocketKind) -> None:
        """Prepare a lookup for sockets of type `kind`, without starting the lookup."""
        self._host = host
        self._port = port
        self._kind = kind
        self._answer: asyncio.Future[list[Address]] | None = None

    async def addresses(self) -> list[Address]:
        """Look up the host, and return all of its addresses.

        Raises:
            OSError, UnicodeError: the lookup failed. A lookup has no timeout; the caller must set a
            timeout.
        """
        if self._answer is None or self._answer.done():
            self._answer = _look_up(self._host, self._port, self._kind)
        return await asyncio.shield(self._answer)

    async def first(
        self, connect: Callable[[int, object], Awaitable[_Connected]], timeout_s: float
    ) -> _Connected:
        """Return the result of `connect` for the first address that accepts a connection.

        The addresses are tried in sequence, each with an equal share of the remaining time.

        Raises:
            OSError, UnicodeError: the lookup failed, or no address accepts a connection.
        """
        loop = asyncio.get_running_loop()
        deadline = loop.time() + timeout_s
        addresses = await self.addresses()
        fault: OSError | None = None
        for index, (family, address) in enumerate(addresses):
            share_s = (deadline - loop.time()) / (len(addresses) - index)
            try:
                async with asyncio.timeout(share_s):
                    return await connect(family, address)
            except TimeoutError:
                # The last address gets all the remaining time, so its timeout ends the whole
                # attempt.
                fault = fault or TimeoutError(errno.ETIMEDOUT, "timed out")
            except OSError as refused:
                fault = refused
        raise fault or OSError("the host name has no address")


def _look_up(host: str, port: int, kind: socket.SocketKind) -> asyncio.Future[list[Address]]:
    if (given := _numeric(host, port, kind)) is not None:
        known: asyncio.Future[list[Address]] = asyncio.get_running_loop().create_future()
        known.set_result(given)
        return known
    answer = in_daemon(partial(_resolve, host, port, kind), f"look up {host}")
    # If no task is waiting, this callback retrieves the error of a failed lookup.
    answer.add_done_callback(lambda done: done.cancelled() or done.exception())
    return answer


def _numeric(host: str, port: int, kind: socket.SocketKind) -> list[Address] | None:
    """Return a numeric host's addresses without starting a thread; None for a host name."""
    try:
        return _resolve(host, port, kind, socket.AI_NUMERICHOST)
    except (OSError, UnicodeError):
        return None


def _resolve(host: str, port: int, kind: socket.SocketKind, flags: int = 0) -> list[Address]:
    rows = socket.getaddrinfo(host, port, type=kind, flags=flags)
    return [(family, address) for family, _, _, _, address in rows]
