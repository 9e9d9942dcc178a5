"""An in-memory transport for tests that act as the robot."""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping

from urc.registry import RegistryEntry, Table
from urc.transports.base import ConnectFailed, PeerClosed, Transport

__all__ = ["MemoryTransport", "table_of"]


class MemoryTransport:
    """An in-memory replacement for any transport.

    The transport receives bytes from `feed` and `answer`. The callback `answer` gets all sent data
    and returns the chunks of a reply. `sent` contains the sent data, in its original pieces.
    `hang_up` closes the connection, `refuse` rejects connection attempts, and `stall_open` and
    `stall_sends` block `open` and `send`.
    """

    def __init__(
        self,
        chunks: Iterable[bytes] = (),
        *,
        answer: Callable[[bytes], Iterable[bytes]] | None = None,
        address: str = "memory",
    ) -> None:
        self.address = address
        """Address of the robot, as text for display."""
        self.sent: list[bytes] = []
        """All data sent so far over any connection, in its original pieces."""
        self.opens = 0
        """Number of calls to `open`, including failed calls."""
        self.is_open = False
        self.stall_open = False
        """Whether `open` blocks beyond its timeout, in violation of its contract."""
        self._answer = answer
        self._greeting = tuple(chunks)
        self._arriving: deque[bytes | PeerClosed] = deque()
        self._refusals: deque[str] = deque()
        self._changed = asyncio.Event()
        self._flowing = asyncio.Event()
        self._flowing.set()

    # -- the robot's side

    def feed(self, *chunks: bytes) -> None:
        """Act as the robot: send each of `chunks` as a separate piece."""
        self._arriving.extend(chunks)
        self._changed.set()

    def hang_up(self, reason: str = "the robot closed the connection") -> None:
        """Act as the robot: close the connection after all data fed so far has been received."""
        self._arriving.append(PeerClosed(reason))
        self._changed.set()

    def refuse(self, reason: str = "refused", times: int = 1) -> None:
        """Reject the next `times` attempts to connect."""
        self._refusals.extend([reason] * times)

    def stall_sends(self, is_stalled: bool = True) -> None:
        """Make the robot stop or resume accepting bytes."""
        if is_stalled:
            self._flowing.clear()
        else:
            self._flowing.set()

    # -- the five members of a transport

    async def open(self, timeout_s: float) -> None:
        """Connect, unless `refuse` or `stall_open` prevents a connection."""
        self.opens += 1
        if self.stall_open:
            await asyncio.Event().wait()
        if self._refusals:
            raise ConnectFailed(self._refusals.popleft())
        self._arriving.clear()
        self.is_open = True
        self.feed(*self._greeting)

    async def receive(self) -> bytes:
        """Return the next chunk of fed data."""
        while not self._arriving:
            if not self.is_open:
                raise PeerClosed("the connection is closed")
            self._changed.clear()
            await self._changed.wait()
        chunk = self._arriving.popleft()
        if isinstance(chunk, PeerClosed):
            self._arriving.appendleft(chunk)  # raised again at the next call
            raise chunk
        return chunk

    async def send(self, data: bytes) -> None:
        """Record `data` and feed the robot's reply."""
        await self._flowing.wait()
        if not self.is_open:
            raise PeerClosed("the connection is closed")
        self.sent.append(data)
        if self._answer is not None:
            self.feed(*self._answer(data))

    async def close(self) -> None:
        """Close at once."""
        self.is_open = False
        self._arriving.clear()
        self._changed.set()


def table_of(**transports: Transport) -> Table:
    """Return a table of these transports, keyed by name; the transports ignore all options."""
    return _GivenTable(transports)


class _GivenTable(Table):
    def __init__(self, transports: Mapping[str, Transport]) -> None:
        super().__init__("urc.transports", {})
        self._transports = transports

    def __iter__(self) -> Iterator[str]:
        return iter(self._transports)

    def get(self, name: str) -> RegistryEntry | None:
        return _GivenRow(name, self._transports[name]) if name in self._transports else None


class _GivenRow(RegistryEntry):
    def __init__(self, name: str, transport: Transport) -> None:
        super().__init__(name, "")
        self.transport = transport

    def load(self) -> Callable[[object], Transport]:
        return lambda options: self.transport
