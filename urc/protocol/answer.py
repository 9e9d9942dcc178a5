"""What an answer is, and how its frames are collected.

Floor 3, pure. A `Matcher` reads one kind of frame, an `Answer` is what a request waits for, and an
`Ear` collects the frames of one answer: the transport's conversation (`urc.protocol.line`) offers
it each frame that comes in.
"""

from collections.abc import Callable, Mapping
from typing import Final, Literal, NamedTuple, Protocol

from urc.expressions import ExpressionError, Template, quoted, text_of
from urc.model.codec import traffic_of
from urc.patterns import Pattern
from urc.protocol.codec import BadItem, BadText, Frame, Reader
from urc.protocol.fast_value import Compiled, Taken
from urc.protocol.framings.base import Framing
from urc.protocol.readings import Decode

__all__ = [
    "Answer",
    "Aside",
    "Ear",
    "Fields",
    "Heard",
    "Listening",
    "Matcher",
    "Offer",
    "shown",
]

Fields = Mapping[str, object]
"""What a frame says: name → raw value."""

_MOST_COLLECTED: Final = 1 << 20
"""Bytes that a reply of several frames may have."""


Aside = Literal["resend", "extend"]
"""The request once more, or more time."""


class Matcher:
    """Reads one kind of frame, and makes samples of its fields.

    Args:
        reader: reads the fields of a frame.
        decode: makes samples of fields, and lists refused values.
        compiled: a function that does both for the most common frames.
    """

    __slots__ = ("decode", "reader", "take")

    def __init__(self, reader: Reader, decode: Decode, compiled: Compiled | None = None) -> None:
        self.reader = reader
        self.decode = decode
        self.take: Compiled = compiled or self._take
        """Return samples and refused values, or None when the frame is another one."""

    def _take(self, frame: Frame, now: float) -> Taken | None:
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


class Answer(NamedTuple):
    """What one answer looks like, compiled."""

    matcher: Matcher
    timeout_s: float
    errors: tuple[Pattern, ...] = ()
    faults: tuple[tuple[Matcher, Template | None], ...] = ()
    lines: int | Pattern | None = None
    framing: Framing | None = None
    """What cuts the line while a step waits for it; None: the line's own, or its request's."""
    asides: tuple[tuple[Aside, Matcher], ...] = ()
    """What the robot may ask for instead of answering, and the frame by which it does."""
    extend_s: float = 0.0
    """For how long it may ask for more time, in all."""
    is_silence: bool = False
    """The robot says nothing when it does what was asked: the time that passes is the answer."""
    takes_redirects: bool = False
    """It reads where the robot sends whoever asks, so that this is no failure."""


class Offer(NamedTuple):
    """What an ear made of a frame."""

    fields: Fields | None = None
    """Of a whole answer; None: more is to come, or it is a refusal."""
    refusal: str = ""
    """Why the robot refused, for people."""
    told: tuple[Matcher, Fields] | None = None
    """What a frame says that is no answer, for signals."""
    aside: Aside | None = None
    """What the robot asks for instead of answering."""
    dropped: str = ""
    """What was collected before and belongs to no answer, for people."""


_MORE: Final = Offer()
IsMine = Callable[[Fields], bool]
"""Tells by its fields whether a frame is about the request that waits."""


class Ear:
    """Collects the frames of one answer."""

    __slots__ = ("_lines", "_size", "answer", "owner")

    def __init__(self, answer: Answer, owner: "Listening | None" = None) -> None:
        self.answer = answer
        self.owner = owner
        self._lines: list[bytes] = []
        self._size = 0

    def offer(self, frame: Frame, is_mine: IsMine | None = None) -> Offer | None:
        """Return what the frame means here, or None when it is no part of the answer."""
        beside = self.beside(frame, is_mine)
        if beside is not None:
            return beside
        if self.answer.lines is not None:
            return self._collect(frame, self.answer.lines)
        found = self.answer.matcher.read(frame)
        if found is None or (is_mine is not None and not is_mine(found)):
            return None
        return Offer(found)

    def beside(self, frame: Frame, is_mine: IsMine | None = None) -> Offer | None:
        """Return what the frame means when it takes the place of an answer, or None.

        It asks for the request again, or for more time, or refuses. What names no request is about
        the one that has waited longest.
        """
        for kind, matcher in self.answer.asides:
            fields = matcher.read(frame)
            if fields is not None and _is_about(fields, is_mine):
                return Offer(aside=kind, told=(matcher, fields))
        return self._refusal(self._so_far(frame), is_mine)

    def _so_far(self, frame: Frame) -> Frame:
        """Return what a refusal is looked for in: of a counted reply, all of it that has come."""
        if not (self._lines and isinstance(self.answer.lines, int)):
            return frame
        if not isinstance(frame.payload, bytes):
            return frame
        return Frame(b"\n".join((*self._lines, frame.payload)), frame.encoding)

    def _refusal(self, frame: Frame, is_mine: IsMine | None) -> Offer | None:
        """Return why the robot refused, or None."""
        for matcher, text in self.answer.faults:  # first: they say more
            fields = matcher.read(frame)
            if fields is not None and _is_about(fields, is_mine):
                if _lacks(text, fields) and self.answer.matcher.read(frame) is not None:
                    continue  # a good answer has some of these fields, too, but not the reason
                return Offer(refusal=_told(text, fields, frame), told=(matcher, fields))
        for pattern in self.answer.errors:
            groups = _search(pattern, frame)
            if groups is not None and _is_about(groups, is_mine):
                return Offer(refusal=f"the robot answered {shown(frame)}")
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


class Heard(NamedTuple):
    """Inside the engine: what somebody listened for has come."""

    ear: "Ear"
    offer: "Offer"


def _is_about(fields: Fields, is_mine: IsMine | None) -> bool:
    """Return whether a frame with `fields` is about the request; one without names none."""
    return is_mine is None or not fields or is_mine(fields)


def _search(pattern: Pattern, frame: Frame) -> Mapping[str, str | None] | None:
    try:
        return pattern.search(frame.text)
    except BadText:
        return None


def _lacks(text: Template | None, fields: Fields) -> bool:
    """Return whether the words for people need what the frame has not."""
    return text is not None and not text.names <= {*fields, "settings"}


def _told(text: Template | None, fields: Fields, frame: Frame) -> str:
    if text is not None:
        try:
            return text_of(text.evaluate(fields))
        except ExpressionError as error:
            return f"the robot refused; {error}"
    return f"the robot answered {shown(frame)}"


def shown(frame: Frame) -> str:
    """Return a frame in messages for people: its text, or its first bytes."""
    try:
        return quoted(frame.text, most=80)
    except BadText:
        payload = frame.payload
        if isinstance(payload, bytes):
            return payload[:40].hex(" ")
        return traffic_of(payload)[:80].decode("utf-8", "replace")
