"""A line without a wire: the test plays the robot."""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping

from urc.registry import Row, Table
from urc.transports.base import ConnectFailed, PeerClosed, Transport

__all__ = ["MemoryTransport", "table_of"]


class MemoryTransport:
    """Stands in for any transport.

    Bytes go in by `feed`, or come from `answer`, which is called with everything that is sent and
    returns the chunks the robot says in turn. What was sent is in `sent`, in the pieces in which it
    was handed over. The robot hangs up by `hang_up`, refuses by `refuse`, and hangs by `stall_open`
    and `stall_sends`.
    """

    def __init__(
        self,
        chunks: Iterable[bytes] = (),
        *,
        answer: Callable[[bytes], Iterable[bytes]] | None = None,
        address: str = "memory",
    ) -> None:
        self.address = address
        """Where it leads, for people."""
        self.sent: list[bytes] = []
        """Everything handed over, over all connections."""
        self.opens = 0
        """How often `open` was called, successful or not."""
        self.is_open = False
        self.stall_open = False
        """While true, `open` waits until its time is up, and longer: the promise broken."""
        self._answer = answer
        self._greeting = tuple(chunks)
        self._arriving: deque[bytes | PeerClosed] = deque()
        self._refusals: deque[str] = deque()
        self._changed = asyncio.Event()
        self._flowing = asyncio.Event()
        self._flowing.set()

    # -- the robot's side

    def feed(self, *chunks: bytes) -> None:
        """Let the robot say `chunks`, each arriving by itself."""
        self._arriving.extend(chunks)
        self._changed.set()

    def hang_up(self, reason: str = "the robot closed the connection") -> None:
        """Let the robot close the line, after what was fed before."""
        self._arriving.append(PeerClosed(reason))
        self._changed.set()

    def refuse(self, reason: str = "refused", times: int = 1) -> None:
        """Let the next `times` attempts to open fail."""
        self._refusals.extend([reason] * times)

    def stall_sends(self, is_stalled: bool = True) -> None:
        """Let the robot take no more bytes, or take them again."""
        if is_stalled:
            self._flowing.clear()
        else:
            self._flowing.set()

    # -- the five members of a transport

    async def open(self, timeout_s: float) -> None:
        """Connect, unless the robot was told to refuse or to hang."""
        self.opens += 1
        if self.stall_open:
            await asyncio.Event().wait()
        if self._refusals:
            raise ConnectFailed(self._refusals.popleft())
        self._arriving.clear()
        self.is_open = True
        self.feed(*self._greeting)

    async def receive(self) -> bytes:
        """Return the next chunk fed."""
        while not self._arriving:
            if not self.is_open:
                raise PeerClosed("the connection is closed")
            self._changed.clear()
            await self._changed.wait()
        chunk = self._arriving.popleft()
        if isinstance(chunk, PeerClosed):
            self._arriving.appendleft(chunk)  # said again to whoever asks again
            raise chunk
        return chunk

    async def send(self, data: bytes) -> None:
        """Record `data`, and let the robot answer."""
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
    """Return a transports table whose rows give these very transports, whatever the options."""
    return _GivenTable(transports)


class _GivenTable(Table):
    def __init__(self, transports: Mapping[str, Transport]) -> None:
        super().__init__("urc.transports", {})
        self._transports = transports

    def __iter__(self) -> Iterator[str]:
        return iter(self._transports)

    def get(self, name: str) -> Row | None:
        return _GivenRow(name, self._transports[name]) if name in self._transports else None


class _GivenRow(Row):
    def __init__(self, name: str, transport: Transport) -> None:
        super().__init__(name, "")
        self.transport = transport

    def load(self) -> Callable[[object], Transport]:
        return lambda options: self.transport
