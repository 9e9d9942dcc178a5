"""The engine's proxy for a transport in the guard; the proxy has the members of `Transport`.

A turn is the number of a connection; messages with the number of an earlier connection are ignored.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Final

from urc.guard import messages
from urc.guard.guarded_connection import WINDOW_BYTES
from urc.guard.pipe import UNFIT
from urc.model.payload import CountedFrame, Numbered, Payload, size_of
from urc.transports.base import ConnectFailed, PeerClosed, TransportError

__all__ = ["GuardedTransport"]

_CLOSED: Final = "the connection is closed"
START_S: Final = 60.0
"""Maximum time that a connection waits for the guard to start, in seconds. With many robots, the
guards start one after another."""
_OPEN_GRACE_S: Final = 0.7
_CLOSE_S: Final = 1.0
_CREDIT_BYTES: Final = WINDOW_BYTES // 4
_OFFERED_BYTES: Final = 65536
"""Maximum number of pending bytes that were accepted without waiting."""
_CLOGGED_BYTES: Final = 4096

log = logging.getLogger(__name__)

Post = Callable[[messages.ToGuard], object]
Stands = Callable[[str, Mapping[str, int], bool], None]


@dataclass(slots=True)
class _Sent:
    """Data that the guard has not yet reported as passed to the transport."""

    number: int
    size: int
    data: Payload
    taken: asyncio.Future[None] | None
    """Future of the caller that waits until the data is passed on; None if no caller waits."""
    counted: CountedFrame | None
    left: Callable[[Payload], None] | None
    """Callback that receives the data once the transport has it; None without a callback."""


class GuardedTransport:
    """The proxy of one transport, across all its connections. Also a `Prompt`."""

    def __init__(
        self,
        name: str,
        address: str,
        post: Post,
        ready: Callable[[], Awaitable[None]],
        stands: Stands,
    ) -> None:
        """Create the proxy.

        Args:
            name: the transport's name.
            address: the robot's address, for display.
            post: function that sends a message to the guard without waiting.
            ready: function that waits until a guard is ready.
            stands: callback that receives the transport's counters, and whether all frames with
                counters are sent.
        """
        self._stands = stands
        self._name = name
        self._address = address
        self._post = post
        self._ready = ready
        self._turn = 0
        self._is_open = False
        self._is_known = False
        """Whether the guard may have unsent data for the current connection."""
        self._opening: asyncio.Future[str] | None = None
        self._closing: asyncio.Future[None] | None = None
        self._ended = _CLOSED
        self._receiver: deque[tuple[Payload, int]] = deque()
        self._arrived = asyncio.Event()
        self._sink: Callable[[bytes], bool] | None = None
        self._arrivals = 0
        self._taken_bytes = 0
        """Number of received bytes not yet acknowledged to the guard."""
        self._number = 0
        self._under_way: deque[_Sent] = deque()
        self._round = 0
        """Number of times that the guard refused pending frames."""
        self._under_way_bytes = 0

    @property
    def address(self) -> str:
        """Address of the robot, for display."""
        return self._address

    @property
    def is_open(self) -> bool:
        """Whether the transport is connected, as last reported by the guard."""
        return self._is_open

    async def ready(self) -> None:
        """Wait until the guard is ready; the guard itself may wait for its turn to start.

        Raises:
            ConnectFailed: no guard was ready within the time limit.
        """
        try:
            async with asyncio.timeout(START_S):
                await self._ready()
        except TimeoutError as late:
            raise ConnectFailed("the guard has not started; see the server's log") from late

    async def open(self, timeout_s: float) -> None:
        """Connect; raise `ConnectFailed` after a refusal, or after about `timeout_s` seconds."""
        await self.close()
        self._turn += 1
        self._opening = asyncio.get_running_loop().create_future()
        try:
            async with asyncio.timeout(timeout_s + _OPEN_GRACE_S):
                await self._ready()
                self._is_known = True
                self._post(messages.OpenLine(self._name, self._turn, timeout_s))
                fault = await self._opening
        except TimeoutError as late:
            text = f"no answer from {self._address} within {timeout_s:g} s"
            raise ConnectFailed(text) from late
        finally:
            self._opening = None
            if not self._is_open:
                self._is_known = False
                self._post(messages.CloseLine(self._name, self._turn))
        if fault:
            raise ConnectFailed(fault)

    async def receive(self) -> Payload:
        """Return the next received data; raise `PeerClosed` when the connection has ended."""
        while not self._receiver:
            if not self._is_open:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        data, size = self._receiver.popleft()
        self._count(size)
        return data

    async def send(self, data: Payload) -> None:
        """Wait for space, then send `data`; raise `TransportError` if the connection breaks."""
        if not self._is_open:
            raise PeerClosed(self._ended)
        taken: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._enqueue(data, taken)
        await taken

    def arrivals(self) -> int:
        """Return how often the guard has reported new data from the remote program."""
        return self._arrivals

    async def close(self) -> None:
        """Close the connection immediately and never raise; a second call does nothing."""
        self._end(_CLOSED)
        self._ended = _CLOSED
        self._receiver.clear()
        if not self._is_known:
            return
        self._is_known = False
        self._closing = closing = asyncio.get_running_loop().create_future()
        self._post(messages.CloseLine(self._name, self._turn))
        await asyncio.wait({closing}, timeout=_CLOSE_S)

    # -- a `Prompt`

    def offer(self, data: bytes) -> bool:
        """Pass `data` to the guard if the queue has space; return whether `data` was accepted."""
        if not self._is_open or self._under_way_bytes + len(data) > _OFFERED_BYTES:
            return False
        self._enqueue(data, None)
        return True

    def offer_counted(self, counted: CountedFrame, left: Callable[[Payload], None]) -> bool:
        """Send a frame with counters; render it again if other frames use its counter values.

        Returns:
            Whether the frame was accepted; if so, `left` receives the data handed to the transport.
        """
        if not self._is_open or self._under_way_bytes > _OFFERED_BYTES:
            return False
        self._enqueue(counted.numbered.data, None, counted, left)
        return True

    async def send_counted(self, counted: CountedFrame, left: Callable[[Payload], None]) -> None:
        """Send a frame with counters; wait while the queue is full.

        Raises:
            TransportError: the connection broke before the guard accepted the frame.
        """
        if not self._is_open:
            raise PeerClosed(self._ended)
        taken: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._enqueue(counted.numbered.data, taken, counted, left)
        await taken

    @property
    def is_clogged(self) -> bool:
        """Whether the number of pending bytes has reached the limit."""
        return self._under_way_bytes > _CLOGGED_BYTES

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Pass received data to `sink` until the connection is closed."""
        self._sink = sink

    # -- messages from the guard

    def lost(self, reason: str) -> None:
        """Record the end of the guard, which closes every connection."""
        self._end(reason)
        self._is_known = False
        if self._opening is not None and not self._opening.done():
            self._opening.set_result(reason)
        self._closed()

    def handle(self, said: messages.FromGuard, size: int) -> None:
        """Handle a message about this transport; `size` is its size in bytes for flow control."""
        match said:
            case messages.BytesReceived(turn=turn, data=data) if (
                turn == self._turn and self._is_open
            ):
                self._arrivals += said.is_new
                self._received(data, size)
            case messages.SendDone(turn=turn, number=number) if turn == self._turn:
                self._sent(number)
            case messages.CountersAdvanced(turn=turn) if turn == self._turn:
                self._counted(said)
            case messages.SendStale(turn=turn) if turn == self._turn:
                self._send_again(said)
            case messages.LineOpened(turn=turn) if turn == self._turn and self._opening is not None:
                self._opened(said.address)
                self._stands(self._name, said.stand, True)
            case messages.OpenFailed(turn=turn) if turn == self._turn and self._opening is not None:
                if not self._opening.done():
                    self._opening.set_result(said.message)
            case messages.SendRefused(turn=turn) if turn == self._turn:
                kind = PeerClosed if said.is_closed else TransportError
                self._sent(said.number, kind(said.message))
            case messages.LineLost(turn=turn, message=message) if turn == self._turn:
                self._end(message)
            case messages.LineClosed(turn=turn) if turn == self._turn:
                self._closed()

    def _opened(self, address: str) -> None:
        self._address = address
        self._is_open = True
        self._ended = ""
        self._sink = None
        self._receiver.clear()
        self._taken_bytes = self._number = self._round = 0
        if self._opening is not None and not self._opening.done():
            self._opening.set_result("")

    def _closed(self) -> None:
        if self._closing is not None and not self._closing.done():
            self._closing.set_result(None)

    def _received(self, data: Payload, size: int) -> None:
        if (
            self._sink is not None
            and not self._receiver
            and isinstance(data, bytes)
            and self._sink(data)
        ):
            self._count(size)
            return
        self._receiver.append((data, size))
        self._arrived.set()

    def _count(self, size: int) -> None:
        """Acknowledge received bytes to the guard in batches."""
        self._taken_bytes += size
        if self._taken_bytes >= _CREDIT_BYTES and self._is_open:
            amount, self._taken_bytes = self._taken_bytes, 0
            self._post(messages.FlowCredit(self._name, self._turn, amount))

    def _enqueue(
        self,
        data: Payload,
        taken: asyncio.Future[None] | None,
        counted: CountedFrame | None = None,
        left: Callable[[Payload], None] | None = None,
    ) -> None:
        self._number += 1
        sent = _Sent(self._number, size_of(data), data, taken, counted, left)
        self._under_way.append(sent)
        self._under_way_bytes += sent.size
        try:  # recorded first, because the reply may arrive immediately
            self._pass(sent, None if counted is None else counted.numbered)
        except UNFIT as fault:
            self._under_way.pop()
            self._under_way_bytes -= sent.size
            raise TransportError(f"this message cannot be passed on ({fault})") from fault

    def _pass(self, sent: _Sent, numbered: Numbered | None) -> None:
        if numbered is not None:
            sent.data = numbered.data
        count = None if numbered is None else numbered.takes
        self._post(
            messages.SendBytes(self._name, self._turn, sent.number, sent.data, count, self._round)
        )

    def _counted(self, said: messages.CountersAdvanced) -> None:
        under_way = (one for one in self._under_way if one.counted is not None)
        is_settled = all(one.number <= said.sent for one in under_way)
        self._stands(self._name, said.stand, is_settled)

    def _send_again(self, said: messages.SendStale) -> None:
        """Render the unsent frames again with the next counter values; keep their order."""
        self._round = this_round = self._round + 1
        self._stands(self._name, said.stand, True)
        again: list[tuple[_Sent, Numbered | None]] = []
        for sent in [one for one in self._under_way if one.number >= said.number]:
            numbered = None if sent.counted is None else sent.counted.again()
            if numbered is not None or sent.counted is None:
                again.append((sent, numbered))
                continue
            log.warning("%s: a frame cannot be rendered with the next counter value", self._address)
            sent.counted = sent.left = None  # settled together with the next sent frame
        # Stops with the numbers after these frames must reach the guard before these frames.
        self._stands(self._name, said.stand, False)
        for sent, numbered in again:
            if self._round != this_round:
                return  # refused again immediately: the newer round has sent the rest
            self._pass(sent, numbered)

    def _sent(self, number: int, fault: TransportError | None = None) -> None:
        while self._under_way and self._under_way[0].number <= number:
            sent = self._under_way.popleft()
            at, size, taken = sent.number, sent.size, sent.taken
            self._under_way_bytes -= size
            if sent.left is not None and fault is None:
                sent.left(sent.data)
            if taken is None:
                if fault is not None and at == number:
                    self._end(str(fault))
                continue
            if taken.done():
                continue
            if fault is not None and at == number:
                taken.set_exception(fault)
            else:
                taken.set_result(None)

    def _end(self, reason: str) -> None:
        """Make all waiting calls fail with a reason; repeated calls keep the first reason."""
        if not self._is_open:
            return
        self._is_open = False
        self._ended = reason
        self._arrived.set()
        for sent in self._under_way:
            if sent.taken is not None and not sent.taken.done():
                sent.taken.set_exception(PeerClosed(reason))
        self._under_way.clear()
        self._under_way_bytes = 0
