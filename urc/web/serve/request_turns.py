"""Turns for all visitors' requests, so that many requests do not delay a page's ticks.

Layer 5. The event loop runs everything that is ready before it reads sockets again. Hundreds of
requests that arrive together would therefore delay a tick by more than the duration of a lease.
Decision record: docs/decisions/0051-a-crowd-waits-for-turns.md.
"""

import asyncio
from collections.abc import Callable

__all__ = ["REQUESTS_AT_ONCE", "RequestTurns"]

REQUESTS_AT_ONCE = 8
"""Maximum number of connections whose requests are read in one iteration of the event loop. Ticks
arrive on open WebSockets, which take no turns."""


class RequestTurns:
    """The connections of one server with unread requests, oldest first."""

    def __init__(self, *, most: int = REQUESTS_AT_ONCE) -> None:
        """Start without any waiting connections.

        Args:
            most: maximum number of turns in one iteration of the event loop.
        """
        self._most = most
        self._left = most
        """Number of turns left in this iteration of the event loop."""
        self._waiting: dict[object, Callable[[], None]] = {}
        self._is_scheduled = False

    def take(self, connection: object, read: Callable[[], None]) -> bool:
        """Call `read` now, or at the connection's turn; a waiting connection keeps its place.

        Return whether `read` was called immediately.

        Args:
            connection: the connection, which has at most one place in the queue.
            read: function that reads the connection's requests.
        """
        if self._waiting or not self._left:
            self._waiting.setdefault(connection, read)
            return False
        self._left -= 1
        self._schedule()
        read()
        return True

    def remove(self, connection: object) -> None:
        """Remove a lost connection, whose requests are no longer read."""
        self._waiting.pop(connection, None)

    def _schedule(self) -> None:
        if not self._is_scheduled:
            self._is_scheduled = True
            asyncio.get_running_loop().call_soon(self._next_iteration)

    def _next_iteration(self) -> None:
        self._is_scheduled = False
        self._left = self._most
        while self._waiting and self._left:
            self._left -= 1
            self._schedule()
            read = self._waiting.pop(next(iter(self._waiting)))
            read()
