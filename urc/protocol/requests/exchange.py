"""Requests and their execution from submission to outcome.

Pure. A `CompiledRequest` is a declared request in compiled form. An `Exchange` is one execution of
a request, from the queue to the outcome. `urc.protocol.requests.reply_match.CompiledReply`
describes the expected reply.
"""

import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, Protocol

from urc.expressions import COUNTERS, Template
from urc.model.exchange import Retry
from urc.model.payload import Payload
from urc.model.values import NOTHING, Reading
from urc.protocol.events import Event, Failed, Replied, Request
from urc.protocol.framing.base import Framing
from urc.protocol.requests.encode import Encode
from urc.protocol.requests.goal_watch import GoalWatch
from urc.protocol.requests.rate import REALTIME, Counters, GcraLimiter
from urc.protocol.requests.reply_match import CompiledReply, Matched, Matcher

__all__ = [
    "DONE",
    "CompiledRequest",
    "ReplySink",
    "ExchangeEnded",
    "Exchange",
    "ConnectionClosing",
    "LineEvent",
    "ExchangeOutcome",
    "RequestOwner",
    "expires_at",
    "untold",
]


class ExchangeOutcome(NamedTuple):
    """The result of a request."""

    code: str = ""
    """Failure code as in `urc.protocol.events.Failed`; "" means success."""
    message: str = ""
    values: Mapping[str, Reading] = NOTHING


DONE: Final = ExchangeOutcome()
_MISSING: Final = re.compile(r"'[A-Za-z_][A-Za-z0-9_]*' has no value here")
new = tuple.__new__
"""Fast constructor of named tuples, used for every command."""


def untold(error: Exception) -> str:
    """Return the error message for a secret frame that cannot be sent; omit the secret."""
    text = str(error)
    if _MISSING.fullmatch(text):
        return text  # only the name of a missing value, not a secret
    return "the frame cannot be encoded; the reason contains a secret"


class CompiledRequest(NamedTuple):
    """A compiled request for a command, poll, keepalive or step."""

    label: str
    """Label of the request in messages: the name of the command or poll, such as ``polls.0``."""
    encode: Encode
    answers: tuple[CompiledReply, ...] = ()
    """Expected replies, one for each stage; () means no reply."""
    match: Template | None = None
    framing: Framing | None = None
    """Framing for the replies; None means the connection's framing."""
    rank: int = 2
    is_latest_only: bool = False
    bucket: GcraLimiter | None = None
    retries: int = 0
    """Maximum number of retries for the request."""
    is_repeated: bool = False
    """Whether a missing reply causes a retry; a retransmission request from the robot always
    does."""
    retry: Retry = Retry()
    """Delays before the first retry and all further retries."""
    has_counters: bool = False
    is_motion: bool = False
    """Whether the request moves the robot. Motion requests fail immediately if the connection is
    not ready."""
    learnt: frozenset[str] = frozenset()
    """Names of the values read during the login that the request's templates use."""
    is_fresh: bool = False
    """Whether the request contains the time or a nonce, so it is rendered when it is sent."""
    is_local: bool = False
    """Whether the request's templates use only arguments and counters."""
    queue_s: float = 0.0
    """Maximum time for which the request may wait in the queue, in seconds."""
    plain: Matcher | None = None
    """Reader for the reply if the request expects a single frame that contains only samples;
    otherwise None."""
    is_miss_harmless: bool = False
    """Whether missing replies are counted only for the poll and never indicate a lost
    connection."""
    is_numbered: bool = False
    """Whether the request is an envelope with a number that the reply repeats."""

    def render(self, names: Mapping[str, object]) -> Payload | None:
        """Return the payload; None if it must be rendered when it is sent.

        Raises:
            BadArgument: the payload cannot be encoded with `names`.
        """
        if self.learnt:
            return None
        if not (self.has_counters or self.is_fresh):
            return self.encode(names)
        self.encode({**names, COUNTERS: Counters().draw()})
        return None

    @property
    def is_in_order(self) -> bool:
        """Whether the request's reply can be identified only by the order of replies."""
        return self.match is None and not self.is_numbered


class RequestOwner(Protocol):
    """The owner of a request, which receives the outcome."""

    def ended(
        self, exchange: "Exchange", outcome: ExchangeOutcome, now: float
    ) -> "list[LineEvent]":
        """Process the outcome of a request; return the resulting events."""


class Exchange:
    """One execution of a request, from the queue to the outcome."""

    # Rarely set attributes are class attributes, because every command creates an instance.
    numbers: Mapping[str, int] = NOTHING
    """Numbers in the last rendered frame, keyed by counter."""
    is_privileged = False
    """Whether the request is part of the login or the close sequence, and may be sent before the
    connection is ready."""
    is_secret = False
    """Whether the payload is secret and must not appear in any message."""
    condition: Callable[[float], str] | None = None
    """Function that returns the reason for refusing the request, or ""; evaluated before
    sending."""
    unless: Callable[[], str] | None = None
    """Function that returns why the request is obsolete, or ""; evaluated before sending."""
    waits_until = float("-inf")
    """Earliest time at which a retry may be sent, in seconds."""
    on_sent: Callable[[Payload], None] | None = None
    """Callback for each sent payload."""
    goal: GoalWatch | None = None
    """Object that reports the start and the end of the request's goal of a ROS action."""

    def __init__(
        self,
        ask: CompiledRequest,
        owner: RequestOwner,
        namespace: Mapping[str, object],
        data: Payload | None,
        gives_up_at: float,
    ) -> None:
        self.ask = ask
        self.owner = owner
        self.namespace = namespace
        """Values for the templates, keyed by name, excluding counters."""
        self.data = data
        """Rendered payload; None means that the payload is rendered when it is sent
        (`CompiledRequest.render`)."""
        self.gives_up_at = gives_up_at
        """Time at which a queued request fails, in seconds."""
        self.tries_left = ask.retries
        self.sent_at = gives_up_at
        """Time of the last transmission, in seconds."""

    def mark(
        self,
        *,
        is_privileged: bool = False,
        is_secret: bool = False,
        condition: Callable[[float], str] | None = None,
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
    ) -> "Exchange":
        """Set rarely used attributes and return the exchange."""
        self.on_sent = on_sent
        self.is_privileged = is_privileged
        self.is_secret = is_secret
        self.condition = condition
        self.unless = unless
        return self

    def why_not(self, now: float) -> str:
        """Return the reason for not sending the request, or ""."""
        unwanted = self.unless() if self.unless is not None else ""
        return unwanted or (self.condition(now) if self.condition is not None else "")

    @property
    def rank(self) -> int:
        """Priority rank; exchanges with lower ranks are sent first."""
        return self.ask.rank

    @property
    def latest_key(self) -> str:
        """Label of requests that replace each other in the queue; "" for any other request."""
        return self.ask.label if self.ask.is_latest_only else ""

    @property
    def is_realtime(self) -> bool:
        """Whether the request bypasses the queue."""
        return self.ask.rank == REALTIME


class ExchangeEnded(NamedTuple):
    """The engine's internal event for the end of a request."""

    exchange: Exchange
    outcome: ExchangeOutcome


class ConnectionClosing(NamedTuple):
    """The engine's internal event when the conversation is ready for the ``on_close`` steps."""

    transport: str


LineEvent = Event | ExchangeEnded | Matched | ConnectionClosing


class ReplySink:
    """A sink that returns the outcome of a request as an event and may own an exchange."""

    __slots__ = ("_request",)

    def __init__(self, request: Request) -> None:
        self._request = request

    def __call__(self, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Return the `Replied` or `Failed` event for the request."""
        number, command = self._request.id, self._request.command
        if outcome.code:
            return [Failed(number, command, outcome.code, outcome.message)]
        return [new(Replied, (number, command, outcome.values))]

    @property
    def on_sent(self) -> Callable[[Payload], None] | None:
        """Callback for each sent payload."""
        return self._request.on_sent

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Return the `Replied` or `Failed` event for the request."""
        return self(outcome, now)


def expires_at(ask: CompiledRequest, now: float) -> float:
    """Return the time at which a new request fails if it is still queued."""
    return now + ask.queue_s
