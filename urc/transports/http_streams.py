"""Streams from a robot over HTTP: images, events and lines. Each stream runs as a task.

While the transport is open, a failed stream is requested again after increasing delays. Only the
first failure and the recovery are logged. The connection ends only if the robot refuses connections
and has sent no data for `_GONE_S` seconds.
"""

import asyncio
import logging
import random
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from types import TracebackType
from typing import Final, NamedTuple

import httpx2

from urc.transports.base import TopicSubscription, TransportError
from urc.transports.http_body import fault_of, read_body
from urc.transports.http_client import HttpClient, HttpFault
from urc.transports.http_events import Event, EventStreamParser, LineSplitter
from urc.transports.http_multipart import MultipartFault, MultipartParser, boundary_of
from urc.transports.http_receive_queue import HttpReceiveQueue

__all__ = ["SHORTEST_RETRY_S", "LastActivity", "HttpStream", "StreamSpec", "streams_of"]

KINDS: Final = ("mjpeg", "stills", "sse", "lines")
MAX_STREAMS: Final = 16
MAX_EVENT_BYTES: Final = 262_144
SILENCE_S: Final = 5.0
"""Timeout for the next image, in seconds; afterwards, the stream is requested again."""
_FIRST_WAIT_S: Final = 0.5
_LONGEST_WAIT_S: Final = 5.0
SHORTEST_RETRY_S: Final = 0.2
"""Minimum delay before a retry, in seconds, even if the robot requests a shorter delay."""
_LONGEST_RETRY_S: Final = 60.0
_NO_MORE: Final = 204
_GONE_S: Final = 2.0
"""Time without data from the robot, in seconds, after which a refused connection means that the
robot is unreachable."""

log = logging.getLogger(__name__)


class StreamSpec(NamedTuple):
    """One stream that the driver's messages require."""

    kind: str
    path: str
    every_s: float
    topics: frozenset[str]
    """All topics of the stream's path; a topic ``PATH#NAME`` receives only the events named
    ``NAME``."""


def streams_of(subscriptions: Sequence[TopicSubscription]) -> list[StreamSpec]:
    """Return the streams for all subscriptions; several topics may share one stream.

    Raises:
        TransportError: a subscription is impossible over HTTP.
    """
    found: dict[str, StreamSpec] = {}
    for topic, how in subscriptions:
        kind, every_s = how.get("stream"), how.get("every", 1.0)
        path, _, event = topic.partition("#")
        if kind not in KINDS:
            words = "mjpeg, stills, sse or lines"
            raise TransportError(f"http: 'stream' of {topic!r} must be {words}, not {kind!r}")
        if event and kind != "sse":
            raise TransportError(
                f"http supports named events only in streams of type sse: {topic!r}"
            )
        if not isinstance(every_s, int | float) or not 0.01 <= every_s <= 3600:
            raise TransportError(
                f"http: 'every' of {topic!r} must be from 10ms to 1h, not {every_s!r}"
            )
        spec = StreamSpec(str(kind), path, float(every_s), frozenset({topic}))
        known = found.setdefault(path, spec)
        if (known.kind, known.every_s) != (spec.kind, spec.every_s):
            raise TransportError(f"http cannot open {path!r} as two different streams")
        found[path] = known._replace(topics=known.topics | {topic})
    if len(found) > MAX_STREAMS:
        raise TransportError(f"http supports at most {MAX_STREAMS} streams")
    return list(found.values())


class LastActivity:
    """Time at which the robot last sent data on any connection."""

    def __init__(self) -> None:
        self._clock = asyncio.get_running_loop().time
        self._beat_s = self._clock()

    def heartbeat(self) -> None:
        """Record that the robot has sent data now."""
        self._beat_s = self._clock()

    @property
    def silence_s(self) -> float:
        """Time since data last arrived, in seconds."""
        return self._clock() - self._beat_s


class HttpStream:
    """One stream of an open transport; `run` requests the stream again after each failure."""

    def __init__(
        self,
        spec: StreamSpec,
        client: HttpClient,
        queue: HttpReceiveQueue,
        pulse: LastActivity,
        max_body_bytes: int,
    ) -> None:
        """Initialise the stream.

        Args:
            spec: kind, path and topics of the stream.
            client: HTTP client that makes the requests.
            queue: queue that receives the stream's images, events or lines.
            pulse: record of the time at which the robot last sent data.
            max_body_bytes: maximum size of one image, in bytes.
        """
        self._spec = spec
        self._client = client
        self._queue = queue
        self._pulse = pulse
        self._max_bytes = max_body_bytes
        self._wait_s = _FIRST_WAIT_S
        self._failures = 0
        self._last_id = ""
        self._retry_s: float | None = None
        self._is_over = False

    async def run(self) -> None:
        """Request the stream repeatedly, until the robot ends the stream permanently."""
        once = {"mjpeg": self._mjpeg, "stills": self._still, "sse": self._sse, "lines": self._lines}
        clock = asyncio.get_running_loop().time
        while not self._is_over:
            began_s = clock()
            try:
                await once[self._spec.kind]()
            except (HttpFault, MultipartFault) as fault:
                self._fail(fault)
            is_still = self._spec.kind == "stills" and not self._failures
            await asyncio.sleep(
                max(0.0, began_s + self._spec.every_s - clock()) if is_still else self._pause_s()
            )

    async def _mjpeg(self) -> None:
        # An occasional byte keeps the response alive, but is not an image.
        patience = _ExtendableTimeout(SILENCE_S, "no picture")
        async with self._open({}, SILENCE_S) as response, patience:
            boundary = boundary_of(response.headers.get("content-type", ""))
            cutter = MultipartParser(boundary, self._max_bytes)
            async for piece in response.aiter_raw():
                parts = [part for part in cutter.feed(piece) if part]
                if parts:
                    self._came()
                    patience.extend()
                for part in parts:
                    self._queue.picture(self._topic, part)
        raise HttpFault("the robot ended the stream")

    async def _still(self) -> None:
        async with self._open({}, SILENCE_S) as response:
            body = await read_body(response, self._max_bytes)
            if body:
                self._came()
                self._queue.picture(self._topic, body)

    async def _sse(self) -> None:
        headers = {"Accept": "text/event-stream", "Cache-Control": "no-store"}
        if self._last_id:
            headers["Last-Event-ID"] = self._last_id
        async with self._open(headers, None) as response:
            if response.status_code == _NO_MORE:
                self._is_over = True
                return
            kind = response.headers.get("content-type", "no Content-Type")
            if not kind.startswith("text/event-stream"):
                raise HttpFault(f"the response is {kind[:80]}, not text/event-stream")
            cutter = EventStreamParser(MAX_EVENT_BYTES, self._last_id)
            async for piece in response.aiter_raw():
                for event in cutter.feed(piece):
                    self._came()
                    await self._deliver(event)
                self._last_id = cutter.last_id
                if cutter.retry_s is not None:
                    wish_s = min(cutter.retry_s, _LONGEST_RETRY_S)
                    self._retry_s = max(wish_s, SHORTEST_RETRY_S)

    async def _lines(self) -> None:
        async with self._open({}, None) as response:
            cutter = LineSplitter(MAX_EVENT_BYTES)
            async for piece in response.aiter_raw():
                for line in cutter.feed(piece):
                    await self._line(line)
            await self._line(cutter.end())

    async def _line(self, line: bytes) -> None:
        if line:
            self._came()
            await self._queue.event({"topic": self._topic}, line)

    async def _deliver(self, event: Event) -> None:
        """Pass an event to the topic named after the event, or else to the path's topic."""
        named = f"{self._spec.path}#{event.name}"
        topic = named if named in self._spec.topics else self._spec.path
        if topic in self._spec.topics:
            attributes = {"topic": topic, "event": event.name, "id": event.id}
            await self._queue.event(attributes, event.data)

    @asynccontextmanager
    async def _open(
        self, headers: Mapping[str, str], silence_s: float | None
    ) -> AsyncIterator[httpx2.Response]:
        request = self._client.request("GET", self._spec.path, headers, None)
        # The response header has a timeout even if the stream may be silent for hours.
        head = _ExtendableTimeout(SILENCE_S if silence_s is None else 2 * silence_s, "no answer")
        async with head, self._client.answer(request, silence_s) as response:
            head.lift()
            self._pulse.heartbeat()
            if reason := await fault_of(response):
                raise HttpFault(reason)
            yield response

    @property
    def _topic(self) -> str:
        return self._spec.path

    @property
    def _shown(self) -> str:
        """The stream's name in readable form."""
        return f"http {self._client.where} {self._spec.path}"

    def _pause_s(self) -> float:
        """Return the growing, randomly varied delay before the next attempt, in seconds."""
        if self._retry_s is not None and not self._failures:
            return self._retry_s
        wait_s, self._wait_s = self._wait_s, min(2 * self._wait_s, _LONGEST_WAIT_S)
        return wait_s * (1 - 0.25 * random.random())  # noqa: S311 - spreads attempts, no secret

    def _came(self) -> None:
        """Record that valid data has arrived on this stream."""
        self._pulse.heartbeat()
        self._wait_s = _FIRST_WAIT_S
        if self._failures:
            log.info("%s: recovered after %d failures", self._shown, self._failures)
            self._failures = 0

    def _fail(self, fault: Exception) -> None:
        self._failures += 1
        if self._failures == 1:
            log.warning("%s: %s; trying again", self._shown, fault)
        is_gone = isinstance(fault, HttpFault) and fault.is_unreachable
        if is_gone and self._pulse.silence_s > _GONE_S:
            self._queue.end(str(fault))


class _ExtendableTimeout:
    """An extendable timeout that raises `HttpFault`."""

    def __init__(self, limit_s: float, lack: str) -> None:
        self._limit_s = limit_s
        self._lack = lack
        self._timeout = asyncio.timeout(limit_s)

    async def __aenter__(self) -> None:
        await self._timeout.__aenter__()

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        fault: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            await self._timeout.__aexit__(kind, fault, trace)
        except TimeoutError as late:
            raise HttpFault(f"{self._lack} within {self._limit_s:g} s") from late

    def extend(self) -> None:
        """Restart the timeout."""
        self._timeout.reschedule(asyncio.get_running_loop().time() + self._limit_s)

    def lift(self) -> None:
        self._timeout.reschedule(None)
