"""Server-Sent Events of one robot: the newest values of changed signals.

Layer 5. No values are queued for a reader. When a reader's connection is free, the reader gets the
newest value of each signal that changed since its last event. A slow reader skips values, without
delaying other readers. Source of the format: HTML standard, section 9.2 “Server-sent events”.
"""

import asyncio
import logging
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager, suppress
from time import time
from typing import Final

import msgspec
from starlette.types import Receive, Scope, Send

from urc.runtime.clock import Clock, within
from urc.runtime.hub import Hub
from urc.web.api.readings import values_of
from urc.web.api.wire import SignalValues
from urc.web.fleet.robots import LiveSession

__all__ = ["BEAT_S", "EVENTS_PER_S", "STALL_S", "EventStream"]

EVENTS_PER_S: Final = 30.0
"""Maximum number of events per second and reader."""
BEAT_S: Final = 5.0
"""Interval between keep-alive comments on a quiet stream, in seconds."""
STALL_S: Final = 15.0
"""Time after which an unresponsive reader is disconnected, in seconds."""
_HEADERS: Final = [
    (b"content-type", b"text/event-stream"),
    (b"cache-control", b"no-store"),
    (b"x-accel-buffering", b"no"),  # prevents nginx from delaying the events
]
_COMMENT: Final = b": beat\n\n"

log = logging.getLogger(__name__)


class EventStream:
    """A response that ends with the session, or when the reader disconnects or loses its right."""

    def __init__(
        self,
        live: LiveSession,
        signals: Collection[str],
        clock: Clock,
        *,
        may_read: Callable[[], bool],
        followed: Callable[[Callable[[], None]], AbstractContextManager[None]],
        visit: AbstractContextManager[None],
    ) -> None:
        """Create the response.

        Args:
            live: the open session.
            signals: names of the signals to send.
            clock: clock from which the ages of the readings are computed.
            may_read: function that returns whether the visitor may still read.
            followed: function that takes a callback and returns a context. While the context is
                open, the callback is called after each change of rights.
            visit: context that keeps the robot's session open.
        """
        self._live = live
        self._signals = frozenset(signals)
        self._clock = clock
        self._may_read = may_read
        self._followed = followed
        self._visit = visit
        self._news = asyncio.Event()
        self._reason = ""
        """Reason why the stream ended; "" while the stream is open."""
        self._revoked = asyncio.Event()
        self._seen = 0
        """Hub revision of the last sent event."""
        self._links = -1
        """Number of connection state changes up to the last event with connection states."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send events until the reader disconnects, its right ends or the session ends."""
        await send({"type": "http.response.start", "status": 200, "headers": _HEADERS})
        if scope["method"] == "HEAD":  # a HEAD response has no body
            await send({"type": "http.response.body", "body": b""})
            return
        with self._visit, self._followed(self._recheck):
            self._recheck()
            writing = asyncio.ensure_future(self._write(send))
            leaving = asyncio.ensure_future(_left(receive))
            revoked = asyncio.ensure_future(self._revoked.wait())
            closing = asyncio.ensure_future(scope["state"]["closing"].wait())
            tasks = (writing, leaving, revoked, closing)
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                outcome, *_ = await asyncio.gather(*tasks, return_exceptions=True)
        if leaving.done() and not leaving.cancelled():
            return
        if closing.done() and not closing.cancelled():
            self._reason = "the server is shutting down"
        if not isinstance(outcome, TimeoutError):
            # This is the last event. An unresponsive reader gets some time to receive it.
            body = _event("end", {"reason": self._reason})
            with suppress(TimeoutError):
                async with asyncio.timeout(STALL_S):
                    await send({"type": "http.response.body", "body": body})
                    return
        log.warning("a stream was not read for %g s and was disconnected", STALL_S)
        abort: Callable[[], None] = scope["state"]["abort"]
        abort()
        await asyncio.sleep(0)  # lets the server notice the closed connection

    def _recheck(self) -> None:
        if not self._may_read():
            self._reason = "your sign-in or your right to watch has ended"
            self._revoked.set()

    async def _write(self, send: Send) -> None:
        wake = self._news.set
        place = self._live.fanout.join(wake)
        try:
            while True:
                self._news.clear()
                chunk = self._newest()
                if chunk:
                    await _send(send, chunk)
                if self._live.ended.is_set():
                    self._reason = "the session of the robot has ended"
                    return
                await self._clock.sleep(1 / EVENTS_PER_S)
                try:
                    async with within(self._clock, BEAT_S):
                        await self._news.wait()
                except TimeoutError:
                    await _send(send, _COMMENT)
        finally:
            self._live.fanout.leave(wake, place)

    def _newest(self) -> bytes:
        """Return events with all changes since the last call; b"" if nothing has changed."""
        hub, events = self._live.session.hub, b""
        if self._links != hub.links_count:
            self._links = hub.links_count
            events += _event("connections", _connections(hub))
        changed = [one.signal for one in hub.changed_since(self._seen)]
        self._seen = hub.revision
        values = values_of(hub, self._signals.intersection(changed), self._clock.now())
        if values:
            events += _event("values", SignalValues(time(), values))
        return events


async def _send(send: Send, chunk: bytes) -> None:
    async with asyncio.timeout(STALL_S):
        await send({"type": "http.response.body", "body": chunk, "more_body": True})


async def _left(receive: Receive) -> None:
    """Wait until the reader has disconnected."""
    while (await receive())["type"] != "http.disconnect":
        pass


def _connections(hub: Hub) -> dict[str, str]:
    return {name: link.state for name, link in hub.links.items()}


def _event(name: str, value: object) -> bytes:
    return b"event: %s\ndata: %s\n\n" % (name.encode(), msgspec.json.encode(value))
