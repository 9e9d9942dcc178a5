"""One request, from its owner to its outcome.

Pure. An `CompiledRequest` is a request, compiled once. An `Exchange` is one execution of it, from
the queue to its end. `urc.protocol.requests.reply_match.CompiledReply` describes the expected
reply.
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
    """"" on success; otherwise a code of `urc.protocol.events.Failed`."""
    message: str = ""
    values: Mapping[str, Reading] = NOTHING


DONE: Final = ExchangeOutcome()
_MISSING: Final = re.compile(r"'[A-Za-z_][A-Za-z0-9_]*' has no value here")
new = tuple.__new__
"""Makes a named tuple faster than its class does; every command needs one."""


def untold(error: Exception) -> str:
    """Return why a secret frame is not sent, without revealing the secret."""
    text = str(error)
    if _MISSING.fullmatch(text):
        return text  # only the name of a missing value, and no secret
    return "it cannot be written; the reason is secret"


class CompiledRequest(NamedTuple):
    """A request, compiled once."""

    label: str
    """Label in messages: ``polls.0`` or the name of the command."""
    encode: Encode
    answers: tuple[CompiledReply, ...] = ()
    """Expected reply of each stage; () without a reply."""
    match: Template | None = None
    framing: Framing | None = None
    """Framing of its replies; None: that of the connection."""
    rank: int = 2
    is_latest_only: bool = False
    bucket: GcraLimiter | None = None
    retries: int = 0
    """Largest number of retries."""
    is_repeated: bool = False
    """Whether a missing reply causes a retry, not only a request by the robot."""
    retry: Retry = Retry()
    """Waits before the retries."""
    has_counters: bool = False
    is_motion: bool = False
    """Whether it moves the robot. Motion fails on a connection that is not ready, instead of
    waiting."""
    learnt: frozenset[str] = frozenset()
    """Names in its templates that the login reads."""
    is_fresh: bool = False
    """Whether it contains the time or a nonce."""
    is_local: bool = False
    """Whether its templates use only its arguments and counters."""
    queue_s: float = 0.0
    """Longest time in the queue, in seconds."""
    plain: Matcher | None = None
    """Reader of its only reply, if that consists of samples alone."""
    is_miss_harmless: bool = False
    """Whether missing replies say nothing about the connection, because the poll counts them."""
    is_numbered: bool = False
    """Whether it is an envelope with a number, which its reply repeats."""

    def render(self, names: Mapping[str, object]) -> Payload | None:
        """Return the payload, or None if it is rendered when it is sent.

        Raises:
            BadArgument: the payload cannot be written with these names.
        """
        if self.learnt:
            return None
        if not (self.has_counters or self.is_fresh):
            return self.encode(names)
        self.encode({**names, COUNTERS: Counters().draw()})
        return None

    @property
    def is_in_order(self) -> bool:
        """Whether only the order of replies identifies the reply to this request."""
        return self.match is None and not self.is_numbered


class RequestOwner(Protocol):
    """The owner of a request."""

    def ended(
        self, exchange: "Exchange", outcome: ExchangeOutcome, now: float
    ) -> "list[LineEvent]":
        """Record the outcome; return the resulting events."""


class Exchange:
    """One request, from the queue to its outcome."""

    # Rarely set attributes are class attributes, because every command makes an instance.
    numbers: Mapping[str, int] = NOTHING
    """Counter → number in the last rendered frame."""
    is_privileged = False
    """Whether it belongs to the login or the close, and may be sent before the connection is
    ready."""
    is_secret = False
    """Whether its text must not appear in any message."""
    condition: Callable[[float], str] | None = None
    """Check before sending: returns why the request is not allowed, or ""."""
    unless: Callable[[], str] | None = None
    """Check before sending: returns why the request is obsolete, or ""."""
    waits_until = float("-inf")
    """Earliest time of a retry."""
    on_sent: Callable[[Payload], None] | None = None
    """Callback for each sent payload."""

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
        """Names of its templates, without counters."""
        self.data = data
        """Rendered payload; None if it is rendered when it is sent, see `CompiledRequest.made`."""
        self.gives_up_at = gives_up_at
        """Time at which it fails in the queue."""
        self.tries_left = ask.retries
        self.sent_at = gives_up_at
        """Time of the last transmission."""

    def mark(
        self,
        *,
        is_privileged: bool = False,
        is_secret: bool = False,
        condition: Callable[[float], str] | None = None,
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
    ) -> "Exchange":
        """Set the rare attributes, and return the exchange."""
        self.on_sent = on_sent
        self.is_privileged = is_privileged
        self.is_secret = is_secret
        self.condition = condition
        self.unless = unless
        return self

    def why_not(self, now: float) -> str:
        """Return why it is not sent, or ""."""
        unwanted = self.unless() if self.unless is not None else ""
        return unwanted or (self.condition(now) if self.condition is not None else "")

    @property
    def rank(self) -> int:
        """Priority rank; lower ranks are sent first."""
        return self.ask.rank

    @property
    def latest_key(self) -> str:
        """Label, if a newer request replaces it in the queue; otherwise ""."""
        return self.ask.label if self.ask.is_latest_only else ""

    @property
    def is_realtime(self) -> bool:
        """Whether it bypasses the queue."""
        return self.ask.rank == REALTIME


class ExchangeEnded(NamedTuple):
    """Internal event of the engine: a request has ended."""

    exchange: Exchange
    outcome: ExchangeOutcome


class ConnectionClosing(NamedTuple):
    """Internal event of the engine: the conversation starts the steps of its close."""

    transport: str


LineEvent = Event | ExchangeEnded | Matched | ConnectionClosing


class ReplySink:
    """The sink for the outcome of a request, and the owner of a plain exchange."""

    __slots__ = ("_request",)

    def __init__(self, request: Request) -> None:
        self._request = request

    def __call__(self, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Return the event that ends the request."""
        number, command = self._request.id, self._request.command
        if outcome.code:
            return [Failed(number, command, outcome.code, outcome.message)]
        return [new(Replied, (number, command, outcome.values))]

    @property
    def on_sent(self) -> Callable[[Payload], None] | None:
        """Callback for each sent payload."""
        return self._request.on_sent

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Return the event that ends the request."""
        return self(outcome, now)


def expires_at(ask: CompiledRequest, now: float) -> float:
    """Return the time at which a new request fails in the queue."""
    return now + ask.queue_s
