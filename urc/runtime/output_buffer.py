"""The output buffer of one transport: a bounded queue that reports written data as traffic.

With an empty buffer, a `Prompt` transport passes bytes directly to the kernel. All other bytes wait
until the writer task sends them; this task may wait for the transport.
"""

import asyncio
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

from urc.model.payload import CountedFrame, Payload, size_of
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.runtime.link_report import REDACTED, LinkReport
from urc.transports.base import Prompt, Transport

__all__ = ["MAX_QUEUED_BYTES", "STUCK_S", "OutputBuffer"]

MAX_QUEUED_BYTES = 262_144
"""Maximum size of the buffer, in bytes; beyond it, the connection is closed with a message.
"""
STUCK_S = 5.0
"""Time without accepted bytes after which the connection counts as stalled, in seconds."""


class _BufferedOutput(NamedTuple):
    """One entry of the output buffer."""

    data: Payload
    shown: Payload
    """Redacted payload to report as traffic."""
    counted: CountedFrame | None = None
    """Frame with counters, or None. The frame is never joined with other data, because sending may
    change the counters.
    """


@runtime_checkable
class _Shared(Protocol):
    """A transport that can also send frames with counters through the guard."""

    def offer_counted(self, counted: CountedFrame, left: Callable[[Payload], None]) -> bool:
        """Send a frame with counters without waiting; return whether the frame was accepted.

        The callback `left` receives the sent frame.
        """

    async def send_counted(self, counted: CountedFrame, left: Callable[[Payload], None]) -> None:
        """Send a frame with counters; wait until the frame is sent.

        The callback `left` receives the sent frame.
        """


class OutputBuffer:
    """The output buffer of one transport.

    An overflow or a stall ends the connection by calling `give_up`.
    """

    def __init__(
        self,
        transport: Transport,
        report: LinkReport,
        hub: Hub,
        clock: Clock,
        give_up: Callable[[str], None],
        *,
        is_stream: bool,
    ) -> None:
        """Prepare the buffer.

        Args:
            transport: destination of the bytes.
            report: the `LinkReport` that publishes the written data as traffic.
            hub: hub of the session, which counts the traffic readers.
            clock: source of time.
            give_up: function that ends the connection for the given reason.
            is_stream: whether bytes may be joined; if false, each piece is a datagram or a message.
        """
        self._transport = transport
        self._report = report
        self._hub = hub
        self._clock = clock
        self._give_up = give_up
        self._is_stream = is_stream
        self._prompt: Prompt | None = None
        self._shared = transport if isinstance(transport, _Shared) else None
        self._waiting: list[_BufferedOutput] = []
        self._bytes = 0
        self._has_some = asyncio.Event()
        self._is_idle = False
        """Whether the writer task waits because the buffer is empty."""

    @property
    def is_full(self) -> bool:
        """Whether the buffer is too full for new commands."""
        return self._bytes > MAX_QUEUED_BYTES // 2

    @property
    def is_written(self) -> bool:
        """Whether all data has been passed to the transport."""
        return not self._bytes

    def reset(self, prompt: Prompt | None = None) -> None:
        """Empty the buffer; `prompt` is the transport if it writes without waiting, else None."""
        self._prompt = prompt
        self._waiting.clear()
        self._bytes = 0
        self._has_some.clear()
        self._is_idle = False

    def write(
        self, data: Payload, *, is_secret: bool = False, counted: CountedFrame | None = None
    ) -> None:
        """Write `data` immediately if possible, otherwise as soon as the transport accepts it.

        Secret data is hidden from the traffic view.
        """
        shared = counted if self._shared is not None else None
        item = _BufferedOutput(data, REDACTED if is_secret else data, shared)
        prompt = self._prompt
        is_free = self._is_idle and not self._waiting and not self._has_some.is_set()
        if prompt is not None and is_free and self._offer(prompt, item):
            if prompt.is_clogged:
                self._wait_for_rest()
            return
        size = size_of(data)
        if self._bytes + size > MAX_QUEUED_BYTES:
            dropped = self._bytes + size
            self._give_up(f"the robot accepts no more bytes; {dropped} queued bytes were dropped")
            return
        self._waiting.append(item)
        self._bytes += size
        self._has_some.set()

    def _offer(self, prompt: Prompt, item: _BufferedOutput) -> bool:
        if item.counted is not None and self._shared is not None:
            return self._shared.offer_counted(item.counted, partial(self._left, item))
        if not isinstance(item.data, bytes) or not prompt.offer(item.data):
            return False
        self._report.saw("sent", item.shown)
        return True

    def _left(self, item: _BufferedOutput, data: Payload) -> None:
        """Report the frame that was sent; its counters may differ from the rendered frame's."""
        self._report.saw("sent", data if item.shown is item.data else item.shown)

    def wake(self) -> None:
        """Wake the writer, because the connection must close once all data is written."""
        self._has_some.set()

    async def run(self, is_closing: Callable[[], bool]) -> None:
        """Write until cancelled; on a closing connection, call `give_up` after the last write.

        Raises:
            TransportError: writing failed.
        """
        while True:
            self._is_idle = True
            await self._has_some.wait()
            self._is_idle = False
            self._has_some.clear()
            while self._waiting:
                item = self._next()
                with self._watched():
                    if item.counted is not None and self._shared is not None:
                        await self._shared.send_counted(item.counted, partial(self._left, item))
                    else:
                        await self._transport.send(item.data)
                        self._report.saw("sent", item.shown)
                self._bytes -= size_of(item.data)
            if is_closing() and not self._waiting:
                self._give_up("")

    def _wait_for_rest(self) -> None:
        """Let the writer wait for the kernel to accept the remaining data, with a time limit."""
        self._waiting.append(_BufferedOutput(b"", b""))
        self._has_some.set()

    def _next(self) -> _BufferedOutput:
        """Return the next data to write: stream data up to a frame with counters, or one entry."""
        waiting = self._waiting
        if not self._is_stream or len(waiting) == 1 or waiting[0].counted is not None:
            return waiting.pop(0)
        counted = (place for place, item in enumerate(waiting) if item.counted is not None)
        end = next(counted, len(waiting))
        items, waiting[:end] = waiting[:end], []
        return _BufferedOutput(
            _joined(item.data for item in items), _joined(i.shown for i in items)
        )

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Call `give_up` if the robot does not accept the bytes within `STUCK_S` seconds."""
        reason = f"the robot has accepted no bytes for {STUCK_S:g} s"
        alarm = self._clock.call_at(self._clock.now() + STUCK_S, lambda: self._give_up(reason))
        try:
            yield
        finally:
            alarm.cancel()


def _joined(parts: Iterable[Payload]) -> bytes:
    return b"".join(part for part in parts if isinstance(part, bytes))
