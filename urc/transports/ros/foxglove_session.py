"""The state of one open Foxglove protocol connection: channels, subscriptions, calls.

The session does no I/O: the transport sends its frames. Each object serves a single connection.

The robot announces its topics as channels, which can appear and disappear. The session subscribes
only to the driver's topics. The bridge sends every message at the full rate, so the session drops
messages that arrive too soon. The last message of a burst is delivered later. The session passes
messages on as bytes, preceded by the definition of the topic's type
(`urc.protocol.ros.topic_codec`).

Goals use the hidden services of actions (`urc.transports.ros.foxglove_actions`). Of a connection's
state, only the unfinished goals and the published topics are carried over to the next connection.

The protocol provides parameters and topics. The session uses both to answer the rosapi services
itself, so the same document also works with rosbridge (`urc.transports.ros.rosapi_answers`).
"""

import logging
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Final

from urc.model.payload import Envelope
from urc.transports._faults import one_line
from urc.transports.base import NOTICE, TOPICS, TransportError
from urc.transports.ros.foxglove_actions import FoxgloveActions, feedback_of
from urc.transports.ros.foxglove_frames import (
    AdvertisedChannel,
    BadOperation,
    FrameReader,
    MessageData,
    ServiceReply,
    ServiceType,
    TimeTold,
    call_frame,
    channel_of,
    encode_operation,
    listed,
    publish_frame,
    service_of,
)
from urc.transports.ros.foxglove_publishing import PublishedType, message_data, message_json
from urc.transports.ros.foxglove_topics import DrivenChannel, FoxgloveTopics, TopicWish
from urc.transports.ros.foxglove_watches import StatusWatches
from urc.transports.ros.goals import UnfinishedGoals
from urc.transports.ros.graph import TopicGraph
from urc.transports.ros.robot_time import CLOCK_TOPIC, RobotTime
from urc.transports.ros.rosapi_answers import RosapiAnswers
from urc.transports.ros.topic_list import QUIET_S
from urc.transports.ros.types import is_video, spelled
from urc.transports.topic_queue import TopicReceiveQueue

__all__ = ["KNOWN_TOPICS", "FoxgloveSession"]

MAX_CHANNELS: Final = 4096
"""Maximum number of known services, and of known channels; further services and channels are
ignored. Channels for the driver's topics are accepted up to twice this number."""
MAX_PENDING: Final = 256
"""Maximum number of pending calls; above the limit, the oldest call is dropped."""
KNOWN_TOPICS: Final = 256
"""Maximum number of topics that the client publishes."""
MAX_STATUS: Final = 64
"""Maximum number of different status messages that are reported."""
MAX_RETRIES: Final = 5
"""Maximum number of retries after a subscription is refused."""
_NUMBERS: Final = re.compile(r"\d+")
_SHOWN: Final = 80
_ENCODINGS: Final = ("cdr", "ros1", "json", "protobuf", "flatbuffer")
PARAMETER: Final = "parameter:"
"""Prefix of a topic that represents a parameter, such as ``parameter:/driver.rate``."""

log = logging.getLogger(__name__)


class FoxgloveSession:
    """The protocol state of one connection."""

    def __init__(
        self,
        queue: TopicReceiveQueue,
        wishes: tuple[TopicWish, ...],
        graph: TopicGraph,
        *,
        call_at: Callable[[float, Callable[[], None]], object],
        clock: Callable[[], float],
        published: dict[tuple[str, str], PublishedType],
        goals: UnfinishedGoals | None = None,
        clock_only: bool | None = None,
        flush: Callable[[], object] = lambda: None,
    ) -> None:
        """Initialise the state for a new connection.

        Args:
            queue: queue that receives the messages and replies from the robot.
            wishes: topics to subscribe to, without duplicates.
            graph: object that reports topics with mistakes.
            call_at: function that schedules a call for a given time on `clock`.
            clock: monotonic clock, in seconds.
            published: type of each published topic, keyed by topic and encoding. All connections
                of a transport share it, so that a new one announces these topics at once.
            goals: unfinished goals of this and earlier connections; None for no earlier goals.
            clock_only: see `RobotTime`.
            flush: function that sends the written frames soon.
        """
        self.queue = queue
        self._wishes = {one.topic: one for one in wishes}
        self._graph = graph
        self._call_at = call_at
        self._clock = clock
        self._published = published
        self._reader = FrameReader()
        self._frames: list[tuple[bytes, bool]] = []
        self._channels: dict[int, AdvertisedChannel] = {}
        self._subscriptions: dict[int, DrivenChannel] = {}
        self._topics: dict[str, DrivenChannel] = {}
        self._paused: set[str] = set()
        """Topics that the driver does not need at present."""
        self._services: dict[str, ServiceType] = {}
        self._own: dict[tuple[str, str], int] = {}
        self._calls: dict[int, tuple[object, str]] = {}
        self._own_calls: dict[int, Callable[[ServiceReply | None, str], None]] = {}
        self._results: dict[int, str] = {}
        """Goal of each pending call for a result, keyed by the call's number."""
        self._flush = flush
        self._rosapi = RosapiAnswers(self)
        self._states = StatusWatches(self)
        self._actions = FoxgloveActions(goals or UnfinishedGoals(), self, self._states)
        self._graph_topics = FoxgloveTopics()
        self._published_s = float("-inf")
        self._number = self._bad = 0
        self._time = RobotTime(clock_only)
        self._told: set[str] = set()
        self._retries: Counter[str] = Counter()
        self.capabilities: frozenset[str] = frozenset()
        self.encodings: tuple[str, ...] = ()
        self.is_greeted = False
        """Whether the server information has arrived."""

    def written(self) -> list[tuple[bytes, bool]]:
        """Remove and return the frames to send, each with a flag that is true for text."""
        frames, self._frames = self._frames, []
        return frames

    # -- received frames

    def arrived(self, frame: bytes) -> None:
        """Process one frame; invalid frames are counted and logged."""
        self.queue.note_arrival()
        try:
            said = self._reader.read(frame)
            if isinstance(said, MessageData):
                self._message(said)
            elif isinstance(said, TimeTold):
                self._take_time(said.time_ns)
            elif isinstance(said, ServiceReply):
                self._reply(said)
            elif said is not None:
                self._operation(said)
        except BadOperation as problem:
            self._bad += 1
            if self._bad & (self._bad - 1) == 0:  # the 1st, 2nd, 4th, 8th …
                log.warning("foxglove: %s (%d such frames)", problem, self._bad)

    def _operation(self, said: Mapping[str, Any]) -> None:
        match said["op"]:
            case "serverInfo":
                self._server_info(said)
            case "advertise":
                self._advertise(said)
            case "unadvertise":
                self._unadvertise(said)
            case "advertiseServices":
                self._advertise_services(said)
            case "unadvertiseServices":
                self._unadvertise_services(said)
            case "serviceCallFailure":
                self._call_failed(said)
            case "parameterValues":
                self._take_parameters(said)
            case "connectionGraphUpdate":
                self._graph_update(said)
            case "status":
                self._status(said)

    def _server_info(self, said: Mapping[str, Any]) -> None:
        capabilities, encodings = said.get("capabilities"), said.get("supportedEncodings")
        self.capabilities = frozenset(map(str, capabilities or ()))
        self.encodings = tuple(map(str, encodings or ()))
        if self.is_greeted:
            return
        self.is_greeted = True
        if "connectionGraph" in self.capabilities:
            self._op("subscribeConnectionGraph")
        for (topic, encoding), kind in self._published.items():
            self._announce(topic, encoding, kind)
            self._graph_topics.announced(topic, kind.name, ())
        names = [topic[len(PARAMETER) :] for topic in self._wishes if topic.startswith(PARAMETER)]
        if names and "parametersSubscribe" in self.capabilities:
            self._op("subscribeParameterUpdates", parameterNames=names)
        if names and "parameters" in self.capabilities:
            self._op("getParameters", parameterNames=names, id="first")

    def _advertise(self, said: Mapping[str, Any]) -> None:
        for one in listed(said, "channels"):
            try:
                channel = channel_of(one)
            except BadOperation as problem:
                self._notice(str(problem))
                continue
            most = 2 * MAX_CHANNELS
            channel = channel._replace(topic=self._wish_name(channel.topic))
            if channel.topic not in self._wishes:
                channel, most = channel._replace(schema=""), MAX_CHANNELS
            if channel.id in self._channels or len(self._channels) < most:
                self._channels[channel.id] = channel

    def _wish_name(self, topic: str) -> str:
        """Return the name of a topic in the document, which is another one for feedback."""
        name = feedback_of(topic)
        return name if name in self._wishes else topic

    def _unadvertise(self, said: Mapping[str, Any]) -> None:
        for number in said.get("channelIds") or ():
            if isinstance(number, int):
                self._channels.pop(number, None)

    def reconcile(self) -> None:
        """Subscribe to the driver's topics after the channels have changed."""
        found: dict[str, AdvertisedChannel] = {}
        for channel in self._channels.values():
            is_wanted = channel.topic in self._wishes and channel.topic not in self._paused
            if is_wanted and channel.encoding in _ENCODINGS:
                found.setdefault(channel.topic, channel)
        gone = [one for one in self._topics.values() if found.get(one.wish.topic) != one.channel]
        for one in gone:
            del self._topics[one.wish.topic], self._subscriptions[one.number]
        numbers = [one.number for one in gone if one.channel.id in self._channels]
        if numbers:
            self._op("unsubscribe", subscriptionIds=numbers)
        new = []
        for topic, channel in found.items():
            if topic in self._topics:
                continue
            self._number += 1
            one = DrivenChannel(self._wishes[topic], channel, self._number)
            self._topics[topic] = self._subscriptions[one.number] = one
            if is_video(channel.type):
                self.queue.keep_groups(topic)
            self._define(channel)
            new.append({"id": one.number, "channelId": channel.id})
        if new:
            self._op("subscribe", subscriptions=new)

    def _define(self, channel: AdvertisedChannel) -> None:
        attributes = {
            "topic": channel.topic,
            "type": channel.type,
            "encoding": channel.encoding,
            "notation": channel.notation,
        }
        envelope = Envelope("definition", attributes, channel.schema)
        self.queue.answer(envelope, len(channel.schema))

    def check_topics(self) -> None:
        """Report driver topics that have no publishers or a different type."""
        self._graph.learn({one.topic: one.type for one in self._channels.values()})
        names = {topic for topic in self._wishes if not topic.startswith(PARAMETER)}
        self._graph.subscribed({topic: self._wishes[topic].type for topic in names})

    def _message(self, said: MessageData) -> None:
        one = self._subscriptions.get(said.subscription)
        if one is None:
            self._states.arrived(said.subscription, said.data)
            return
        one.received += 1
        if one.is_status:
            self._states.driver_arrived(one.number, one.wish.topic, said.data)
        self._take_time(said.time_ns)
        if self._time.is_simulated and one.wish.topic == CLOCK_TOPIC:
            restarted = self._time.clock(one.channel.encoding, said.data)
            if restarted is not None:
                self.queue.answer(restarted)
            if self._time.is_clock_only:
                return
        if one.wish.throttle_s:
            now_s = self._clock()
            if now_s < one.due_s:
                if one.late is None:
                    self._call_at(one.due_s, lambda: self._deliver_late(one))
                one.late = said.data
                return
            one.due_s = now_s + one.wish.throttle_s
        self._deliver(one, said.data)

    def _deliver(self, one: DrivenChannel, data: bytes) -> None:
        attributes = {"topic": one.wish.topic, "encoding": one.channel.encoding}
        self.queue.message(one.wish.topic, Envelope("message", attributes, data), len(data))

    def _take_time(self, robot_ns: int) -> None:
        """Record the time of a message from the robot."""
        stepped = self._time.told(robot_ns, time.time_ns())
        if stepped is not None:
            self.queue.answer(stepped)

    def _deliver_late(self, one: DrivenChannel) -> None:
        data, one.late = one.late, None
        if data is not None and self._subscriptions.get(one.number) is one:
            one.due_s = self._clock() + one.wish.throttle_s
            self._deliver(one, data)

    # -- services and parameters

    def _advertise_services(self, said: Mapping[str, Any]) -> None:
        for one in listed(said, "services"):
            service = service_of(one, self.encodings)
            if service.name in self._services or len(self._services) < MAX_CHANNELS:
                self._services[service.name] = service
                self._actions.offered(service.name)

    def _unadvertise_services(self, said: Mapping[str, Any]) -> None:
        gone = {number for number in said.get("serviceIds") or () if isinstance(number, int)}
        self._services = {n: one for n, one in self._services.items() if one.id not in gone}

    def _reply(self, said: ServiceReply) -> None:
        done = self._own_calls.pop(said.call, None)
        if done is not None:
            done(said, "")
            return
        number, service = self._calls.pop(said.call, (None, ""))
        goal = self._results.pop(said.call, "")
        why_cancelled = self._actions.ended(goal) if goal else ""
        if service:
            attributes = {"id": number, "ok": True, "service": service, "encoding": said.encoding}
            if goal:
                attributes |= {"result_of": goal, "why_cancelled": why_cancelled}
            self.queue.answer(Envelope("response", attributes, said.data), len(said.data))

    def _call_failed(self, said: Mapping[str, Any]) -> None:
        call, text = said.get("callId"), said.get("message")
        if not isinstance(call, int):
            return
        reason = one_line(text) if isinstance(text, str) and text else "refused"
        done = self._own_calls.pop(call, None)
        if done is not None:
            done(None, reason)
            return
        number, service = self._calls.pop(call, (None, ""))
        if self._results.pop(call, ""):
            self._actions.lose(number, reason)
        elif service:
            self.answer(number, reason)

    def answer(self, number: object, reason: str = "", values: object = None) -> None:
        """Report the result of a request to the engine; a `reason` means failure."""
        attributes: dict[str, object] = {"id": number, "ok": not reason}
        if reason:
            attributes["reason"] = reason
        self.queue.answer(Envelope("response", attributes, values))

    def _take_parameters(self, said: Mapping[str, Any]) -> None:
        """Answer a query for parameters, and deliver parameters that the driver subscribes to."""
        found = {
            one["name"]: one.get("value")
            for one in listed(said, "parameters")
            if isinstance(one.get("name"), str)
        }
        self._rosapi.found(str(said.get("id")), found)
        for name, value in found.items():
            topic = PARAMETER + name
            if topic in self._wishes:
                self.queue.message(
                    topic, Envelope("message", {"topic": topic}, {"value": value}), 64
                )

    # -- the robot's graph and status

    def _graph_update(self, said: Mapping[str, Any]) -> None:
        self._graph_topics.update(said)

    @property
    def has_graph(self) -> bool:
        """Whether the bridge reports the publishers and subscribers of topics."""
        return self._graph_topics.is_known

    def listeners(self, topic: str) -> tuple[str, ...] | None:
        """Return the nodes that subscribe to a topic; None if the nodes are unknown."""
        return self._graph_topics.subscribers_of(topic)

    def _status(self, said: Mapping[str, Any]) -> None:
        level, text = said.get("level"), one_line(str(said.get("message")))
        if level in (1, 2):
            self._notice(text)
        if level == 2 and "channel" in text.lower():
            self._forget_refused({int(number) for number in _NUMBERS.findall(text[:_SHOWN])})

    def _forget_refused(self, channels: set[int]) -> None:
        """Forget the subscriptions to refused channels, so that `reconcile` subscribes again.

        The Foxglove SDK's server announces a channel before accepting subscriptions, so the server
        refuses a client that subscribes immediately. The refusal is text that contains the channel
        number.
        """
        self._states.refuse(channels)
        for one in list(self._topics.values()):
            topic, is_refused = one.wish.topic, one.channel.id in channels and not one.received
            if is_refused and self._retries[topic] < MAX_RETRIES:
                self._retries[topic] += 1
                del self._topics[topic], self._subscriptions[one.number]

    def _notice(self, text: str) -> None:
        self.tell(f"the bridge reports: {text}")

    # -- sending

    def perform(self, envelope: Envelope) -> None:
        """Write the frames for an envelope that publishes a message or calls a service.

        Raises:
            TransportError: the robot does not support the operation.
        """
        if envelope.verb == "publish":
            self._published_s = self._clock()
            self._publish(envelope)
        elif envelope.verb == TOPICS:
            self._list_topics(envelope)
        elif envelope.verb == "call":
            self._call(envelope)
        elif envelope.verb == "cancel":
            self._actions.cancel(str(envelope.attributes.get("action") or ""))
        elif envelope.verb == "goal":
            self._actions.start(envelope)
        elif envelope.verb in ("subscribe", "unsubscribe"):
            change = self._paused.discard if envelope.verb == "subscribe" else self._paused.add
            change(str(envelope.attributes.get("topic")))
            self.reconcile()
        else:
            raise TransportError(f"this connection cannot {envelope.verb}")

    def drop_cancellation(self, action: str) -> None:
        """End the cancellation of all goals of an action without an answer."""
        self._actions.drop_cancellation(action)

    def _list_topics(self, request: Envelope) -> None:
        """Answer a request for topics, unless URC publishes."""
        if self._clock() - self._published_s >= QUIET_S:
            received = {one.wish.topic: one.received for one in self._topics.values()}
            answer = self._graph_topics.answer(request, self._channels.values(), received)
            self.queue.answer(answer, 100 * len(answer.body))  # type: ignore[arg-type] # a list

    def _publish(self, envelope: Envelope) -> None:
        said = envelope.attributes
        topic, kind = str(said.get("topic") or ""), str(said.get("type") or "")
        if self.is_greeted and "clientPublish" not in self.capabilities:
            raise TransportError(
                "the bridge accepts no messages: it lacks the capability clientPublish"
            )
        channels = self._channels.values()
        encoding, data, schema = message_data(envelope, self.encodings, self._time, channels)
        number = self._own.get((topic, encoding))
        if number is None:
            kind = spelled(kind, "msg", 1 if encoding == "ros1" else 2)
            number = self._announce(topic, encoding, PublishedType(kind, schema))
            self._graph_topics.announced(topic, kind, self._channels.values())
            self._graph.learn({one.topic: one.type for one in self._channels.values()})
            if self._graph.publishes(topic, kind) and self.has_graph:
                self._graph.subscribers(topic, self.listeners(topic) or ())
        self._frames.append((publish_frame(number, data), False))

    def _announce(self, topic: str, encoding: str, kind: PublishedType) -> int:
        while len(self._own) >= KNOWN_TOPICS:
            oldest = next(iter(self._own))
            self._op("unadvertise", channelIds=[self._own.pop(oldest)])
            self._published.pop(oldest, None)
        self._number += 1
        self._own[topic, encoding] = self._number
        self._published[topic, encoding] = kind
        one = {"id": self._number, "topic": topic, "encoding": encoding, "schemaName": kind.name}
        if kind.schema:
            one |= {"schema": kind.schema, "schemaEncoding": encoding}
        self._op("advertise", channels=[one])
        return self._number

    def _call(self, envelope: Envelope) -> None:
        said = envelope.attributes
        name, number = str(said.get("service") or ""), said.get("id")
        service = self._services.get(name)
        if service is None:
            if not self._rosapi.answer(name, number, envelope.body):
                self.answer(number, f"there is no service {one_line(name)[:_SHOWN]}")
            return
        encoding, data = said.get("encoding"), said.get("data")
        if not isinstance(data, bytes):
            self.return_unencoded(service, {"id": number}, envelope.body)
            return
        if encoding == "json":
            data = message_json(envelope.body, self._time)
        elif isinstance(stamps := said.get("stamps"), list) and stamps:
            data = self._time.stamped(data, stamps, time.time_ns())
        if goal := said.get("goal"):
            self._actions.send(str(goal), number, service, data)
            return
        self._number += 1
        while len(self._calls) >= MAX_PENDING:
            oldest = next(iter(self._calls))
            del self._calls[oldest]
            self._results.pop(oldest, None)
        self._calls[self._number] = (number, name)
        if result_of := said.get("result_of"):
            self._results[self._number] = str(result_of)
        frame = call_frame(service.id, self._number, str(encoding), data)
        self._frames.append((frame, False))

    # -- the parts that goals need; see `ActionCalls`

    def service(self, name: str) -> ServiceType | None:
        """Return a service that the bridge offers, or None."""
        return self._services.get(name)

    def has_service(self, suffix: str) -> bool:
        """Return whether the bridge offers a service whose name has this end."""
        return any(name.endswith(suffix) for name in self._services)

    def call(
        self, service: ServiceType, data: bytes, done: Callable[[ServiceReply | None, str], None]
    ) -> int:
        """Call a service and return the call's number; `done` receives the reply or a fault."""
        self._number += 1
        while len(self._own_calls) >= MAX_PENDING:
            del self._own_calls[next(iter(self._own_calls))]
        self._own_calls[self._number] = done
        frame = call_frame(service.id, self._number, service.request[1], data)
        self._frames.append((frame, False))
        self._flush()
        return self._number

    def forget_call(self, number: int) -> None:
        """Ignore the reply to a call of `call` from now on."""
        self._own_calls.pop(number, None)

    def return_unencoded(
        self, service: ServiceType, attributes: dict[str, object], body: object
    ) -> None:
        """Return a request to the engine, which encodes it and sends it again."""
        types = {"request": service.request, "response": service.response}
        back = Envelope("unencoded", {"service": service.name, **attributes, **types}, body)
        self.queue.answer(back, len(service.request[3]) + len(service.response[3]))

    def tell(self, text: str) -> None:
        """Write a line to the robot's log, once per connection."""
        if text not in self._told and len(self._told) < MAX_STATUS:
            self._told.add(text)
            self.queue.answer(Envelope(NOTICE, {}, text))

    def repeat(self, work: Callable[[], None], after_s: float) -> None:
        """Run `work` after `after_s` seconds, unless the connection has ended."""

        def run() -> None:
            if self.queue.ended is None:
                work()

        self._call_at(self._clock() + after_s, run)

    # -- the parts that the states of goals need; see `WatchCalls`

    def channel(self, topic: str) -> AdvertisedChannel | None:
        """Return the first channel of a topic, or None."""
        return next((one for one in self._channels.values() if one.topic == topic), None)

    def subscription(self, topic: str) -> int | None:
        """Return the number of the driver's own subscription to a topic, or None."""
        return self._topics[topic].number if topic in self._topics else None

    def is_published(self, topic: str) -> bool:
        """Return whether a node publishes a topic; true if the bridge reports no nodes."""
        nodes = self._graph_topics.publishers_of(topic)
        return bool(nodes) or "connectionGraph" not in self.capabilities

    def topics(self) -> dict[str, str]:
        """Return the types of all topics, keyed by topic."""
        return {one.topic: one.type for one in self._channels.values()}

    def next_number(self) -> int:
        """Return a number that this connection has not used yet."""
        self._number += 1
        return self._number

    def operate(self, name: str, **fields: object) -> None:
        """Write an operation of the protocol, which is sent soon."""
        self._op(name, **fields)
        self._flush()

    def _op(self, name: str, **fields: object) -> None:
        self._frames.append((encode_operation({"op": name, **fields}), True))
