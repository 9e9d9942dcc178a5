"""A camera with two streams: the main one, and one with a lower rate for pages on slow lines.

The main stream is the transport's connection. The low stream is opened only on request, and its
failure is only a note in the log. Its access units come in envelopes, so that readings, recordings
and programs get those of the main stream only.
"""

import asyncio
from contextlib import suppress
from typing import Final

from urc.model.payload import Envelope, Payload
from urc.transports._faults import CLOSED
from urc.transports.base import LOW_STREAM, NOTICE, PeerClosed, Transport, TransportError

__all__ = ["TwoStreamCamera"]

_QUEUED: Final = 32
_CONNECT_S: Final = 10.0
_FIRST_WAIT_S: Final = 2.0
_LONGEST_WAIT_S: Final = 60.0


class TwoStreamCamera:
    """The transports of both streams, as one transport."""

    def __init__(self, main: Transport, low: Transport) -> None:
        """Store the closed transports of the streams, which this transport owns."""
        self._main = main
        self._low = low
        self._queue: asyncio.Queue[Payload | PeerClosed] = asyncio.Queue(_QUEUED)
        self._reading: asyncio.Task[None] | None = None
        self._reading_low: asyncio.Task[None] | None = None

    @property
    def address(self) -> str:
        """Address of the main stream in readable form."""
        return self._main.address

    async def open(self, timeout_s: float) -> None:
        """Open the main stream within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        await self._main.open(timeout_s)
        self._queue = asyncio.Queue(_QUEUED)
        self._reading = asyncio.create_task(self._read(self._queue))

    async def receive(self) -> Payload:
        """Return the next access unit, or a notice for the log.

        Raises:
            PeerClosed: the main stream has ended.
        """
        if self._reading is None:
            raise PeerClosed(CLOSED)
        found = await self._queue.get()
        if isinstance(found, PeerClosed):
            raise found
        return found

    async def send(self, data: Payload) -> None:
        """Pause or resume one of the streams; raise `TransportError` for all other data."""
        if not isinstance(data, Envelope) or data.attributes.get("topic") != LOW_STREAM:
            await self._main.send(data)
        elif data.verb == "unsubscribe":
            await self._end_low()
        elif self._reading_low is None and self._reading is not None:
            self._reading_low = asyncio.create_task(self._read_low(self._queue))

    async def close(self) -> None:
        """Close both streams immediately. The method never raises and may be called twice."""
        reading, self._reading = self._reading, None
        if reading is not None:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)
        await self._end_low()
        await self._main.close()
        with suppress(asyncio.QueueFull):
            self._queue.put_nowait(PeerClosed(CLOSED))  # for a reader that still waits

    async def _end_low(self) -> None:
        reading, self._reading_low = self._reading_low, None
        if reading is not None:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)
        await self._low.close()

    async def _read(self, queue: "asyncio.Queue[Payload | PeerClosed]") -> None:
        try:
            while True:
                await queue.put(await self._main.receive())
        except TransportError as fault:
            await queue.put(fault if isinstance(fault, PeerClosed) else PeerClosed(str(fault)))

    async def _read_low(self, queue: "asyncio.Queue[Payload | PeerClosed]") -> None:
        """Pass on the low stream until cancelled; connect again after each failure."""
        wait_s = _FIRST_WAIT_S
        while True:
            try:
                await self._low.open(_CONNECT_S)
                while True:
                    unit = await self._low.receive()
                    is_notice = isinstance(unit, Envelope)
                    wait_s = wait_s if is_notice else _FIRST_WAIT_S
                    await queue.put(unit if is_notice else Envelope(LOW_STREAM, {}, unit))
            except TransportError as fault:
                await queue.put(Envelope(NOTICE, {}, f"low stream: {fault}"))
            await self._low.close()
            await asyncio.sleep(wait_s)
            wait_s = min(_LONGEST_WAIT_S, 2 * wait_s)
