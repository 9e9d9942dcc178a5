"""What an answer does to the request it belongs to; and what is done when it does not come.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from urc.model.codec import Envelope
from urc.protocol.answer import Offer
from urc.protocol.connection import Connection
from urc.protocol.events import Fault
from urc.protocol.exchange import Ended, LineEvent, Outcome, expires_at
from urc.protocol.flights import Flight
from urc.protocol.topics import frame_of

__all__ = ["MISSES_UNTIL_CLOSED", "Answering"]

MISSES_UNTIL_CLOSED = 3
"""Missing answers in a row after which a line is given up."""


class Answering(Connection):
    """A connection on which requests are answered, too late, or not at all."""

    def _envelope(self, envelope: Envelope, now: float) -> list[LineEvent]:
        frame = frame_of(envelope, self.spec.encoding)
        attributes = envelope.attributes
        if envelope.verb == "response":
            flight = self._flights.numbered(attributes.get("id"))
            if flight is None:
                return []  # nobody wants to know, or it was told already that it is late
            if attributes.get("ok", True):
                return self._answer(flight, flight.answer(frame), now)
            reason = str(attributes.get("reason") or "the robot refused")
            return self._answer(flight, flight.refused(frame, reason), now)
        answered = self._flights.offer(frame) if self._flights else None
        return self._answer(*answered, now) if answered else self.inbox.tell(frame, now)

    def _answer(self, flight: Flight, offer: Offer, now: float) -> list[LineEvent]:
        exchange = flight.exchange
        events: list[LineEvent] = self.inbox.dropped(offer) if offer.dropped else []
        if offer.fields is None and not offer.refusal:
            return events  # more is to come
        if flight.is_late:
            if exchange not in self._outbox:
                return [*events, self._late(flight)]
            # It is as good as the answer to the same request, sent again.
            self._outbox.remove(exchange)
            flight.is_late = False
        self._misses = 0
        if offer.fields is None:
            outcome = Outcome("refused", self.inbox.secrets.hide(offer.refusal))
        else:
            told, samples = self.inbox.samples(flight.ear.answer.matcher, offer.fields, now)
            events += told
            flight.take(offer.fields, samples)
            if flight.next_stage(now):
                return events
            outcome = Outcome(values=flight.values)
        self._flights.remove(flight)
        events.append(Ended(exchange, outcome))
        # One connection, one request: the next one waits for a connection of its own.
        return events + self.leave(now) if self.is_per_request and self.is_ready else events

    def _late(self, flight: Flight) -> Fault:
        self._flights.remove(flight)
        text = f"the answer to {flight.exchange.ask.label} came too late and was dropped"
        return Fault(self.spec.name, "late-reply", text)

    def _overdue(self, flight: Flight, now: float) -> list[LineEvent]:
        if flight not in self._flights:
            return []  # the line was given up for another one
        if flight.is_late:
            self._flights.remove(flight)
            return []
        exchange, reply_s = flight.exchange, flight.ear.answer.timeout_s
        text = f"no answer to {exchange.ask.label} within {reply_s:g} s"
        text += self.inbox.came_since(exchange.sent_at)
        events: list[LineEvent] = [Fault(self.spec.name, "reply-timeout", text)]
        flight.is_late = True
        flight.due = now + reply_s
        if exchange.tries_left and flight.stage == 0:
            exchange.tries_left -= 1
            wait_s = exchange.ask.retry.wait_s(exchange.ask.retries - exchange.tries_left)
            exchange.waits_until = now + wait_s
            exchange.gives_up_at = expires_at(exchange.ask, flight.due + wait_s)
            self._outbox.put_back(exchange)
            return events + self.give_up(text, now) if self.is_per_request else events
        events.append(Ended(exchange, Outcome("timed-out", text)))
        self._misses += not exchange.ask.is_miss_harmless
        if self.is_per_request or self._misses >= MISSES_UNTIL_CLOSED:
            events += self.give_up(text, now)
        return events
