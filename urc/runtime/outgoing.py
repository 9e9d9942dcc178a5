"""What is to be written on one line: joined, bounded, and shown in the traffic once it is written.

Bytes wait for the writer's own task. On a transport that is a `Prompt` they go straight to the
kernel, unless others wait before them. The task, which has time to wait, writes the rest.
"""

import asyncio
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

from urc.model.codec import Counted, Payload, size_of
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.runtime.report import REDACTED, LinkReport
from urc.transports.base import Prompt, Transport

__all__ = ["MAX_QUEUED_BYTES", "STUCK_S", "Outgoing"]

MAX_QUEUED_BYTES = 262_144
"""Bytes that may wait to be written; with more the line is given up, and says so."""
STUCK_S = 5.0
"""A robot that takes no byte for this long is gone."""


class _Waiting(NamedTuple):
    """Something to be written."""

    data: Payload
    shown: Payload
    """What the traffic shows of it."""
    counted: Counted | None = None
    """Its numbers count once it has left: it goes by itself."""


@runtime_checkable
class _Shared(Protocol):
    """A transport on which others send frames with counters, too."""

    def offer_counted(self, counted: Counted, left: Callable[[Payload], None]) -> bool:
        """Pass it on without waiting; return whether it was taken. `left` is told what left."""

    async def send_counted(self, counted: Counted, left: Callable[[Payload], None]) -> None:
        """Pass it on, waiting until it has left."""


class Outgoing:
    """The way out of one line. What does not work ends the connection, through `give_up`."""

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
        """Prepare it.

        Args:
            transport: takes what is written.
            report: shows it.
            hub: knows whether anybody watches.
            clock: the time.
            give_up: ends the connection for a reason.
            is_stream: whether bytes may be joined; else each piece is a datagram or an envelope.
        """
        self._transport = transport
        self._report = report
        self._hub = hub
        self._clock = clock
        self._give_up = give_up
        self._is_stream = is_stream
        self._prompt: Prompt | None = None
        self._shared = transport if isinstance(transport, _Shared) else None
        self._waiting: list[_Waiting] = []
        self._bytes = 0
        self._has_some = asyncio.Event()
        self._is_idle = False
        """Whether the writer waits for something to write."""

    @property
    def is_full(self) -> bool:
        """Whether so much waits that no new command should be taken."""
        return self._bytes > MAX_QUEUED_BYTES // 2

    @property
    def is_written(self) -> bool:
        """Whether everything has been handed over."""
        return not self._bytes

    def reset(self, prompt: Prompt | None = None) -> None:
        """Begin anew, with nothing waiting; `prompt` is the transport, if it is one."""
        self._prompt = prompt
        self._waiting.clear()
        self._bytes = 0
        self._has_some.clear()
        self._is_idle = False

    def put(
        self, data: Payload, *, is_secret: bool = False, counted: Counted | None = None
    ) -> None:
        """Write `data` at once where that needs no waiting, else as soon as the line takes it.

        Secrets are shown to nobody.
        """
        shared = counted if self._shared is not None else None
        item = _Waiting(data, REDACTED if is_secret else data, shared)
        prompt = self._prompt
        is_free = self._is_idle and not self._waiting and not self._has_some.is_set()
        if prompt is not None and is_free and self._offer(prompt, item):
            if prompt.is_clogged:
                self._wait_for_rest()
            return
        size = size_of(data)
        if self._bytes + size > MAX_QUEUED_BYTES:
            dropped = self._bytes + size
            self._give_up(f"the robot takes no more bytes; {dropped} waiting ones were dropped")
            return
        self._waiting.append(item)
        self._bytes += size
        self._has_some.set()

    def _offer(self, prompt: Prompt, item: _Waiting) -> bool:
        if item.counted is not None and self._shared is not None:
            return self._shared.offer_counted(item.counted, partial(self._left, item))
        if not isinstance(item.data, bytes) or not prompt.offer(item.data):
            return False
        self._report.saw("sent", item.shown)
        return True

    def _left(self, item: _Waiting, data: Payload) -> None:
        """Show a frame as it left: with numbers that may be others than those it was made with."""
        self._report.saw("sent", data if item.shown is item.data else item.shown)

    def wake(self) -> None:
        """Let the writer look again: the line is to be closed once all is written."""
        self._has_some.set()

    async def run(self, is_closing: Callable[[], bool]) -> None:
        """Write what waits, until cancelled; give up, for no reason, when all is written and done.

        Raises:
            TransportError: it cannot be written.
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
        """Let the writer see to it that what the kernel has not taken goes, in time."""
        self._waiting.append(_Waiting(b"", b""))
        self._has_some.set()

    def _next(self) -> _Waiting:
        """Take what is sent at once: all of a stream up to a frame with counters, else one item."""
        waiting = self._waiting
        if not self._is_stream or len(waiting) == 1 or waiting[0].counted is not None:
            return waiting.pop(0)
        counted = (place for place, item in enumerate(waiting) if item.counted is not None)
        end = next(counted, len(waiting))
        items, waiting[:end] = waiting[:end], []
        return _Waiting(_joined(item.data for item in items), _joined(i.shown for i in items))

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Give the robot `STUCK_S` to take what is being written."""
        reason = f"the robot has taken no bytes for {STUCK_S:g} s"
        alarm = self._clock.call_at(self._clock.now() + STUCK_S, lambda: self._give_up(reason))
        try:
            yield
        finally:
            alarm.cancel()


def _joined(parts: Iterable[Payload]) -> bytes:
    return b"".join(part for part in parts if isinstance(part, bytes))
