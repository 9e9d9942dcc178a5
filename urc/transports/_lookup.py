"""Looks names up without ever holding up the loop, or its end."""

import asyncio
import errno
import socket
from collections.abc import Awaitable, Callable
from functools import partial
from typing import TypeVar

from urc._daemon import in_daemon

__all__ = ["Address", "Lookup"]

Address = tuple[socket.AddressFamily, tuple[str | int, ...] | tuple[int, bytes]]
"""As a socket is made and connected with."""
_Connected = TypeVar("_Connected")


class Lookup:
    """The addresses of one host and port.

    The loop's pool of threads is waited for when the program ends, and a resolver without a network
    may take half a minute: so each look-up has a thread of its own. One at a time: a retry joins
    the one under way.
    """

    def __init__(self, host: str, port: int, kind: socket.SocketKind) -> None:
        """Prepare it for sockets of `kind`; `addresses` does it."""
        self._host = host
        self._port = port
        self._kind = kind
        self._answer: asyncio.Future[list[Address]] | None = None

    async def addresses(self) -> list[Address]:
        """Return every address the name leads to.

        Raises:
            OSError, UnicodeError: there is none. The wait has no bound of its own.
        """
        if self._answer is None or self._answer.done():
            self._answer = _look_up(self._host, self._port, self._kind)
        return await asyncio.shield(self._answer)

    async def first(
        self, connect: Callable[[int, object], Awaitable[_Connected]], timeout_s: float
    ) -> _Connected:
        """Return what `connect` makes of the first address that accepts a connection.

        The addresses are tried in turn, each with a fair share of the time that is left.

        Raises:
            OSError, UnicodeError: the name leads to no address, or none accepts a connection.
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
                # The last address gets all that is left: then the time of the whole is up as well.
                fault = fault or TimeoutError(errno.ETIMEDOUT, "timed out")
            except OSError as refused:
                fault = refused
        raise fault or OSError("the name leads to no address")


def _look_up(host: str, port: int, kind: socket.SocketKind) -> asyncio.Future[list[Address]]:
    if (given := _numeric(host, port, kind)) is not None:
        known: asyncio.Future[list[Address]] = asyncio.get_running_loop().create_future()
        known.set_result(given)
        return known
    answer = in_daemon(partial(_resolve, host, port, kind), f"look up {host}")
    # Nobody may be waiting any more when the look-up fails: then its error is not news.
    answer.add_done_callback(lambda done: done.cancelled() or done.exception())
    return answer


def _numeric(host: str, port: int, kind: socket.SocketKind) -> list[Address] | None:
    """Return what is an address already: that needs no thread."""
    try:
        return _resolve(host, port, kind, socket.AI_NUMERICHOST)
    except (OSError, UnicodeError):
        return None


def _resolve(host: str, port: int, kind: socket.SocketKind, flags: int = 0) -> list[Address]:
    rows = socket.getaddrinfo(host, port, type=kind, flags=flags)
    return [(family, address) for family, _, _, _, address in rows]
