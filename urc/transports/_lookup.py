"""Looks names up without ever holding up the loop, or its end."""

import asyncio
import errno
import socket
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import TypeVar

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
    loop = asyncio.get_running_loop()
    answer: asyncio.Future[list[Address]] = loop.create_future()
    if (given := _numeric(host, port, kind)) is not None:
        answer.set_result(given)
        return answer
    # Nobody may be waiting any more when the look-up fails: then its error is not news.
    answer.add_done_callback(lambda done: done.cancelled() or done.exception())

    def settle(found: list[Address] | None, fault: OSError | UnicodeError | None) -> None:
        if not answer.done():
            if fault is not None:
                answer.set_exception(fault)
            else:
                answer.set_result(found or [])

    def work() -> None:
        found: list[Address] | None = None
        fault: OSError | UnicodeError | None = None
        try:
            found = _resolve(host, port, kind)
        except (OSError, UnicodeError) as problem:
            fault = problem
        with suppress(RuntimeError):  # the loop has ended meanwhile
            loop.call_soon_threadsafe(settle, found, fault)

    threading.Thread(target=work, name=f"look up {host}", daemon=True).start()
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
