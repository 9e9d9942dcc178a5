"""Connection state of one transport: opening, login, readiness and closing.

Pure. See `urc.protocol.requests.conversation` for the theory of operation.
"""

from typing import TYPE_CHECKING, Any, Final, Literal

from urc.model.driver import TransportSpec
from urc.model.payload import Envelope, Payload, traffic_of
from urc.protocol.events import Close, MotionReady, Ready, Send, Violation
from urc.protocol.framing.base import Framing
from urc.protocol.framing.table import build_framing
from urc.protocol.requests.exchange import (
    ConnectionClosing,
    Exchange,
    ExchangeEnded,
    ExchangeOutcome,
    LineEvent,
)
from urc.protocol.requests.frame_receiver import FrameReceiver
from urc.protocol.requests.hold_replies import HoldReplies
from urc.protocol.requests.pending_replies import PendingReplies
from urc.protocol.requests.rate import Counters
from urc.protocol.requests.reply_match import Matcher
from urc.protocol.requests.request_queue import RequestQueue, rendered_size

if TYPE_CHECKING:
    from urc.protocol.ros.topic_codec import TopicCodec

__all__ = ["GOAL", "MOST_IN_FLIGHT", "Connection"]

GOAL: Final = "goal"
"""Verb of an envelope that sends a goal of a ROS action."""
MOST_IN_FLIGHT: Final = 256
"""Maximum number of pending replies, including late and real-time replies."""
MAX_WAITING: Final = 64
"""Maximum number of goals that wait for their services; above it, the oldest is refused."""
_OVER: Final = "its command has ended, so the goal is not sent"


class Connection:
    """Base class of `Conversation`, which opens and closes the connection."""

    def __init__(self, spec: TransportSpec, messages: list[Matcher]) -> None:
        self.spec = spec
        self.is_per_request = spec.connection == "per_request"
        """Whether each request opens a new connection."""
        self.framing: Framing = build_framing(spec.framing)
        self.state: Literal["closed", "opening", "open"] = "closed"
        self.is_ready = False
        """Whether all requests may be sent; otherwise, only login and close requests may be
        sent."""
        self.last_sent = float("-inf")
        """Time, in seconds, at which a frame that resets the robot's watchdog was last sent."""
        self.counting: frozenset[str] | None = None
        """Labels of requests that reset the robot's watchdog; None means all requests."""
        self.counters = Counters()
        self.learnt: dict[str, object] = {}
        """Values of private fields that the login has received, keyed by name."""
        self.codec: TopicCodec | None = None
        """Converter for binary ROS messages; None on connections without binary ROS messages."""
        self.has_motion = False
        """Whether the connection has held commands, which bypass the queue."""
        self._pending_replies = PendingReplies()
        self._request_queue = RequestQueue(spec, self._pending_replies, self._size_of)
        self.receiver = FrameReceiver(spec, self.framing, messages)
        self.held = HoldReplies()
        """Matcher of the replies to held commands; these commands bypass the queue."""
        self.is_behind = False
        """Whether received frames remain in the buffer until `process_frames` is called again."""
        self._askers: dict[object, Exchange] = {}
        """Numbered requests, keyed by number, whose replies belong to a later step or end a
        goal."""
        self._waiting_goals: dict[object, Exchange] = {}
        """Sent goals that may still wait for their services, keyed by request number."""
        self._is_leaving = False
        self._misses = 0
        """Number of consecutive missing replies."""
        self._silent_at: float | None = None
        """Time at which the connection becomes stale; None if it is not watched or is already
        stale."""

    @property
    def is_open(self) -> bool:
        """Whether the transport is connected."""
        return self.state == "open"

    @property
    def is_silent(self) -> bool:
        """Whether the robot has sent nothing for longer than `stale_after`."""
        return self.is_open and self.spec.stale_after_s is not None and self._silent_at is None

    def opened(self, now: float) -> list[LineEvent]:
        """Record that the transport is connected."""
        events = (
            self._lose("the connection was replaced by a new one") if self.state == "open" else []
        )
        self._reset("open")
        self.last_sent = now
        self._read_frames(now)
        if not self.spec.on_connect:
            events += self._get_ready()
        return events + self._pump(now)

    def ready(self, now: float) -> list[LineEvent]:
        """Record that the login is complete, and allow all requests."""
        return [*self._get_ready(), Ready(self.spec.name), *self._pump(now)]

    def _get_ready(self) -> list[LineEvent]:
        self.is_ready = True
        return [MotionReady(self.spec.name)] if self.has_motion else []

    def closed(self, reason: str, now: float) -> list[LineEvent]:
        """Record that the transport is not connected."""
        if self.state == "closed":
            return []
        events: list[LineEvent] = []
        was_open, pending = self.state == "open", self.receiver.decoder.pending
        if was_open and pending:
            text = f"the connection ended in the middle of a frame ({pending} bytes)"
            events.append(Violation(self.spec.name, "cut-frame", text))
        events += self._lose(reason or "the robot closed the connection")
        return events + self._pump(now)

    def fail(self, reason: str, now: float) -> list[LineEvent]:
        """Close the connection for the given reason and fail all pending requests."""
        if self.state == "closed":
            return []
        reason = self.receiver.secrets.hide(reason)
        events = self._lose(reason)
        events.append(Close(self.spec.name, reason))
        return events + self._pump(now)

    def leave(self, now: float) -> list[LineEvent]:
        """Begin an orderly close: run ``on_close`` if declared, otherwise close immediately."""
        if self.state != "open":
            return []
        if self.spec.on_close:
            lost = self._lost()
            self.is_ready, self._is_leaving = False, True
            return [
                *_disconnected(lost, "the connection is being closed"),
                ConnectionClosing(self.spec.name),
            ]
        return self.shut(now)

    def shut(self, now: float) -> list[LineEvent]:
        """Close the connection after the steps of ``on_close``."""
        events = self._lose("the connection was closed")
        return [*events, Close(self.spec.name), *self._pump(now)]

    def _lose(self, reason: str) -> list[LineEvent]:
        """Discard the connection and fail all pending requests."""
        lost = self._lost()
        for exchange in tuple(self._request_queue):
            if exchange.is_privileged:
                self._request_queue.remove(exchange)
        self._reset("closed")
        return _disconnected(lost, self.receiver.secrets.hide(reason))

    def _lost(self) -> list[Exchange]:
        """Remove and return all requests that fail when the connection is lost."""
        lost = self._pending_replies.drain()
        if not self.is_per_request:
            return lost + self._request_queue.drain()
        if not (self.is_ready or self._is_leaving):
            for exchange in list(self._request_queue)[:1]:  # its connection did not become ready
                self._request_queue.remove(exchange)
                lost.append(exchange)
        return lost

    def _reset(self, state: Literal["closed", "open"]) -> None:
        self.state = state
        self.is_ready = self._is_leaving = False
        self._pending_replies.clear()
        self.held.forget()
        self.receiver.reset(is_new=state == "open")
        self._misses = 0
        self._silent_at = None
        self.is_behind = False
        self.learnt = {}
        self._askers.clear()
        self._waiting_goals.clear()
        if state == "open":
            self.counters.reset()
            if self.codec is not None:
                self.codec.reset()

    def _read_frames(self, now: float) -> None:
        if self.spec.stale_after_s is not None:
            self._silent_at = now + self.spec.stale_after_s

    def _size_of(self, exchange: Exchange) -> int:
        return rendered_size(exchange, self.counters, self.learnt)

    def _as_sent(self, exchange: Exchange, number: int | None) -> Payload:
        """Return the payload of a request; register its secrets for redaction."""
        data = exchange.data
        assert data is not None  # noqa: S101 - it was made just before
        if exchange.is_secret:
            self.receiver.secrets.add(traffic_of(data), self.spec.encoding)
        if isinstance(data, Envelope) and number is not None:
            data = data._replace(attributes={**data.attributes, "id": number})
        return data

    def _unpacked(self, envelope: Envelope, now: float) -> list[LineEvent]:
        """Process an envelope whose body may be a binary ROS message."""
        if self.codec is None:
            return self._envelope(envelope, now)
        if self.codec.is_unencoded_goal(envelope) and (refused := self._refused(envelope, now)):
            return self._envelope(refused, now)
        found = self.codec.received(envelope)
        if found.fault:
            return [Violation(self.spec.name, "bad-value", found.fault)]
        if found.reply is not None:
            return [Send(self.spec.name, found.reply)]
        return [] if found.envelope is None else self._envelope(found.envelope, now)

    def _note_sent(self, data: Payload, exchange: Exchange, number: int | None) -> None:
        """Keep what later frames refer to: goals that wait for services, and numbered requests."""
        if self.codec is not None and isinstance(data, Envelope) and data.verb == GOAL:
            _keep(self._waiting_goals, number, exchange, MAX_WAITING)
        if number is not None and (not exchange.ask.answers or exchange.goal is not None):
            _keep(self._askers, number, exchange, MOST_IN_FLIGHT)

    def _refused(self, goal: Envelope, now: float) -> Envelope | None:
        """Return a refusal of a goal that must not be sent any more, or None.

        A goal waits up to a second for its services. Meanwhile, the conditions of its command, the
        rights of its operator and the lease may change, and the command may have failed.
        """
        number = goal.attributes.get("id")
        exchange = self._waiting_goals.pop(number, None)
        is_awaited = self._pending_replies.numbered(number) is not None
        if exchange is None or (exchange.ask.answers and not is_awaited):
            why_not = _OVER
        else:
            why_not = exchange.why_not(now)
        attributes = {"id": number, "ok": False, "reason": why_not}
        return Envelope("response", attributes) if why_not else None

    def _envelope(self, envelope: Envelope, now: float) -> list[LineEvent]:
        """Process a received envelope with plain data."""
        raise NotImplementedError

    def _pump(self, now: float) -> list[LineEvent]:
        """Send queued requests if the connection's current state allows it."""
        raise NotImplementedError


def _keep(found: dict[object, Any], number: object, item: object, most: int) -> None:
    """Add an item with a request's number; above `most` items, the oldest is dropped."""
    while len(found) >= most:
        del found[next(iter(found))]
    found[number] = item


def _disconnected(lost: list[Exchange], reason: str) -> list[LineEvent]:
    outcome = ExchangeOutcome("disconnected", reason)
    return [ExchangeEnded(exchange, outcome) for exchange in lost]
