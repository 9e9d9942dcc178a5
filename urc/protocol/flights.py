"""What is in flight on one line: sent, and not answered yet.

A `Flight` is one time that a request was sent.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from collections.abc import Mapping

from urc.expressions import ExpressionError
from urc.model.values import Reading, Sample
from urc.protocol.answer import Ear, Fields, Offer, shown
from urc.protocol.codec import Frame
from urc.protocol.exchange import Exchange
from urc.protocol.framings.base import Framing
from urc.protocol.word import Word

__all__ = ["Flight", "Flights"]


class Flight:
    """One time that a request was sent, until its last answer has come or is given up."""

    __slots__ = ("_ear", "due", "exchange", "is_late", "number", "quick", "stage", "values")

    def __init__(self, exchange: Exchange, now: float) -> None:
        self.exchange = exchange
        ask = exchange.ask
        self.quick = ask.quick
        self.stage = 0
        self._ear: Ear | None = None
        """Made when it is needed: hardly ever, where `quick` is enough."""
        self.due = now + ask.answers[0].timeout_s
        """When its answer is overdue; of one that is late: when it is not expected any more."""
        self.is_late = False
        """It has failed, but its answer may still come and must not be taken for another's."""
        self.values: dict[str, Reading] = {}
        self.number: int | None = None
        """What its answer carries; None: it is recognised otherwise."""

    @property
    def ear(self) -> Ear:
        """Collects the frames of the answer that is waited for."""
        if self._ear is None:
            self._ear = Ear(self.exchange.ask.answers[self.stage])
        return self._ear

    def answer(self, frame: Frame) -> Offer:
        """Return what the frame means, which carries the number of this request."""
        offer = self.ear.offer(frame)
        if offer is None:
            return Offer(refusal=f"its answer is not as declared: {shown(frame)}")
        return offer

    def refused(self, frame: Frame, reason: str) -> Offer:
        """Return why the robot refused: in the words of the driver, where it has some for it."""
        offer = self.ear.offer(frame)
        return offer if offer is not None and offer.refusal else Offer(refusal=reason)

    def offer(self, frame: Frame) -> Offer | None:
        """Return what the frame means for this request, or None when it answers another one."""
        if self.number is not None:
            return None  # its answer would carry it, see `answer`
        return self.ear.offer(frame, None if self.exchange.ask.match is None else self._is_mine)

    def next_stage(self, now: float) -> bool:
        """Wait for the next answer; return whether there is one to come."""
        answers = self.exchange.ask.answers
        self.stage += 1
        if self.stage == len(answers):
            return False
        self._ear = None
        self.due = now + answers[self.stage].timeout_s
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


class Flights(list[Flight]):
    """In the order of sending; those that are late stay until nobody expects them any more."""

    __slots__ = ()

    def drain(self) -> list[Exchange]:
        """Forget all; return the requests that still waited for an answer."""
        waited = [flight.exchange for flight in self if not flight.is_late]
        self.clear()
        return waited

    @property
    def waiting(self) -> int:
        """How many wait for an answer, real-time ones aside."""
        return sum(1 for flight in self if not flight.is_late and not flight.exchange.is_realtime)

    @property
    def deadline(self) -> float | None:
        """When the first of them is overdue."""
        if len(self) == 1:
            return self[0].due
        return min((flight.due for flight in self), default=None)

    @property
    def is_wary(self) -> bool:
        """Whether a late answer may still come that could be taken for another one's."""
        return any(
            flight.is_late and flight.exchange.ask.is_in_order and not flight.exchange.is_realtime
            for flight in self
        )

    def has(self, label: str) -> bool:
        """Return whether a request of that name waits for its answer."""
        return any(flight.exchange.ask.label == label and not flight.is_late for flight in self)

    def overdue(self, now: float) -> list[Flight]:
        """Return those whose time is over."""
        return [flight for flight in self if flight.due <= now] if self else []

    def framing(self) -> Framing | None:
        """Return what cuts the stream while an answer brings its own framing."""
        for flight in self:
            if flight.exchange.ask.framing is not None:
                return flight.exchange.ask.framing
        return None

    def collects_lines(self) -> bool:
        """Return whether any frame at all may be part of an answer."""
        return any(flight.ear.answer.lines is not None for flight in self)

    def numbered(self, number: object) -> Flight | None:
        """Return the one whose answer carries `number`."""
        return next((one for one in self if one.number is not None and one.number == number), None)

    def offer(self, frame: Frame) -> tuple[Flight, Offer] | None:
        """Return whose answer the frame is and what it means, or None when it answers nobody."""
        if len(self) == 1:
            only = self[0].offer(frame)
            return None if only is None else (self[0], only)
        has_first, has_first_realtime = False, False
        collecting: list[Flight] = []
        for flight in self:
            if flight.exchange.ask.is_in_order:
                is_realtime = flight.exchange.is_realtime
                if has_first_realtime if is_realtime else has_first:
                    continue
                if not flight.is_late:  # what is late may never come: it blocks nobody's answer
                    has_first_realtime |= is_realtime
                    has_first |= not is_realtime
            if flight.ear.answer.lines is not None:
                collecting.append(flight)
                continue
            offer = flight.offer(frame)
            if offer is not None:
                return flight, offer
        for flight in collecting:  # last: any frame at all could be one of its lines
            offer = flight.offer(frame)
            if offer is not None:
                return flight, offer
        return None


def _plain(raw: object) -> Reading:
    """Return a raw value as something that a reply may carry."""
    if isinstance(raw, (list, tuple)):
        return tuple(map(_plain, raw))
    if raw is None or isinstance(raw, (bool, int, float, str, bytes, Mapping)):
        return raw
    return str(raw)
