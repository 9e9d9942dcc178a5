"""A transport for ROS robots behind a Foxglove protocol server, such as foxglove_bridge.

Theory of operation. Each connection is one WebSocket with pings, opened by URC's WebSocket
transport. `FoxgloveSession` implements the protocol. The session is discarded with the connection,
so no data can be sent late. Only the record of unfinished goals is kept, so that a STOP after a
reconnection cancels these goals. A task reads continuously, even if messages are consumed slowly,
because the bridge drops a slow client's oldest data. Channels can appear and disappear. Changes are
collected for `_SETTLE_S` seconds, because a broken robot may announce thousands of channels per
second.

When the client announces a topic, the bridge creates a ROS publisher, which ROS connects to the
subscribers only later. Stops are therefore repeated, and topics from earlier connections are
announced again as soon as a connection opens.
"""

import asyncio
from collections.abc import Callable, Collection
from contextlib import suppress
from typing import Final

from urc.model.payload import Envelope, Payload
from urc.transports.base import NOTICE, ConnectFailed, GoalRecord, PeerClosed, TransportError
from urc.transports.ros.foxglove_publishing import PublishedType
from urc.transports.ros.foxglove_session import KNOWN_TOPICS, FoxgloveSession
from urc.transports.ros.foxglove_topics import TopicWish
from urc.transports.ros.goals import UnfinishedGoals
from urc.transports.ros.graph import TopicGraph
from urc.transports.topic_queue import TopicReceiveQueue
from urc.transports.websocket import WebSocketTransport

__all__ = ["DEFAULT_PORT", "FoxgloveTransport"]

DEFAULT_PORT: Final = 8765
_GREETS_S: Final = 3.0
"""Maximum wait for the server information (``serverInfo``), in seconds."""
_SETTLE_S: Final = 0.1
_CHECK_S: Final = 2.0
"""Delay before missing topics are reported, in seconds."""
_CONNECTS_S: Final = 1.0
"""Time that ROS needs to connect a new publisher, in seconds."""
_TURN_S: Final = 0.005
"""Maximum time for reading frames in one turn of the event loop, in seconds."""


class FoxgloveTransport:
    """A reusable transport to one Foxglove protocol server."""

    def __init__(
        self,
        wire: WebSocketTransport,
        where: str,
        wishes: tuple[TopicWish, ...] = (),
        ros: int | None = None,
        goals: UnfinishedGoals | None = None,
        clock_only: bool | None = None,
    ) -> None:
        """Initialise without connecting.

        Args:
            wire: WebSocket transport that offers the subprotocols, owned by this transport.
            where: target in readable form, such as ``192.168.1.5:8765``.
            wishes: topics to subscribe to, without duplicates.
            ros: ROS version declared in the document; None if undeclared.
            goals: record of unfinished goals that other transports share; None for a new record.
            clock_only: see `RobotTime`.
        """
        self._wire = wire
        self._where = where
        self._wishes = wishes
        self._graph = TopicGraph(self._log, ros)
        self._published: dict[tuple[str, str], PublishedType] = {}
        self._goals = UnfinishedGoals() if goals is None else goals
        self._clock_only = clock_only
        self._session: FoxgloveSession | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._greeted = asyncio.Event()
        self._news = asyncio.Event()
        """Event that is set after an announcement from the robot."""
        self._check: asyncio.TimerHandle | None = None
        self._fresh: dict[str, None] = {}
        """Topics whose first message may not have arrived yet."""

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``ros 192.168.1.5:8765``."""
        return f"ros {self._where}"

    def keep_goals(self, record: GoalRecord, changed: Callable[[GoalRecord], None]) -> None:
        """Take over the goals of an earlier process; see `urc.transports.base.SupportsGoals`."""
        self._goals.keep(record, changed)

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End unanswered cancellations of all goals; see `urc.transports.base.SupportsGoals`."""
        for action in self._goals.owed(actions):
            if self._session is not None:
                self._session.drop_cancellation(action)
            self._goals.drop(action)

    async def open(self, timeout_s: float) -> None:
        """Connect and subscribe within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        await self._wire.open(timeout_s)
        await self.begin(timeout_s)

    async def begin(self, timeout_s: float) -> None:
        """Start the protocol on the open WebSocket; raise `ConnectFailed` on failure."""
        loop = asyncio.get_running_loop()
        self._greeted.clear()
        self._news.clear()
        self._fresh.clear()
        session = self._session = FoxgloveSession(
            TopicReceiveQueue(),
            self._wishes,
            self._graph,
            call_at=loop.call_at,
            clock=loop.time,
            published=self._published,
            goals=self._goals,
            clock_only=self._clock_only,
            flush=self._news.set,
        )
        self._tasks = [
            asyncio.create_task(self._read(session)),
            asyncio.create_task(self._settle(session)),
        ]
        try:
            async with asyncio.timeout(min(timeout_s, _GREETS_S)):
                await self._greeted.wait()
                await self._flush(session)
        except (TimeoutError, TransportError) as fault:
            why = session.queue.ended or str(fault) or "it sent no server information"
            await self.close()
            raise ConnectFailed(f"{self._where} is not a Foxglove server ({why})") from fault
        except BaseException:
            await self.close()
            raise
        self._wire.gather()
        if self._wishes:
            self._check = loop.call_later(_CHECK_S, session.check_topics)

    async def receive(self) -> Envelope:
        """Return the next message, definition or response; raise `PeerClosed` after the last."""
        if self._session is None:
            raise PeerClosed("the connection is closed")
        return await self._session.queue.pop()

    async def send(self, data: Payload) -> None:
        """Publish a message or call a service; return when the kernel has accepted the data.

        Raises:
            PeerClosed: the connection broke.
            TransportError: the bridge does not support `data`.
        """
        session = self._session
        if session is None:
            raise PeerClosed("the connection is closed")
        if not isinstance(data, Envelope):
            raise TransportError("ros carries messages, not bytes; use publish or call")
        session.perform(data)
        if data.verb == "publish" and len(self._fresh) < KNOWN_TOPICS:
            self._fresh[str(data.attributes.get("topic"))] = None
        await self._flush(session)

    async def close(self) -> None:
        """Close the connection immediately, discarding unsent data.

        The method never raises and may be called twice.
        """
        try:
            await self._end()
        finally:
            await self._wire.close()

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        try:
            await self._end()
        finally:
            await self._wire.abort()

    async def settle(self) -> str:
        """Wait until the first message of every topic has reached its subscribers.

        Returns:
            A line that lists the topics without subscribers, or "".
        """
        topics = list(self._fresh)
        self._fresh.clear()
        session = self._session
        if not topics or session is None:
            return ""
        await asyncio.sleep(_CONNECTS_S)
        lost = [topic for topic in topics if session.listeners(topic) == ()]
        return f"nothing subscribes to {', '.join(lost)}" if lost else ""

    async def probe(self) -> None:
        """Probe the bridge; return when the bridge sends data."""
        await self._wire.probe()

    def arrivals(self) -> int:
        """Return the number of frames that have arrived over this connection."""
        return 0 if self._session is None else self._session.queue.arrivals

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return self._wire.unsent()

    # -- the reader

    async def _end(self) -> None:
        session, self._session = self._session, None
        if self._check is not None:
            self._check.cancel()
        if session is not None:
            session.queue.end("the connection is closed")
        tasks, self._tasks = self._tasks, []
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _read(self, session: FoxgloveSession) -> None:
        """Process received frames until the connection ends."""
        clock = asyncio.get_running_loop().time
        began_s = clock()
        try:
            while True:
                frame = await self._wire.receive()
                session.arrived(frame)
                if frame[0] == ord("{"):
                    self._news.set()
                    if session.is_greeted:
                        self._greeted.set()
                # Buffered frames need no waiting, and some take a long time to parse.
                if session.queue.is_filling or clock() - began_s > _TURN_S:
                    await asyncio.sleep(0)
                    began_s = clock()
        except TransportError as ended:
            session.queue.end(str(ended))
            self._greeted.set()

    async def _settle(self, session: FoxgloveSession) -> None:
        """Subscribe to topics after each announcement from the robot, until cancelled."""
        with suppress(TransportError):  # the reader reports the end of the connection
            while True:
                await self._news.wait()
                self._news.clear()
                session.reconcile()
                await self._flush(session)
                await asyncio.sleep(_SETTLE_S)

    async def _flush(self, session: FoxgloveSession) -> None:
        for frame, is_text in session.written():
            await self._wire.write(frame, is_text=is_text)

    def _log(self, fault: str) -> None:
        if self._session is not None:
            self._session.queue.answer(Envelope(NOTICE, {}, fault))
