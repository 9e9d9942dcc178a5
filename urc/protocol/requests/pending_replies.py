"""Pending replies: the requests in flight on one connection.

A `PendingReply` is one transmission of a request that waits for a reply. Pure. See
`urc.protocol.requests.conversation` for the theory of operation.
"""

from collections.abc import Mapping

from urc.expressions import ExpressionError
from urc.model.values import Reading, Sample
from urc.protocol.framing.base import Framing
from urc.protocol.requests.exchange import Exchange
from urc.protocol.requests.reply_match import Expectation, Fields, MatchResult, shown
from urc.protocol.values.payload import Frame
from urc.protocol.values.wire_text import WireText

__all__ = ["PendingReply", "PendingReplies"]


class PendingReply:
    """One transmission of a request that waits for its last reply or a timeout."""

    __slots__ = (
        "_expectation",
        "due",
        "exchange",
        "is_extended",
        "is_late",
        "number",
        "since",
        "size",
        "stage",
        "values",
    )

    def __init__(self, exchange: Exchange, now: float) -> None:
        self.exchange = exchange
        ask = exchange.ask
        self.stage = 0
        self._expectation: Expectation | None = None
        self.due = now + ask.answers[0].timeout_s
        """Time at which the reply becomes overdue, or a late transmission is removed."""
        self.size = 0
        """Number of bytes that the request occupies in the robot's receive buffer."""
        self.since = now
        """Start time of the wait for the current reply, in seconds."""
        self.is_extended = False
        """Whether the robot has requested more time for the reply."""
        self.is_late = False
        """Whether the reply has timed out. A late reply may still arrive and must not match
        another request."""
        self.values: dict[str, Reading] = {}
        self.number: int | None = None
        """Request number that the reply repeats; None means that the reply has no number."""

    @property
    def expectation(self) -> Expectation:
        """Collector of the frames of the current reply, created on first use."""
        if self._expectation is None:
            self._expectation = Expectation(self.exchange.ask.answers[self.stage])
        return self._expectation

    def answer(self, frame: Frame) -> MatchResult:
        """Return the match result for a frame that has this request's number."""
        offer = self.expectation.offer(frame)
        if offer is None:
            return MatchResult(refusal=f"the reply does not match the declaration: {shown(frame)}")
        return offer

    def refused(self, frame: Frame, reason: str, code: str) -> MatchResult:
        """Return a refusal with a failure code, and with the driver's text if declared."""
        offer = self.expectation.offer(frame)
        if offer is None or not offer.refusal:
            offer = MatchResult(refusal=reason)
        return offer._replace(code=code)

    def offer(self, frame: Frame, *, is_message: bool = False) -> MatchResult | None:
        """Return the match result for a frame; None if the frame answers another request.

        If `is_message` is true, only provisional replies and error replies can match.
        """
        if self.number is not None:
            return None  # its reply would carry the number; see `answer`
        is_mine = None if self.exchange.ask.match is None else self._is_mine
        return (
            self.expectation.beside(frame, is_mine)
            if is_message
            else self.expectation.offer(frame, is_mine)
        )

    def extend(self, now: float) -> None:
        """Restart the reply timeout, but do not exceed the driver's limit on the total wait."""
        answer = self.expectation.answer
        self.is_extended = True
        late_s = answer.timeout_s if self.is_late else 0.0
        self.due = min(now + answer.timeout_s, self.since + answer.extend_s + late_s)

    def waited(self, now: float) -> str:
        """Return the time waited in vain as text for messages, such as ``within 2 s``."""
        answer = self.expectation.answer
        if not self.is_extended:
            return f"within {answer.timeout_s:g} s"
        if now >= self.since + answer.extend_s:
            return f"within {answer.extend_s:g} s, while the robot was busy"
        return f"within {answer.timeout_s:g} s after the robot reported that it was busy"

    def next_stage(self, now: float) -> bool:
        """Start the wait for the next reply; return False after the last reply."""
        answers = self.exchange.ask.answers
        self.stage += 1
        if self.stage == len(answers):
            return False
        self._expectation, self.since, self.is_extended = None, now, False
        self.due = now + answers[self.stage].timeout_s
        return True

    def add(self, fields: Fields, samples: list[Sample]) -> None:
        """Store the samples and private fields of a reply."""
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
            names[name] = WireText(raw) if isinstance(raw, str) else raw
        try:
            return bool(match.evaluate(names))
        except ExpressionError:
            return False


class PendingReplies(list[PendingReply]):
    """Pending transmissions, in sending order.

    Late transmissions remain pending until their deadline.
    """

    __slots__ = ()

    def drain(self) -> list[Exchange]:
        """Remove all transmissions; return the requests that were still waiting for a reply."""
        waited = [pending.exchange for pending in self if not pending.is_late]
        self.clear()
        return waited

    @property
    def waiting(self) -> int:
        """Number of pending replies, excluding late replies and replies to real-time requests."""
        return sum(
            1 for pending in self if not pending.is_late and not pending.exchange.is_realtime
        )

    @property
    def size(self) -> int:
        """Number of unacknowledged bytes, which may still be in the robot's receive buffer."""
        return sum(pending.size for pending in self if not pending.exchange.is_realtime)

    @property
    def deadline(self) -> float | None:
        """Time of the earliest timeout among all pending replies; None if no reply is pending."""
        if len(self) == 1:
            return self[0].due
        return min((pending.due for pending in self), default=None)

    def may_confuse(self, exchange: Exchange) -> bool:
        """Return whether a late reply could be mistaken for this request's reply.

        A late reply to an earlier transmission of the same request does not count, because it
        answers the request.
        """
        if not (exchange.ask.answers and exchange.ask.is_in_order):
            return False
        return any(
            pending.is_late
            and pending.exchange is not exchange
            and pending.exchange.ask.is_in_order
            and not pending.exchange.is_realtime
            for pending in self
        )

    def again(self, exchange: Exchange) -> PendingReply | None:
        """Return the pending transmission of `exchange`, or None."""
        return next((one for one in self if one.exchange is exchange and not one.is_late), None)

    def has(self, label: str) -> bool:
        """Return whether a request with this label is waiting for a reply."""
        return any(pending.exchange.ask.label == label and not pending.is_late for pending in self)

    def overdue(self, now: float) -> list[PendingReply]:
        """Return the transmissions whose timeout has expired."""
        return [pending for pending in self if pending.due <= now] if self else []

    def framing(self) -> Framing | None:
        """Return the framing declared by a pending reply, or None."""
        for pending in self:
            if pending.exchange.ask.framing is not None:
                return pending.exchange.ask.framing
        return None

    def collects_lines(self) -> bool:
        """Return whether a multi-frame reply is pending, so that any frame may be part of it."""
        return any(pending.expectation.answer.lines is not None for pending in self)

    def plain(self) -> PendingReply | None:
        """Return the pending transmission if there is only one and its reply has only samples."""
        if len(self) != 1 or self[0].is_late or self[0].exchange.ask.plain is None:
            return None
        return self[0]

    def numbered(self, number: object) -> PendingReply | None:
        """Return the transmission that expects a reply with `number`, or None."""
        return next((one for one in self if one.number is not None and one.number == number), None)

    def offer(
        self, frame: Frame, *, is_message: bool = False
    ) -> tuple[PendingReply, MatchResult] | None:
        """Return the transmission that the frame answers and the match result, or None."""
        if len(self) == 1:
            only = self[0].offer(frame, is_message=is_message)
            return None if only is None else (self[0], only)
        has_first, has_first_realtime = False, False
        collecting: list[PendingReply] = []
        for pending in self:
            if pending.exchange.ask.is_in_order:
                is_realtime = pending.exchange.is_realtime
                if has_first_realtime if is_realtime else has_first:
                    continue
                # Late replies may never arrive, and silence never does: neither blocks other
                # replies.
                if not (pending.is_late or pending.expectation.answer.is_silence):
                    has_first_realtime |= is_realtime
                    has_first |= not is_realtime
            if pending.expectation.answer.lines is not None:
                collecting.append(pending)
                continue
            offer = pending.offer(frame, is_message=is_message)
            if offer is not None:
                return pending, offer
        for pending in collecting:  # last: any frame could be one of its lines
            offer = pending.offer(frame, is_message=is_message)
            if offer is not None:
                return pending, offer
        return None


def _plain(raw: object) -> Reading:
    """Return a raw field as a plain reply value."""
    if isinstance(raw, (list, tuple)):
        return tuple(map(_plain, raw))
    if raw is None or isinstance(raw, (bool, int, float, str, bytes, Mapping)):
        return raw
    return str(raw)
