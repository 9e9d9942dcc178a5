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

    __slots__ = (
        "_ear",
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
        self._ear: Ear | None = None
        self.due = now + ask.answers[0].timeout_s
        """When its answer is overdue; of one that is late: when it is not expected any more."""
        self.size = 0
        """Bytes that it takes in front of the robot's reader."""
        self.since = now
        """When its present answer began to be waited for."""
        self.is_extended = False
        """The robot has asked for more time for it."""
        self.is_late = False
        """It has failed, but its answer may still come and must not be taken for another's."""
        self.values: dict[str, Reading] = {}
        self.number: int | None = None
        """What its answer carries; None: it is recognised otherwise."""

    @property
    def ear(self) -> Ear:
        """Collects the frames of the present answer; a plain answer needs none."""
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

    def offer(self, frame: Frame, *, is_message: bool = False) -> Offer | None:
        """Return what the frame means for this request, or None when it answers another one.

        A message `is_message`: it may take the place of an answer, but is none.
        """
        if self.number is not None:
            return None  # its answer would carry it, see `answer`
        is_mine = None if self.exchange.ask.match is None else self._is_mine
        return self.ear.beside(frame, is_mine) if is_message else self.ear.offer(frame, is_mine)

    def extend(self, now: float) -> None:
        """Wait on, for as long as its answer may take, and as its robot may be busy."""
        answer = self.ear.answer
        self.is_extended = True
        late_s = answer.timeout_s if self.is_late else 0.0
        self.due = min(now + answer.timeout_s, self.since + answer.extend_s + late_s)

    def waited(self, now: float) -> str:
        """Return how long its answer has been waited for, for people."""
        answer = self.ear.answer
        if not self.is_extended:
            return f"within {answer.timeout_s:g} s"
        if now >= self.since + answer.extend_s:
            return f"within {answer.extend_s:g} s, for which the robot was busy"
        return f"within {answer.timeout_s:g} s after the robot said that it was busy"

    def next_stage(self, now: float) -> bool:
        """Wait for the next answer; return whether there is one to come."""
        answers = self.exchange.ask.answers
        self.stage += 1
        if self.stage == len(answers):
            return False
        self._ear, self.since, self.is_extended = None, now, False
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
    def size(self) -> int:
        """How many bytes the robot may not have read yet: of all that it has not answered."""
        return sum(flight.size for flight in self if not flight.exchange.is_realtime)

    @property
    def deadline(self) -> float | None:
        """When the first of them is overdue."""
        if len(self) == 1:
            return self[0].due
        return min((flight.due for flight in self), default=None)

    def may_confuse(self, exchange: Exchange) -> bool:
        """Return whether a late answer may still come that could be taken for the one to this.

        A late answer to the very same request, sent before, is as good as the one to come.
        """
        if not (exchange.ask.answers and exchange.ask.is_in_order):
            return False
        return any(
            flight.is_late
            and flight.exchange is not exchange
            and flight.exchange.ask.is_in_order
            and not flight.exchange.is_realtime
            for flight in self
        )

    def again(self, exchange: Exchange) -> Flight | None:
        """Return the flight of `exchange` that still waits; None when it is not sent again."""
        return next((one for one in self if one.exchange is exchange and not one.is_late), None)

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

    def plain(self) -> Flight | None:
        """Return the only one, where its answer is expected and is nothing but readings."""
        if len(self) != 1 or self[0].is_late or self[0].exchange.ask.plain is None:
            return None
        return self[0]

    def numbered(self, number: object) -> Flight | None:
        """Return the one whose answer carries `number`."""
        return next((one for one in self if one.number is not None and one.number == number), None)

    def offer(self, frame: Frame, *, is_message: bool = False) -> tuple[Flight, Offer] | None:
        """Return whose answer the frame is and what it means, or None when it answers nobody."""
        if len(self) == 1:
            only = self[0].offer(frame, is_message=is_message)
            return None if only is None else (self[0], only)
        has_first, has_first_realtime = False, False
        collecting: list[Flight] = []
        for flight in self:
            if flight.exchange.ask.is_in_order:
                is_realtime = flight.exchange.is_realtime
                if has_first_realtime if is_realtime else has_first:
                    continue
                # What is late may never come, and silence never does: they block no other answer.
                if not (flight.is_late or flight.ear.answer.is_silence):
                    has_first_realtime |= is_realtime
                    has_first |= not is_realtime
            if flight.ear.answer.lines is not None:
                collecting.append(flight)
                continue
            offer = flight.offer(frame, is_message=is_message)
            if offer is not None:
                return flight, offer
        for flight in collecting:  # last: any frame at all could be one of its lines
            offer = flight.offer(frame, is_message=is_message)
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
