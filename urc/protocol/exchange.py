"""One request, from whoever asks to its outcome.

Floor 3, pure. An `Ask` is what can be asked, compiled once; an `Exchange` is one such request, from
the queue to its end. What it waits for is an `urc.protocol.answer.Answer`.
"""

import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, Protocol

from urc.expressions import COUNTERS, Template
from urc.model.codec import Payload
from urc.model.flow import Retry
from urc.model.values import NOTHING, Reading
from urc.protocol.answer import Answer, Heard, Matcher
from urc.protocol.encode import Encode
from urc.protocol.events import Event, Failed, Replied, Request
from urc.protocol.framings.base import Framing
from urc.protocol.gate import REALTIME, Bucket, Counters

__all__ = [
    "DONE",
    "Ask",
    "Asked",
    "Ended",
    "Exchange",
    "Leaving",
    "LineEvent",
    "Outcome",
    "Owner",
    "expires_at",
    "untold",
]


class Outcome(NamedTuple):
    """How a request ended."""

    code: str = ""
    """"" when it is done; else as in `urc.protocol.events.Failed`."""
    message: str = ""
    values: Mapping[str, Reading] = NOTHING


DONE: Final = Outcome()
_MISSING: Final = re.compile(r"'[A-Za-z_][A-Za-z0-9_]*' has no value here")
new = tuple.__new__
"""Makes a named tuple without the detour through its class, where each command needs one."""


def untold(error: Exception) -> str:
    """Return why something secret is not sent, without what would show it."""
    text = str(error)
    if _MISSING.fullmatch(text):
        return text  # the name of what is missing, and nothing else
    return "it cannot be written; the reason is not shown, because it is secret"


class Ask(NamedTuple):
    """What can be asked, compiled once."""

    label: str
    """For messages: ``polls.0`` or the command's name."""
    encode: Encode
    answers: tuple[Answer, ...] = ()
    """One for each stage; () when nothing answers."""
    match: Template | None = None
    framing: Framing | None = None
    """Of its answers; None: the line's own."""
    rank: int = 2
    is_latest_only: bool = False
    bucket: Bucket | None = None
    retries: int = 0
    """How often it is sent again at most."""
    is_repeated: bool = False
    """It is sent again when no answer comes, not only when the robot asks for it."""
    retry: Retry = Retry()
    """How long it waits before it is sent again."""
    has_counters: bool = False
    is_motion: bool = False
    """It moves the robot: it must not wait until the line is usable and take effect then."""
    learnt: frozenset[str] = frozenset()
    """Names in it that the login of the line has read."""
    is_fresh: bool = False
    """It has the time in it, or bytes that are never sent twice."""
    is_local: bool = False
    """Its templates use nothing but its arguments, and counters."""
    queue_s: float = 0.0
    """How long it may wait to be sent."""
    plain: Matcher | None = None
    """Reads its only answer, where that is nothing but readings."""
    is_miss_harmless: bool = False
    """Its missing answers say nothing about the line: somebody else counts them."""
    is_numbered: bool = False
    """It is an envelope that carries a number, and so does its answer."""

    def made(self, names: Mapping[str, object]) -> Payload | None:
        """Return what is sent, as far as it is known now; None where it is made when it is sent.

        Raises:
            BadArgument: it cannot be written with these names.
        """
        if self.learnt:
            return None
        if not (self.has_counters or self.is_fresh):
            return self.encode(names)
        self.encode({**names, COUNTERS: Counters().draw()})
        return None

    @property
    def is_in_order(self) -> bool:
        """Whether nothing but the order of the answers tells which of them is its own."""
        return self.match is None and not self.is_numbered


class Owner(Protocol):
    """Who asked."""

    def ended(self, exchange: "Exchange", outcome: Outcome, now: float) -> "list[LineEvent]":
        """Take note of the outcome; return what to tell."""


class Exchange:
    """One request, from the queue to its outcome."""

    # What hardly any request sets stands in the class: one is made for every command.
    numbers: Mapping[str, int] = NOTHING
    """Of the counters in it."""
    is_privileged = False
    """It belongs to what makes the line usable, or says good-bye."""
    is_secret = False
    """Its text must not appear in any message."""
    condition: Callable[[float], str] | None = None
    """Asked again before it is sent: returns why not, or ""."""
    unless: Callable[[], str] | None = None
    """Asked then as well: returns why nobody wants it any more, or ""."""
    waits_until = float("-inf")
    """It is not sent again before."""
    on_sent: Callable[[Payload], None] | None = None
    """Told what is sent."""

    def __init__(
        self,
        ask: Ask,
        owner: Owner,
        namespace: Mapping[str, object],
        data: Payload | None,
        gives_up_at: float,
    ) -> None:
        self.ask = ask
        self.owner = owner
        self.namespace = namespace
        """What its templates know; without counters."""
        self.data = data
        """None: `Ask.made` leaves it to the moment of sending."""
        self.gives_up_at = gives_up_at
        """When it fails for having waited too long to be sent."""
        self.tries_left = ask.retries
        self.sent_at = gives_up_at
        """When it was last sent."""

    def mark(
        self,
        *,
        is_privileged: bool = False,
        is_secret: bool = False,
        condition: Callable[[float], str] | None = None,
        on_sent: Callable[[Payload], None] | None = None,
        unless: Callable[[], str] | None = None,
    ) -> "Exchange":
        """Say what is special about it, and return it."""
        self.on_sent = on_sent
        self.is_privileged = is_privileged
        self.is_secret = is_secret
        self.condition = condition
        self.unless = unless
        return self

    def why_not(self, now: float) -> str:
        """Return why it is not sent any more, or ""."""
        unwanted = self.unless() if self.unless is not None else ""
        return unwanted or (self.condition(now) if self.condition is not None else "")

    @property
    def rank(self) -> int:
        """The lower, the sooner it is sent."""
        return self.ask.rank

    @property
    def latest_key(self) -> str:
        """Its name, when a newer one takes its place."""
        return self.ask.label if self.ask.is_latest_only else ""

    @property
    def is_realtime(self) -> bool:
        """Whether it waits for nothing."""
        return self.ask.rank == REALTIME


class Ended(NamedTuple):
    """Inside the engine: a request is over."""

    exchange: Exchange
    outcome: Outcome


class Leaving(NamedTuple):
    """Inside the engine: the line is done with its connection, and wants to say good-bye."""

    transport: str


LineEvent = Event | Ended | Heard | Leaving


class Asked:
    """Whoever waits for the answer to a request: a sink, and the owner of a plain exchange."""

    __slots__ = ("_request",)

    def __init__(self, request: Request) -> None:
        self._request = request

    def __call__(self, outcome: Outcome, now: float) -> list[LineEvent]:
        """Return the one answer."""
        number, command = self._request.id, self._request.command
        if outcome.code:
            return [Failed(number, command, outcome.code, outcome.message)]
        return [new(Replied, (number, command, outcome.values))]

    @property
    def on_sent(self) -> Callable[[Payload], None] | None:
        """Whoever is to be told what is sent for it."""
        return self._request.on_sent

    def ended(self, exchange: Exchange, outcome: Outcome, now: float) -> list[LineEvent]:
        """Return the one answer."""
        return self(outcome, now)


def expires_at(ask: Ask, now: float) -> float:
    """Return when a request that is asked now has waited too long to be sent."""
    return now + ask.queue_s
