"""A transport for ROS 2 robots with the middleware rmw_zenoh, without ROS on this computer.

Theory of operation. The connection is that of the transport `zenoh` (`ZenohSession`). On it, URC is
a ROS 2 node with publishers and subscriptions. `RosZenohGraph` knows the robot's publishers and
subscriptions from their liveliness tokens.

A robot sends no definitions over Zenoh, but each key contains the type's name and hash. The
transport delivers both before the first message of a topic, in an envelope with the verb
``definition``. The codec (`urc.protocol.ros.topic_codec`) then compares the hash with its own.

Keys contain the type's hash, so a subscription matches every hash. The topic's last messages are
requested when a publisher with transient-local messages appears.
"""

import asyncio
import time
from contextlib import suppress
from functools import partial
from typing import Any, Final

import xxhash
import zenoh
import zenoh.ext

from urc.key_expressions import key_fault
from urc.model.payload import Envelope, Payload
from urc.transports._faults import CLOSED, late, one_line
from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import NOTICE, TOPICS, ConnectFailed, PeerClosed, TransportError
from urc.transports.ros.graph import TopicGraph
from urc.transports.ros.robot_time import CLOCK_TOPIC, RobotTime
from urc.transports.ros.topic_list import QUIET_S
from urc.transports.ros.types import spelled
from urc.transports.ros.zenoh_names import (
    NO_HASH,
    NodeNames,
    TopicToken,
    attachment,
    source_time,
    token_of,
    tokens_key,
    topic_key,
    topic_keys,
    type_of_key,
)
from urc.transports.ros.zenoh_options import Ros2Options, Ros2Topic
from urc.transports.ros.zenoh_topics import answer_from
from urc.transports.zenoh_session import MAX_KEY_BYTES, Inbox, ZenohSession

__all__ = ["RosZenohTransport"]

MAX_TOKENS: Final = 8192
"""Maximum number of known publishers and subscriptions; further ones are ignored."""
MAX_TYPES: Final = 8
"""Maximum number of different types of one topic; messages of further types are dropped."""
MAX_PUBLISHED: Final = 256
"""Maximum number of topics that URC publishes."""
_CHECK_S: Final = 2.0
"""Delay before missing topics are reported, in seconds."""
_KEPT: Final = 10
"""Number of old messages to request from each publisher with transient-local messages."""


class _Publisher:
    """One topic that URC publishes."""

    def __init__(self, key: str, token: str) -> None:
        self.key = key
        self.gid = xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")
        self.count = 0


class _Subscription:
    """One topic that the driver uses."""

    def __init__(self, topic: Ros2Topic) -> None:
        self.topic = topic
        self.inbox: Inbox | None = None
        self.is_transient = False
        self.types: dict[tuple[str, str], None] = {}
        self.type: tuple[str, str] | None = None
        self.due_s = float("-inf")
        self.late: tuple[tuple[str, str], Any] | None = None
        """Newest message that arrived too soon."""
        self.timer: asyncio.TimerHandle | None = None
        """Timer that delivers this message."""
        self.received = 0


class RosZenohTransport:
    """A transport to one ROS 2 system, which may be opened several times."""

    def __init__(self, options: Ros2Options, dialer: StreamDialer) -> None:
        """Store the options and the dialer for a router, without connecting."""
        self._options = options
        self._dialer = dialer
        self._graph = TopicGraph(self._notice, 2)
        self._published: dict[tuple[str, str, str], None] = {}
        """Topic, type and hash of each published topic. A new connection declares all of them, so
        that the robot's graph shows them immediately."""
        self._node: _RosNode | None = None

    @property
    def address(self) -> str:
        """The transport's target as display text, such as ``ros 192.168.1.5:7447``."""
        return f"ros {self._options.zenoh.where}"

    async def open(self, timeout_s: float) -> None:
        """Connect and subscribe, or raise `ConnectFailed` within `timeout_s` seconds."""
        await self.close()
        try:
            async with asyncio.timeout(timeout_s):
                stream = await self._dialer.open(timeout_s)
                session = ZenohSession(self._options.zenoh, stream)
                try:
                    await session.start(timeout_s)
                    node = _RosNode(self._options, session, self._graph, self._published)
                    node.begin()
                except BaseException:
                    await session.abort()
                    raise
        except TimeoutError as fault:
            raise ConnectFailed(late(self._options.zenoh.where, timeout_s)) from fault
        except zenoh.ZError as fault:
            raise ConnectFailed(one_line(str(fault))) from fault
        self._node = node

    async def receive(self) -> Envelope:
        """Return the next message or definition; raise `PeerClosed` at the end."""
        return await self._open_node().session.queue.pop()

    async def send(self, data: Payload) -> None:
        """Publish a message; return after the kernel has accepted it.

        Raises:
            PeerClosed: the connection broke.
            TransportError: the message cannot be sent.
        """
        node = self._open_node()
        if not isinstance(data, Envelope):
            raise TransportError("ros carries messages, not bytes; use publish")
        if data.verb in ("call", "goal"):
            reason = f"ros over zenoh carries topics, but no {data.verb}; use via: foxglove"
            attributes = {"id": data.attributes.get("id"), "ok": False, "reason": reason}
            node.session.queue.answer(Envelope("response", attributes))
            return
        if data.verb == "cancel":  # this connection has started no goal; STOP must not fail for it
            node.nothing_cancelled()
            return
        if data.verb in ("subscribe", "unsubscribe"):
            node.pause(str(data.attributes.get("topic")), is_paused=data.verb == "unsubscribe")
            return
        if data.verb == TOPICS:
            node.list_topics(data)
            return
        if data.verb != "publish":
            raise TransportError(f"ros over zenoh cannot {data.verb}; supported: publish")
        await node.publish(data)

    async def close(self) -> None:
        """Close the connection immediately. The method never raises and may be called twice."""
        node, self._node = self._node, None
        if node is not None:
            node.end()
            await node.session.close()

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        node, self._node = self._node, None
        if node is not None:
            node.end()
            await node.session.abort()

    async def settle(self) -> str:
        """Return a line that lists the published topics without subscribers, or ""."""
        return "" if self._node is None else self._node.lost()

    async def probe(self) -> None:
        """Probe the router; return as soon as the router has replied."""
        await self._open_node().session.ping()

    def arrivals(self) -> int:
        """Return the number of messages that have arrived over this connection."""
        return 0 if self._node is None else self._node.session.queue.arrivals

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return 0 if self._node is None else self._node.session.unsent()

    def _open_node(self) -> "_RosNode":
        if self._node is None:
            raise PeerClosed(CLOSED)
        return self._node

    def _notice(self, text: str) -> None:
        if self._node is not None:
            self._node.session.queue.answer(Envelope(NOTICE, {}, text))


class _RosNode:
    """URC's node on one connection."""

    def __init__(
        self,
        options: Ros2Options,
        session: ZenohSession,
        graph: TopicGraph,
        published: dict[tuple[str, str, str], None],
    ) -> None:
        self.session = session
        self._options = options
        self._graph = graph
        self._published = published
        self._library = session.library
        identifier = str(self._library.zid())
        self._names = NodeNames(options.domain, identifier, f"urc_{identifier[:6]}")
        self._subscriptions = {f"/{one.topic.strip('/')}": _Subscription(one)
                               for one in options.topics}  # fmt: skip
        self._publishers: dict[tuple[str, str], _Publisher] = {}
        self._published_s = float("-inf")
        self._is_cancel_told = False
        self._fresh: dict[str, None] = {}
        """Published topics whose subscribers have not been checked."""
        self._tokens: dict[str, TopicToken] = {}
        self._time = RobotTime(options.clock_only)
        self._loop = asyncio.get_running_loop()
        self._timers: list[asyncio.TimerHandle] = []

    def begin(self) -> None:
        """Declare the node and its subscriptions, and follow the robot's tokens."""
        self._declare(self._names.node)
        for one in self._subscriptions.values():
            self._subscribe(one)
            kind, hashed = one.topic.type, self._hash(one.topic.hashed)
            if kind and hashed:
                self._declare(self._names.topic("MS", one.topic.topic, kind, hashed))
        for topic, kind, hashed in self._published:
            self._publisher(topic, kind, hashed)
        tokens = tokens_key(self._options.domain)
        handler = zenoh.handlers.Callback(self._token_came, indirect=False)
        self.session.keep(
            self._library.liveliness().declare_subscriber(tokens, handler, history=True)
        )
        self._timers.append(self._loop.call_later(_CHECK_S, self._check_topics))

    def end(self) -> None:
        """Cancel the timers."""
        late = [one.timer for one in self._subscriptions.values() if one.timer is not None]
        for timer in (*self._timers, *late):
            timer.cancel()

    def _hash(self, own: str) -> str:
        return own if self._options.has_hashes else NO_HASH

    def _declare(self, token: str) -> None:
        self.session.keep(self._library.liveliness().declare_token(token))

    # -- receiving

    def _subscribe(self, one: _Subscription) -> None:
        keys = topic_keys(self._options.domain, one.topic.topic)
        if one.is_transient:
            history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=_KEPT)
            declare = partial(
                zenoh.ext.declare_advanced_subscriber, self._library, keys, history=history
            )
        else:
            remote = zenoh.Locality.REMOTE
            declare = partial(self._library.declare_subscriber, keys, allowed_origin=remote)
        one.inbox = self.session.receive(declare, partial(self._sample, one))

    def pause(self, topic: str, *, is_paused: bool) -> None:
        """Undeclare a subscription while the driver does not need its topic, or declare it again.

        The token remains, so the node's place in the robot's graph does not change.
        """
        one = self._subscriptions.get(f"/{topic.strip('/')}")
        if one is None or (one.inbox is None) == is_paused:
            return
        if one.inbox is None:
            self._subscribe(one)
        else:
            inbox, one.inbox = one.inbox, None
            self.session.stop_receiving(inbox)

    def _sample(self, one: _Subscription, sample: Any) -> None:
        if sample.kind != zenoh.SampleKind.PUT:
            return
        self.session.queue.note_arrival()
        sent_ns = source_time(None if sample.attachment is None else sample.attachment.to_bytes())
        if sent_ns is not None:
            stepped = self._time.told(sent_ns, time.time_ns())
            if stepped is not None:
                self.session.queue.answer(stepped)
        kind = type_of_key(str(sample.key_expr))
        if not self._is_wanted(one, kind):
            return
        one.received += 1
        if self._time.is_simulated and one.topic.topic == CLOCK_TOPIC:
            restarted = self._time.clock("cdr", sample.payload.to_bytes())
            if restarted is not None:
                self.session.queue.answer(restarted)
            if self._time.is_clock_only:
                return
        now_s = self._loop.time()
        if one.topic.throttle_s and now_s < one.due_s:
            if one.late is None:
                one.timer = self._loop.call_at(one.due_s, self._deliver_late, one)
            one.late = kind, sample
            return
        one.due_s = now_s + one.topic.throttle_s
        self._deliver(one, kind, sample)

    def _is_wanted(self, one: _Subscription, kind: tuple[str, str]) -> bool:
        """Return whether a message has the topic's declared type, or any type if undeclared."""
        wanted = one.topic.type
        if not kind[0] or (wanted and spelled(wanted, "msg", 2) != kind[0]):
            return False
        if kind not in one.types and len(one.types) < MAX_TYPES:
            one.types[kind] = None
        return kind in one.types

    def _deliver(self, one: _Subscription, kind: tuple[str, str], sample: Any) -> None:
        topic, data = one.topic.topic, sample.payload.to_bytes()
        if kind != one.type:
            one.type = kind
            said = {"topic": topic, "type": kind[0], "encoding": "cdr", "notation": "known"}
            self.session.queue.answer(Envelope("definition", {**said, "hash": kind[1]}, ""))
        envelope = Envelope("message", {"topic": topic, "encoding": "cdr"}, data)
        self.session.queue.message(topic, envelope, len(data))

    def _deliver_late(self, one: _Subscription) -> None:
        waiting, one.late = one.late, None
        if waiting is not None:
            one.due_s = self._loop.time() + one.topic.throttle_s
            self._deliver(one, *waiting)

    # -- the robot's graph

    def _token_came(self, sample: Any) -> None:
        is_put = sample.kind == zenoh.SampleKind.PUT
        key = str(sample.key_expr)
        if len(key.encode()) <= MAX_KEY_BYTES:
            self.session.hand_over(partial(self._token, key, is_put))

    def _token(self, key: str, is_put: bool) -> None:
        if not is_put:
            self._tokens.pop(key, None)
            return
        found = token_of(key)
        if found is None or len(self._tokens) >= MAX_TOKENS:
            return
        self._tokens[key] = found
        one = self._subscriptions.get(found.topic)
        if one is None or found.kind != "publisher" or not found.is_transient or one.is_transient:
            return
        one.is_transient = True
        before = one.inbox
        with suppress(zenoh.ZError, TransportError):  # the connection has ended
            if before is not None:  # otherwise, it is paused
                self._subscribe(one)
                self.session.stop_receiving(before)

    def _check_topics(self) -> None:
        self._learn()
        self._graph.subscribed({one.topic.topic: one.topic.type for one in
                                self._subscriptions.values()})  # fmt: skip

    def _learn(self) -> None:
        types = {one.topic: one.type for one in self._tokens.values() if one.kind == "publisher"}
        takes = {one.topic: one.type for one in self._tokens.values()}
        self._graph.learn({**takes, **types})

    def _listeners(self, topic: str) -> list[TopicToken]:
        name = f"/{topic.strip('/')}"
        return [one for key, one in self._tokens.items()
                if one.topic == name and one.kind == "subscription"
                and self._names.node.split("/")[2] not in key]  # fmt: skip

    def list_topics(self, request: Envelope) -> None:
        """Answer a request for topics, unless URC publishes."""
        if self._loop.time() - self._published_s < QUIET_S:
            return
        own = self._names.node.split("/")[2]
        tokens = [one for key, one in self._tokens.items() if own not in key]
        received = {topic: one.received for topic, one in self._subscriptions.items()}
        answer = answer_from(tokens, request, received)
        self.session.queue.answer(answer, 100 * len(answer.body))  # type: ignore[arg-type] # a list

    # -- sending

    def nothing_cancelled(self) -> None:
        """Report once per connection that a `cancel` has no effect."""
        if not self._is_cancel_told:
            self._is_cancel_told = True
            text = "ros over zenoh carries no actions: no goal is cancelled"
            self.session.queue.answer(Envelope(NOTICE, {}, text))

    async def publish(self, envelope: Envelope) -> None:
        """Publish a message; raise `TransportError` if the robot could not read it."""
        self._published_s = self._loop.time()
        said = envelope.attributes
        topic, kind = str(said.get("topic") or ""), str(said.get("type") or "")
        data, own = said.get("data"), str(said.get("hash") or "")
        fault = key_fault(topic.strip("/"))
        if fault:
            raise TransportError(f"ros cannot publish to {one_line(topic)!r}: {fault}")
        if said.get("retain") is True:
            raise TransportError("ros over zenoh cannot latch a topic; use via: foxglove")
        if not isinstance(data, bytes) or not own:
            raise TransportError(
                f"URC does not know the type {one_line(kind)}, and robots send no definitions"
                " over zenoh; use via: foxglove"
            )
        self._check_hash(topic, kind, own)
        publisher = self._publisher(topic, kind, self._hash(own))
        now_ns = time.time_ns()
        if stamps := said.get("stamps"):
            data = self._time.stamped(data, stamps, now_ns)  # type: ignore[arg-type]
        publisher.count += 1
        told = attachment(publisher.count, now_ns, publisher.gid)
        await self.session.put(publisher.key, data, attachment=told)

    def _check_hash(self, topic: str, kind: str, own: str) -> None:
        """Raise `TransportError` if the robot's subscriptions all have another definition."""
        name = spelled(kind, "msg", 2)
        hashes = {one.hashed for one in self._listeners(topic) if one.type == name}
        if hashes and not hashes & {own, NO_HASH}:
            raise TransportError(
                f"the robot's definition of {name} differs from URC's; use via: foxglove"
            )

    def _publisher(self, topic: str, kind: str, hashed: str) -> _Publisher:
        found = self._publishers.get((topic, kind))
        if found is None:
            if len(self._publishers) >= MAX_PUBLISHED:
                raise TransportError(f"URC publishes {MAX_PUBLISHED} topics already")
            token = self._names.topic("MP", topic, kind, hashed)
            self._declare(token)
            key = topic_key(self._options.domain, topic, kind, hashed)
            found = self._publishers[topic, kind] = _Publisher(key, token)
            self._published[topic, kind, hashed] = None
            self._fresh[topic] = None
            self._timers.append(self._loop.call_later(_CHECK_S, self._check_published, topic, kind))
        return found

    def _check_published(self, topic: str, kind: str) -> None:
        self._learn()
        if self._graph.publishes(f"/{topic.strip('/')}", kind):
            self._graph.subscribers(topic, self._listeners(topic))

    def lost(self) -> str:
        """Return a line that lists the newly published topics without subscribers, or ""."""
        topics, self._fresh = list(self._fresh), {}
        lost = [topic for topic in topics if not self._listeners(topic)]
        return f"nothing subscribes to {', '.join(lost)}" if lost else ""
