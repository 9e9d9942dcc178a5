"""One request and its answers.

Floor 3, pure. An `Ask` is what can be asked, compiled once; an `Exchange` is one such request, from
the queue to its end; a `Flight` is one time that it was sent. An `Ear` collects the frames of one
answer: the transport's conversation (`urc.protocol.line`) offers it each frame that comes in.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, Protocol

from urc.expressions import ExpressionError, Template, text_of
from urc.model.driver import TransportSpec
from urc.model.values import NOTHING, Reading, Sample
from urc.patterns import Pattern
from urc.protocol.bounds import queue_limit_s
from urc.protocol.encode import Encode
from urc.protocol.events import Event
from urc.protocol.fast_read import FastRead, Taken
from urc.protocol.forms import BadItem, BadText, Frame, Reader
from urc.protocol.framing import Framing
from urc.protocol.gate import REALTIME, Bucket
from urc.protocol.readings import Decode
from urc.protocol.word import Word

__all__ = [
    "DONE",
    "Answer",
    "Ask",
    "Ear",
    "Ended",
    "Exchange",
    "Fields",
    "Flight",
    "Heard",
    "Leaving",
    "LineEvent",
    "Matcher",
    "Offer",
    "Outcome",
    "Listening",
    "Owner",
    "expires_at",
]

Fields = Mapping[str, object]
"""What a frame says: name → raw value."""

_MOST_COLLECTED: Final = 1 << 20
"""Bytes that a reply of several frames may have."""


class Matcher(NamedTuple):
    """A reader and what becomes of its fields."""

    reader: Reader
    decode: Decode
    make_fast: Callable[[], FastRead | None] | None = None
    """Makes a function that does both in one, for text."""
    prefix: str = ""
    """What the text of its frames begins with, blanks aside; "" when that is not known."""

    def take(self, frame: Frame, now: float) -> Taken | None:
        """Return samples and refused values, or None when the frame is another one."""
        found = self.read(frame)
        return None if found is None else self.decode(found, now)

    def read(self, frame: Frame) -> Fields | None:
        """Return the fields, or None when the frame is another one or no text at all."""
        try:
            return self.reader.read(frame)
        except BadItem as error:
            frame.fault = str(error)
            return None
        except BadText:
            return None


class Outcome(NamedTuple):
    """How a request ended."""

    code: str = ""
    """"" when it is done; else as in `urc.protocol.events.Failed`."""
    message: str = ""
    values: Mapping[str, Reading] = NOTHING


DONE: Final = Outcome()


class Answer(NamedTuple):
    """What one answer looks like, compiled."""

    matcher: Matcher
    timeout_s: float
    errors: tuple[Pattern, ...] = ()
    faults: tuple[tuple[Matcher, Template | None], ...] = ()
    lines: int | Pattern | None = None


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
    has_counters: bool = False
    is_motion: bool = False
    """It moves the robot: it must not wait until the line is usable and take effect then."""
    is_miss_harmless: bool = False
    """Its missing answers say nothing about the line: somebody else counts them."""


class Owner(Protocol):
    """Who asked."""

    def ended(self, exchange: "Exchange", outcome: Outcome, now: float) -> "list[LineEvent]":
        """Take note of the outcome; return what to tell."""


class Exchange:
    """One request, from the queue to its outcome."""

    __slots__ = (
        "ask",
        "condition",
        "data",
        "gives_up_at",
        "is_privileged",
        "is_secret",
        "namespace",
        "numbers",
        "owner",
        "sent_at",
        "tries_left",
    )

    def __init__(
        self,
        ask: Ask,
        owner: Owner,
        namespace: Mapping[str, object],
        data: bytes | None,
        *,
        gives_up_at: float,
        is_privileged: bool = False,
        is_secret: bool = False,
        condition: Callable[[float], str] | None = None,
    ) -> None:
        self.ask = ask
        self.owner = owner
        self.namespace = namespace
        """What its templates know; without counters."""
        self.data = data
        """None: there are counters in it, so it is made when it is sent."""
        self.numbers: Mapping[str, int] = NOTHING
        """Of the counters in it."""
        self.gives_up_at = gives_up_at
        """When it fails for having waited too long to be sent."""
        self.is_privileged = is_privileged
        """It belongs to what makes the line usable, or says good-bye."""
        self.is_secret = is_secret
        """Its text must not appear in any message."""
        self.condition = condition
        """Asked again before it is sent: returns why not, or ""."""
        self.tries_left = ask.retries
        self.sent_at = gives_up_at
        """When it was last sent."""

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


class Heard(NamedTuple):
    """Inside the engine: what somebody listened for has come."""

    ear: "Ear"
    offer: "Offer"


class Leaving(NamedTuple):
    """Inside the engine: the line is done with its connection, and wants to say good-bye."""

    transport: str


LineEvent = Event | Ended | Heard | Leaving


class Offer(NamedTuple):
    """What an ear made of a frame."""

    fields: Fields | None = None
    """Of a whole answer; None: more is to come, or it is a refusal."""
    refusal: str = ""
    """Why the robot refused, for people."""
    dropped: str = ""
    """What was collected before and belongs to no answer, for people."""


_MORE: Final = Offer()


class Ear:
    """Collects the frames of one answer."""

    __slots__ = ("_lines", "_size", "answer", "owner")

    def __init__(self, answer: Answer, owner: "Listening | None" = None) -> None:
        self.answer = answer
        self.owner = owner
        self._lines: list[bytes] = []
        self._size = 0

    def offer(self, frame: Frame, is_mine: Callable[[Fields], bool] | None = None) -> Offer | None:
        """Return what the frame means here, or None when it is no part of the answer.

        Args:
            frame: as it came in.
            is_mine: tells by its fields whether an answer is the one waited for.
        """
        refused = self._refusal(frame, is_mine)
        if refused is not None:
            return refused
        if self.answer.lines is not None:
            return self._collect(frame, self.answer.lines)
        found = self.answer.matcher.read(frame)
        if found is None or (is_mine is not None and not is_mine(found)):
            return None
        return Offer(found)

    def _refusal(self, frame: Frame, is_mine: Callable[[Fields], bool] | None) -> Offer | None:
        """Return why the robot refused; what names nobody is for whoever waits longest."""
        for matcher, text in self.answer.faults:  # first: they say more
            fields = matcher.read(frame)
            if fields is not None and (is_mine is None or not fields or is_mine(fields)):
                return Offer(refusal=_told(text, fields, frame))
        for pattern in self.answer.errors:
            groups = _search(pattern, frame)
            if groups is not None and (is_mine is None or not groups or is_mine(groups)):
                return Offer(refusal=f"the robot answered {_shown(frame)}")
        return None

    def _collect(self, frame: Frame, lines: int | Pattern) -> Offer | None:
        payload = frame.payload
        if not isinstance(payload, bytes):
            return None
        self._lines.append(payload)
        self._size += len(payload) + 1
        if self._size > _MOST_COLLECTED:
            return self._drop(len(self._lines), "it has too many lines")
        if isinstance(lines, int):
            if len(self._lines) < lines:
                return _MORE
        elif _search(lines, frame) is None:
            return _MORE
        found = self.answer.matcher.read(Frame(b"\n".join(self._lines), frame.encoding))
        if found is not None:
            self._lines, self._size = [], 0
            return Offer(found)
        # A stray line in front of a counted reply must not shift it for ever.
        return self._drop(1 if isinstance(lines, int) else len(self._lines), "nothing matches it")

    def _drop(self, count: int, why: str) -> Offer:
        gone, self._lines = self._lines[:count], self._lines[count:]
        self._size = sum(len(line) + 1 for line in self._lines)
        return Offer(dropped=f"{len(gone)} lines of a reply were dropped: {why}")


class Listening(Protocol):
    """Who put out an ear."""

    def heard(self, ear: Ear, offer: Offer, now: float) -> None:
        """Take what came."""


class Flight:
    """One time that a request was sent, until its last answer has come or is given up."""

    __slots__ = ("due", "ear", "exchange", "is_late", "stage", "values")

    def __init__(self, exchange: Exchange, now: float) -> None:
        self.exchange = exchange
        self.stage = 0
        self.ear = Ear(exchange.ask.answers[0])
        self.due = now + self.ear.answer.timeout_s
        """When its answer is overdue; of one that is late: when it is not expected any more."""
        self.is_late = False
        """It has failed, but its answer may still come and must not be taken for another's."""
        self.values: dict[str, Reading] = {}

    def offer(self, frame: Frame) -> Offer | None:
        """Return what the frame means for this request, or None when it answers another one."""
        return self.ear.offer(frame, None if self.exchange.ask.match is None else self._is_mine)

    def next_stage(self, now: float) -> bool:
        """Wait for the next answer; return whether there is one to come."""
        answers = self.exchange.ask.answers
        self.stage += 1
        if self.stage == len(answers):
            return False
        self.ear = Ear(answers[self.stage])
        self.due = now + self.ear.answer.timeout_s
        return True

    def take(self, fields: Fields, samples: list[Sample]) -> None:
        """Keep what an answer says: its readings, and what is the document's own."""
        for name, raw in fields.items():
            if name.startswith("_"):
                self.values[name[1:]] = _plain(raw)
        for sample in samples:
            self.values[sample.signal] = sample.value

    def _is_mine(self, fields: Fields) -> bool:
        match = self.exchange.ask.match
        if match is None:
            return True
        names: dict[str, object] = {"seq": self.exchange.numbers, **self.exchange.namespace}
        for name, raw in fields.items():
            names[name] = Word(raw) if isinstance(raw, str) else raw
        try:
            return bool(match.evaluate(names))
        except ExpressionError:
            return False


def expires_at(spec: TransportSpec, ask: Ask, now: float) -> float:
    """Return when a request that is asked now has waited too long to be sent."""
    return now + queue_limit_s(spec, ask.answers[0].timeout_s if ask.answers else None)


def _search(pattern: Pattern, frame: Frame) -> Mapping[str, str | None] | None:
    try:
        return pattern.search(frame.text)
    except BadText:
        return None


def _told(text: Template | None, fields: Fields, frame: Frame) -> str:
    if text is not None:
        try:
            return text_of(text.evaluate(fields))
        except ExpressionError as error:
            return f"the robot refused; {error}"
    return f"the robot answered {_shown(frame)}"


def _shown(frame: Frame) -> str:
    try:
        return repr(frame.text[:80])
    except BadText:
        payload = frame.payload
        return payload[:40].hex(" ") if isinstance(payload, bytes) else "with an error"


def _plain(raw: object) -> Reading:
    """Return a raw value as something that a reply may carry."""
    if isinstance(raw, (list, tuple)):
        return tuple(map(_plain, raw))
    if raw is None or isinstance(raw, (bool, int, float, str, bytes, Mapping)):
        return raw
    return str(raw)
