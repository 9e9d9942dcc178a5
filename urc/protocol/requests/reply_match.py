"""Expected replies: matching of single frames, and collection of multi-frame replies.

Pure. A `Matcher` decodes one kind of frame. A `CompiledReply` is the reply that a request expects.
An `Expectation` collects the frames of one reply. The conversation of the transport
(`urc.protocol.requests.conversation`) offers each received frame to the expectation.
"""

from collections.abc import Callable, Mapping
from typing import Final, Literal, NamedTuple, Protocol

from urc.expressions import ExpressionError, Template, quoted, text_of
from urc.model.payload import traffic_of
from urc.patterns import Pattern
from urc.protocol.framing.base import Framing
from urc.protocol.readings.compiled_value import Compiled, Taken
from urc.protocol.readings.readings import Decode
from urc.protocol.values.payload import BadItem, BadText, Frame, PayloadReader

__all__ = [
    "CompiledReply",
    "Aside",
    "Expectation",
    "Fields",
    "Matched",
    "ExpectationOwner",
    "Matcher",
    "MatchResult",
    "shown",
]

Fields = Mapping[str, object]
"""Raw values of a frame's fields, keyed by name."""

_MOST_COLLECTED: Final = 1 << 20
"""Maximum size of a multi-frame reply, in bytes."""


Aside = Literal["resend", "extend"]
"""Kind of a provisional reply: ``resend`` requests a retransmission, ``extend`` requests more
time."""


class Matcher:
    """A reader for one kind of frame, with a decoder for the fields.

    Args:
        reader: reader for the fields of a frame.
        decode: function that returns the samples and the rejected values from the fields.
        compiled: generated function that reads and decodes the most common frames.
    """

    __slots__ = ("decode", "reader", "take")

    def __init__(
        self, reader: PayloadReader, decode: Decode, compiled: Compiled | None = None
    ) -> None:
        self.reader = reader
        self.decode = decode
        self.take: Compiled = compiled or self._take
        """Function that returns the samples and rejected values of a frame; None if the frame does
        not match."""

    def _take(self, frame: Frame, now: float) -> Taken | None:
        found = self.read(frame)
        return None if found is None else self.decode(found, now)

    def read(self, frame: Frame) -> Fields | None:
        """Return the fields; None if the frame does not match or has undecodable text."""
        try:
            return self.reader.read(frame)
        except BadItem as error:
            frame.fault = str(error)
            return None
        except BadText:
            return None


class CompiledReply(NamedTuple):
    """The compiled form of an expected reply."""

    matcher: Matcher
    timeout_s: float
    errors: tuple[Pattern, ...] = ()
    faults: tuple[tuple[Matcher, Template | None], ...] = ()
    lines: int | Pattern | None = None
    framing: Framing | None = None
    """Framing while a step waits for this reply; None means the framing of the connection or the
    request."""
    asides: tuple[tuple[Aside, Matcher], ...] = ()
    """Provisional replies, as pairs of kind and matcher."""
    extend_s: float = 0.0
    """Maximum total wait for a reply whose timeout is extended, in seconds."""
    is_silence: bool = False
    """Whether silence until the reply timeout counts as success."""
    takes_redirects: bool = False
    """Whether the reply declares the redirect target as a field, so that a redirect is not a
    failure."""


class MatchResult(NamedTuple):
    """The result of matching a frame against an expectation."""

    fields: Fields | None = None
    """Fields of a complete reply; None for an incomplete reply or a refusal."""
    refusal: str = ""
    """The robot's refusal, as a human-readable message; "" means no refusal."""
    code: str = "refused"
    """Failure code of a refusal."""
    told: tuple[Matcher, Fields] | None = None
    """Matcher and fields of a provisional or error reply, for updating signals."""
    aside: Aside | None = None
    """Kind of provisional reply; None if the frame is not a provisional reply."""
    dropped: str = ""
    """Message about lines that were dropped from the reply; "" if no lines were dropped."""


_MORE: Final = MatchResult()
IsMine = Callable[[Fields], bool]
"""Function that returns whether a frame with the given fields belongs to the pending request."""


class Expectation:
    """A collector for the frames of one reply."""

    __slots__ = ("_lines", "_size", "answer", "owner")

    def __init__(self, answer: CompiledReply, owner: "ExpectationOwner | None" = None) -> None:
        self.answer = answer
        self.owner = owner
        self._lines: list[bytes] = []
        self._size = 0

    def offer(self, frame: Frame, is_mine: IsMine | None = None) -> MatchResult | None:
        """Return the match result for a frame; None if the frame is not part of the reply."""
        beside = self.beside(frame, is_mine)
        if beside is not None:
            return beside
        if self.answer.lines is not None:
            return self._collect(frame, self.answer.lines)
        found = self.answer.matcher.read(frame)
        if found is None or (is_mine is not None and not is_mine(found)):
            return None
        return MatchResult(found)

    def beside(self, frame: Frame, is_mine: IsMine | None = None) -> MatchResult | None:
        """Return the match result for a provisional or error reply; None for other frames.

        If the request has no correlation, the frame belongs to the oldest pending request.
        """
        for kind, matcher in self.answer.asides:
            fields = matcher.read(frame)
            if fields is not None and _is_about(fields, is_mine):
                return MatchResult(aside=kind, told=(matcher, fields))
        return self._refusal(self._so_far(frame), is_mine)

    def _so_far(self, frame: Frame) -> Frame:
        """Return the frame to check for a refusal; in a reply of N lines, all lines so far."""
        if not (self._lines and isinstance(self.answer.lines, int)):
            return frame
        if not isinstance(frame.payload, bytes):
            return frame
        return Frame(b"\n".join((*self._lines, frame.payload)), frame.encoding)

    def _refusal(self, frame: Frame, is_mine: IsMine | None) -> MatchResult | None:
        """Return the robot's refusal; None if the frame is not an error reply."""
        for matcher, text in self.answer.faults:  # first, because these give more detail
            fields = matcher.read(frame)
            if fields is not None and _is_about(fields, is_mine):
                if _lacks(text, fields) and self.answer.matcher.read(frame) is not None:
                    continue  # a valid reply may share some of these fields, but not the reason
                return MatchResult(refusal=_told(text, fields, frame), told=(matcher, fields))
        for pattern in self.answer.errors:
            groups = _search(pattern, frame)
            if groups is not None and _is_about(groups, is_mine):
                return MatchResult(refusal=f"the robot answered {shown(frame)}")
        return None

    def _collect(self, frame: Frame, lines: int | Pattern) -> MatchResult | None:
        payload = frame.payload
        if not isinstance(payload, bytes):
            return None
        self._lines.append(payload)
        self._size += len(payload) + 1
        if self._size > _MOST_COLLECTED:
            return self._drop(len(self._lines), "too many lines")
        if isinstance(lines, int):
            if len(self._lines) < lines:
                return _MORE
        elif _search(lines, frame) is None:
            return _MORE
        found = self.answer.matcher.read(Frame(b"\n".join(self._lines), frame.encoding))
        if found is not None:
            self._lines, self._size = [], 0
            return MatchResult(found)
        # A stray line before a counted reply must not shift all later replies.
        return self._drop(1 if isinstance(lines, int) else len(self._lines), "nothing matches it")

    def _drop(self, count: int, why: str) -> MatchResult:
        gone, self._lines = self._lines[:count], self._lines[count:]
        self._size = sum(len(line) + 1 for line in self._lines)
        return MatchResult(dropped=f"{len(gone)} lines of a reply were dropped: {why}")


class ExpectationOwner(Protocol):
    """The owner of an expectation, which receives the match results."""

    def matched(self, expectation: Expectation, offer: MatchResult, now: float) -> None:
        """Process the match result for a frame."""


class Matched(NamedTuple):
    """The engine's internal event for the arrival of an expected frame."""

    expectation: "Expectation"
    offer: "MatchResult"


def _is_about(fields: Fields, is_mine: IsMine | None) -> bool:
    """Return whether a frame with `fields` belongs to the request; True if there are no fields."""
    return is_mine is None or not fields or is_mine(fields)


def _search(pattern: Pattern, frame: Frame) -> Mapping[str, str | None] | None:
    try:
        return pattern.search(frame.text)
    except BadText:
        return None


def _lacks(text: Template | None, fields: Fields) -> bool:
    """Return whether the template of the error text uses fields that the frame lacks."""
    return text is not None and not text.names <= {*fields, "settings"}


def _told(text: Template | None, fields: Fields, frame: Frame) -> str:
    if text is not None:
        try:
            return text_of(text.evaluate(fields))
        except ExpressionError as error:
            return f"the robot refused; {error}"
    return f"the robot answered {shown(frame)}"


def shown(frame: Frame) -> str:
    """Return the text or the first bytes of a frame, for human-readable messages."""
    try:
        return quoted(frame.text, most=80)
    except BadText:
        payload = frame.payload
        if isinstance(payload, bytes):
            return payload[:40].hex(" ")
        return traffic_of(payload)[:80].decode("utf-8", "replace")
