"""A transport for ROS 1 and ROS 2 robots behind a rosbridge server: topics, services and actions.

Theory of operation. Each connection is one WebSocket with pings, opened by URC's WebSocket
transport. The protocol over the WebSocket is implemented by roslibpy
(`urc.transports.ros.rosbridge_client`). roslibpy's objects are discarded with the connection, so no
data can be sent late. Only the ids of unfinished goals are kept, so that a STOP after a
reconnection cancels these goals. A task reads continuously, even if messages are consumed slowly,
because one stalled reader would freeze the topic for every client of the bridge.

A cancellation is sent again until the goal's result arrives, on each later connection too. A bridge
starts goals and cancellations in threads of their own. The bridge drops a cancellation that it
handles before the goal, and confirms nothing.

A bridge delivers the first message on a topic only after the bridge's publisher has connected to
the subscribers. If the client disconnects before that moment, the bridge drops the message. Clients
therefore call `settle` before disconnecting: the method queries rosapi and waits for the
subscribers. The reply from rosapi also shows that the bridge has processed all earlier data.

The bridge reports no errors. A topic without a publisher, a wrong type and an access restriction
all result in missing messages. The transport therefore requests the list of topics from rosapi when
the connection opens. The transport also requests a topic's subscribers when the topic's first
message is published. `urc.transports.ros.graph` reports mistakes. With ``version: auto``,
subscriptions wait for the list of topics, which determines the form of the type names.
"""

import asyncio
import logging
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, Final, Literal

from urc._extras import missing
from urc.model.payload import Envelope, Payload
from urc.model.values import Value
from urc.transports.base import (
    NOTICE,
    TOPICS,
    ConnectFailed,
    GoalRecord,
    MissingPackage,
    PeerClosed,
    TransportError,
)
from urc.transports.ros.goals import UnfinishedGoals
from urc.transports.ros.graph import TopicGraph, version_of
from urc.transports.ros.rosapi_topics import RosapiTopics
from urc.transports.ros.rosbridge_cancellations import ActionCancellations, CancelWire
from urc.transports.ros.rosbridge_cells import LARGE_BYTES, packed_operation
from urc.transports.ros.rosbridge_client import KNOWN_TOPICS, RosClient, RosSubscription
from urc.transports.ros.rosbridge_operations import BadOperation, OperationReader
from urc.transports.ros.topic_list import QUIET_S
from urc.transports.topic_queue import TopicReceiveQueue
from urc.transports.websocket import WebSocketTransport

__all__ = ["AUTO", "DEFAULT_PORT", "RosbridgeTransport", "merged", "subscription"]

DEFAULT_PORT = 9090
AUTO: Final = "auto"
_ANSWER_S = 3.0
"""Maximum wait for a reply from rosapi, in seconds; afterwards, rosapi is considered missing."""
_PART = 0.5
"""Maximum fraction of the connection timeout that may be spent waiting for rosapi's reply."""
_CONNECTS_S = 1.0
"""Time for which a bridge keeps a message for new subscribers, in seconds."""
_LOOK_S = 0.2

_TURN_S = 0.005
"""Maximum time for reading frames in one turn of the event loop, in seconds."""

log = logging.getLogger(__name__)


class RosbridgeTransport:
    """A reusable transport to one rosbridge server."""

    def __init__(
        self,
        wire: WebSocketTransport,
        where: str,
        subscriptions: tuple[RosSubscription, ...] = (),
        ros: int | Literal["auto"] | None = None,
        goals: UnfinishedGoals | None = None,
        spare: Callable[[], CancelWire] | None = None,
        clock_only: bool | None = None,
    ) -> None:
        """Initialise without connecting.

        Args:
            wire: WebSocket transport to the bridge, owned by this transport.
            where: target in readable form, such as ``192.168.1.5:9090``.
            subscriptions: subscriptions to make whenever the connection opens, one per topic.
            ros: ROS version, 1 or 2, which determines the form of type names; "auto" for the
                bridge's version; None to keep names as written.
            goals: record of unfinished goals that other transports share; None for a new record.
            spare: function that returns a new transport to the same bridge, for calls that may
                block a connection; None to make no such calls.
            clock_only: see `RobotTime`.
        """
        self._wire = wire
        self._spare = spare
        self._where = where
        self._subscriptions = subscriptions
        self._ros = ros
        self._clock_only = clock_only
        self._session: _Session | None = None
        self._graph = TopicGraph(self._log, None if ros == AUTO else ros)
        self._goals = UnfinishedGoals() if goals is None else goals

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``ros 192.168.1.5:9090``."""
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
        """Subscribe over the open WebSocket; raise `ConnectFailed` on failure."""
        packed = frozenset(one.topic for one in self._subscriptions if one.is_packed)
        session = self._session = _Session(
            self._wire,
            self._ros,
            self._graph,
            self._goals,
            packed,
            self._spare,
            self._clock_only,
        )
        try:
            async with asyncio.timeout(timeout_s):
                await session.start(self._subscriptions, min(_ANSWER_S, timeout_s * _PART))
        except BaseException as fault:
            self._session = None
            await session.end()
            await self._wire.close()
            if isinstance(fault, PeerClosed | TimeoutError):
                told = str(fault) or "it does not accept data"
                message = f"{self._where} refused the subscriptions ({told})"
                raise ConnectFailed(message) from fault
            raise

    async def receive(self) -> Envelope:
        """Return the next message, response or feedback; raise `PeerClosed` after the last."""
        if self._session is None:
            raise PeerClosed("the connection is closed")
        return await self._session.queue.pop()

    async def send(self, data: Payload) -> None:
        """Send a message, a service call or a goal operation; return once the kernel has the data.

        Raises:
            PeerClosed: the connection broke.
            TransportError: rosbridge cannot send `data`.
        """
        if self._session is None:
            raise PeerClosed("the connection is closed")
        if not isinstance(data, Envelope):
            raise TransportError("rosbridge carries messages, not bytes; use publish or call")
        await self._session.perform(data)

    async def close(self) -> None:
        """Close the connection immediately, discarding unsent data.

        The method never raises and may be called twice.
        """
        session, self._session = self._session, None
        try:
            if session is not None:
                await session.end()
        finally:
            await self._wire.close()

    async def settle(self) -> str:
        """Wait until the first message of every topic has reached its subscribers.

        Returns:
            A line that lists the topics without subscribers, or "".
        """
        return "" if self._session is None else await self._session.settle()

    async def probe(self) -> None:
        """Probe the bridge; return when the bridge sends data."""
        await self._wire.probe()

    def arrivals(self) -> int:
        """Return the number of frames that have arrived over this connection."""
        return 0 if self._session is None else self._session.queue.arrivals

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return self._wire.unsent()

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        session, self._session = self._session, None
        try:
            if session is not None:
                await session.end()
        finally:
            await self._wire.abort()

    def _log(self, fault: str) -> None:
        if self._session is not None:
            self._session.queue.answer(Envelope(NOTICE, {}, fault))


def subscription(topic: str, attributes: Mapping[str, Value]) -> RosSubscription:
    """Return the subscription to a topic, with options from the document.

    Raises:
        TransportError: an option is invalid.
        MissingPackage: the extra for `compression: cbor` is not installed.
    """

    def number(name: str, factor: float = 1) -> int:
        value = attributes.get(name) or 0
        if isinstance(value, bool) or not isinstance(value, int | float) or value < 0:
            raise TransportError(
                f"ros: {name} of {topic} must be a non-negative number, not {value!r}"
            )
        return round(value * factor)

    compression = attributes.get("compression") or "none"
    if compression not in ("none", "png", "cbor"):
        text = f"ros: compression of {topic} must be none, png or cbor, not {compression!r}"
        raise TransportError(text)
    if compression == "cbor" and find_spec("cbor2") is None:
        raise MissingPackage(missing("cbor needs", "cbor2", "cbor"))
    return RosSubscription(
        topic,
        str(attributes.get("type") or ""),
        number("throttle", 1000),
        number("queue_length"),
        str(compression),
        attributes.get("packed") is True,
    )


def merged(wanted: list[RosSubscription]) -> tuple[RosSubscription, ...]:
    """Merge subscriptions to one topic; a second subscription would replace the first throttle."""
    found: dict[str, RosSubscription] = {}
    for one in wanted:
        other = found.setdefault(one.topic, one)
        if other is not one:
            found[one.topic] = one._replace(
                type=other.type or one.type,
                throttle_ms=min(other.throttle_ms, one.throttle_ms),
                queue_length=max(other.queue_length, one.queue_length),
                compression="none" if "none" in (one.compression, other.compression) else other[4],
            )
    return tuple(found.values())


class _Session:
    """The state of one open rosbridge connection."""

    def __init__(
        self,
        wire: WebSocketTransport,
        ros: int | Literal["auto"] | None,
        graph: TopicGraph,
        goals: UnfinishedGoals,
        packed: frozenset[str],
        spare: Callable[[], CancelWire] | None,
        clock_only: bool | None,
    ) -> None:
        self.queue = TopicReceiveQueue()
        self._wire = wire
        clock = asyncio.get_running_loop().time
        version = None if ros == AUTO else ros
        self._client = RosClient(self.queue, version, goals, clock, clock_only)
        self._cancelled = asyncio.Event()
        """Event that is set after goals were cancelled."""
        self._canceller: asyncio.Task[None] | None = None
        self._goals = goals
        self._told: set[str] = set()
        self._all: ActionCancellations | None = None
        if spare is not None and ros != 1:
            client = self._client
            answered = client.all_cancelled
            self._all = ActionCancellations(spare, client.owes, answered, self._tell, goals)
        self._is_auto = ros == AUTO
        self._frames = OperationReader(packed)
        self._packed = packed
        self._graph = graph
        self._learnt = asyncio.Event()
        """Event that is set after rosapi has listed the topics, or has failed."""
        self._bad = 0
        self._reader: asyncio.Task[None] | None = None
        self._fresh: dict[str, None] = {}
        """Topics whose first message may not have arrived yet, in order of publication."""
        self._topics = RosapiTopics(self._ask, self._is_quiet)
        self._published_s = float("-inf")
        self._listing: asyncio.Task[None] | None = None

    async def start(self, subscriptions: tuple[RosSubscription, ...], answer_s: float) -> None:
        """Repeat lost cancellations, start reading, query the list of topics, and subscribe.

        With ``version: auto``, wait up to `answer_s` seconds for the list before subscribing.
        """
        self._reader = asyncio.create_task(self._read())
        await self._write(self._client.cancel_due())
        self._canceller = asyncio.create_task(self._cancel_again())
        for action in self._goals.owed():
            self._cancel_all(action)
        # Query first: later, ROS 1 would include our own subscriptions.
        asked = self._client.call_service(
            "/rosapi/topics", lambda said: self._learn(subscriptions, said), errback=self._unknown
        )
        await self._write(asked)
        if self._is_auto:
            with suppress(TimeoutError):  # without rosapi, type names are sent as written
                async with asyncio.timeout(answer_s):
                    await self._learnt.wait()
        for one in subscriptions:
            await self._write(self._client.listen(one))

    async def perform(self, envelope: Envelope) -> None:
        """Send an envelope as a rosbridge operation, change a subscription, or list topics."""
        if envelope.verb in ("subscribe", "unsubscribe"):
            change = self._client.resume if envelope.verb == "subscribe" else self._client.pause
            await self._write(change(str(envelope.attributes.get("topic"))))
            return
        if envelope.verb == TOPICS:
            self._list(envelope)
            return
        frames = self._client.perform(envelope)
        if envelope.verb == "publish":
            self._published_s = asyncio.get_running_loop().time()
            topic = str(envelope.attributes.get("topic"))
            if len(self._fresh) < KNOWN_TOPICS:
                self._fresh[topic] = None
            if self._learnt.is_set():
                frames += self._look_at(topic, str(envelope.attributes.get("type") or ""))
        action = str(envelope.attributes.get("action"))
        if envelope.verb == "goal" and self._all is not None:
            self._all.drop(action)  # it would end the new goal, too
        if envelope.verb == "cancel":
            self._cancelled.set()
        try:
            await self._write(frames)
        finally:
            if envelope.verb == "cancel":
                self._cancel_all(action)

    def _cancel_all(self, action: str) -> None:
        """Cancel all goals of an action, also those that URC does not know."""
        if self._all is not None:
            self._all.begin(action)

    def drop_cancellation(self, action: str) -> None:
        """End the cancellation of all goals of an action without an answer."""
        self._client.drop(action)
        if self._all is not None:
            self._all.drop(action)

    def _tell(self, text: str) -> None:
        """Write a line to the robot's log, once per connection."""
        if text not in self._told and len(self._told) < KNOWN_TOPICS:
            self._told.add(text)
            self.queue.answer(Envelope(NOTICE, {}, text))

    async def _cancel_again(self) -> None:
        """Repeat the cancellations of goals without results, until cancelled."""
        with suppress(TransportError):  # the reader reports the end of the connection
            while True:
                self._cancelled.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout(self._client.cancel_wait_s()):
                        await self._cancelled.wait()
                await self._write(self._client.cancel_due())

    def _look_at(self, topic: str, kind: str) -> list[bytes]:
        """Return the query for a topic's subscribers; [] after the topic's first message."""
        if not self._graph.publishes(topic, kind):
            return []

        def told(said: Mapping[str, Any]) -> None:
            nodes = said.get("subscribers")
            if isinstance(nodes, list):
                self._graph.subscribers(topic, nodes)

        return self._client.call_service("/rosapi/subscribers", told, {"topic": topic})

    def _is_quiet(self) -> bool:
        return asyncio.get_running_loop().time() - self._published_s >= QUIET_S

    def _list(self, request: Envelope) -> None:
        """Begin to answer a request for topics, unless URC publishes or answers another request."""
        if self._is_quiet() and (self._listing is None or self._listing.done()):
            self._listing = asyncio.create_task(self._answer(request))

    async def _answer(self, request: Envelope) -> None:
        with suppress(TransportError):  # the reader reports the end of the connection
            answer = await self._topics.answer(request, self._client.received)
            if answer is not None:
                self.queue.answer(answer, 100 * len(answer.body))  # type: ignore[arg-type] # a list

    async def settle(self) -> str:
        """Wait for delivery; return a line about topics without subscribers, or ""."""
        topics = list(self._fresh)
        self._fresh.clear()
        heard = await asyncio.gather(*map(self._is_heard, topics))
        lost = [topic for topic, is_heard in zip(topics, heard, strict=True) if not is_heard]
        return f"nothing subscribes to {', '.join(lost)}" if lost else ""

    async def _is_heard(self, topic: str) -> bool:
        """Wait until a topic's publisher is connected; return False if there are no subscribers."""
        clock = asyncio.get_running_loop().time
        subscribers = await self._subscribers(topic)
        ends_s = clock() + _CONNECTS_S
        while subscribers is not None and not subscribers:
            if clock() >= ends_s:
                return False
            await asyncio.sleep(_LOOK_S)
            subscribers = await self._subscribers(topic)
        await asyncio.sleep(_CONNECTS_S)
        return True

    async def _subscribers(self, topic: str) -> list[object] | None:
        """Return the nodes that subscribe to a topic; None if rosapi does not reply."""
        said = await self._ask("/rosapi/subscribers", {"topic": topic})
        found = said.get("subscribers") if said is not None else None
        return found if isinstance(found, list) else None

    async def _ask(self, service: str, arguments: Mapping[str, object]) -> Mapping[str, Any] | None:
        """Call a service of rosapi; return None after an error or without a reply."""
        said: asyncio.Future[Mapping[str, Any] | None]
        said = asyncio.get_running_loop().create_future()

        def told(values: Mapping[str, Any] | None) -> None:
            if not said.done():
                said.set_result(values)

        await self._write(
            self._client.call_service(service, told, arguments, lambda problem: told(None))
        )
        try:
            async with asyncio.timeout(_ANSWER_S):
                return await said
        except TimeoutError:
            return None

    async def end(self) -> None:
        """Stop reading and wake all waiting tasks."""
        self.queue.end("the connection is closed")
        tasks = [
            task for task in (self._reader, self._listing, self._canceller) if task is not None
        ]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if self._all is not None:
            await self._all.end()

    async def _write(self, frames: list[bytes]) -> None:
        for frame in frames:
            await self._wire.send(frame)

    async def _read(self) -> None:
        """Process received frames until the connection ends."""
        clock = asyncio.get_running_loop().time
        began_s = clock()
        try:
            while True:
                frame = await self._wire.receive()
                self.queue.note_arrival()
                operation = None
                if self._packed and len(frame) > LARGE_BYTES and frame.startswith(b"{"):
                    operation = await packed_operation(frame, self._packed)
                self._receive(frame, operation)
                # Buffered frames need no waiting, and some take a long time to parse.
                if self.queue.is_filling or clock() - began_s > _TURN_S:
                    await asyncio.sleep(0)
                    began_s = clock()
        except TransportError as ended:
            self.queue.end(str(ended))

    def _receive(self, frame: bytes, operation: dict[str, Any] | None) -> None:
        """Process a frame; `operation` is the frame's operation if it is already decoded."""
        try:
            operation = operation or self._frames.read(frame)
            if operation is not None:
                self._client.arrived(operation, len(frame))
        except BadOperation as problem:
            self._bad += 1
            if self._bad & (self._bad - 1) == 0:  # the 1st, 2nd, 4th, 8th …
                log.warning("rosbridge: %s (%d such frames)", problem, self._bad)
                text = f"a frame of the bridge was dropped: {problem} ({self._bad} such frames)"
                self.queue.answer(Envelope(NOTICE, {}, text))

    def _learn(self, subscriptions: tuple[RosSubscription, ...], said: Mapping[str, Any]) -> None:
        """Process the list of topics and types from rosapi."""
        names, types = said.get("topics"), said.get("types")
        if isinstance(names, list):
            kinds = types if isinstance(types, list) and len(types) == len(names) else []
            found = dict(zip(names, kinds or [""] * len(names), strict=True))
            types = {str(name): str(kind) for name, kind in found.items()}
            self._graph.learn(types)
            self._topics.learn(types)
            self._graph.subscribed({one.topic: one.type for one in subscriptions})
            if self._is_auto:
                self._client.spell(version_of(map(str, kinds)))
        self._learnt.set()

    def _unknown(self, problem: object) -> None:
        self._learnt.set()
