"""What an answer does to the request it belongs to; and what is done when it does not come.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from collections.abc import Mapping, Sequence

from urc.model.codec import Envelope
from urc.protocol.answer import Offer
from urc.protocol.codec import Frame
from urc.protocol.connection import Connection
from urc.protocol.events import Fault
from urc.protocol.exchange import Ended, Exchange, LineEvent, Outcome, expires_at
from urc.protocol.flights import Flight
from urc.protocol.head import is_redirect
from urc.protocol.held_replies import Refusal
from urc.protocol.topics import frame_of

__all__ = ["MISSES_UNTIL_CLOSED", "Answering"]

MISSES_UNTIL_CLOSED = 3
"""Missing answers in a row after which a line is given up."""


class Answering(Connection):
    """A connection on which requests are answered, too late, or not at all."""

    def _envelope(self, envelope: Envelope, now: float) -> list[LineEvent]:
        frame = frame_of(envelope, self.spec.encoding)
        if envelope.verb == "response":
            return self._response(envelope, frame, now)
        answered = self._flights.offer(frame) if self._flights else None
        if answered:
            return self._answer(*answered, frame, now)
        told = self._of_motion(frame, now) if self.held.is_listening(now) else None
        return self.inbox.tell(frame, now) if told is None else told

    def _response(self, envelope: Envelope, frame: Frame, now: float) -> list[LineEvent]:
        attributes = envelope.attributes
        number, reason = attributes.get("id"), ""
        if not attributes.get("ok", True):
            reason = str(attributes.get("reason") or "the robot refused")
        flight = self._flights.numbered(number)
        if flight is None:
            if number is None and self.held.is_listening(now):
                return self._motion_response(frame, attributes, now)
            # Of a step, or nobody's: it was told already that it is late.
            asker = self._askers.pop(number, None)
            return [] if asker is None else self.inbox.answered(asker, frame, reason, now)
        if reason and flight.ear.answer.takes_redirects and is_redirect(frame):
            reason = ""
        offer = flight.refused(frame, reason) if reason else flight.answer(frame)
        return self._answer(flight, offer, frame, now)

    def _motion_response(
        self, frame: Frame, attributes: Mapping[str, object], now: float
    ) -> list[LineEvent]:
        """Return what follows from the response to a frame of motion."""
        if attributes.get("ok", True):
            return self._of_motion(frame, now) or []
        reason = str(attributes.get("reason") or "the robot refused")
        return self._motion_refused(self.held.refuse(frame, reason, now), frame, now)

    def _of_motion(self, frame: Frame, now: float) -> list[LineEvent] | None:
        """Return what follows from an answer to a frame of motion; None: it is no such answer."""
        owed_until_s = self.held.owed_until_s
        told = self._told_of_motion(frame, now)
        if self.held.owed_until_s < owed_until_s:
            self._motion_answered()
        return told

    def _motion_answered(self) -> None:
        """Take note that the robot owes no answer to motion any more."""

    def _told_of_motion(self, frame: Frame, now: float) -> list[LineEvent] | None:
        refused = self.held.refusals(frame, now)
        if refused:
            return self._motion_refused(refused, frame, now)
        if self.inbox.is_listening:
            return None  # a sequence waits for a frame, and may mean this one
        message = self.inbox.message(frame, now)
        accepted = self.held.accepted(frame, now) if message is None else None
        if accepted is None:
            return message
        answer, offer = accepted
        events = self.inbox.dropped(offer) if offer.dropped else []
        if offer.fields is not None:
            events += self.inbox.samples(answer.matcher, offer.fields, now)[0]
        return events

    def _motion_refused(
        self, refused: Sequence[Refusal], frame: Frame, now: float
    ) -> list[LineEvent]:
        events: list[LineEvent] = [*(self.inbox.message(frame, now) or ())]
        for command, offer in refused:
            if offer.told is not None:
                events += self.inbox.samples(*offer.told, now)[0]
            why = self.inbox.secrets.hide(offer.refusal)
            events.append(Fault(self.spec.name, "motion-refused", f"{command}: {why}"))
            if self.on_refused is not None:
                self.on_refused(command, why)
        return events

    def _answer(
        self, flight: Flight, offer: Offer, frame: Frame | None, now: float
    ) -> list[LineEvent]:
        """Return what follows from a frame that means `offer` for a request.

        One that is no answer, yet about the request, may be a message as well; `frame` is None
        where that has been told already.
        """
        exchange = flight.exchange
        events: list[LineEvent] = self.inbox.dropped(offer) if offer.dropped else []
        if offer.fields is None and not (offer.refusal or offer.aside):
            return events  # more is to come
        if offer.fields is None and frame is not None:
            events += self.inbox.message(frame, now) or ()
        if flight.is_late:
            # It is as good as the answer to the same request, sent again.
            again = self._flights.again(exchange)
            if again is not None:
                again.is_late = True
            elif exchange in self._outbox:
                self._outbox.remove(exchange)
            elif offer.aside == "extend":
                flight.extend(now)  # its answer is still to come, and still nobody else's
                return events
            else:
                return [*events, self._late(flight)]
            flight.is_late = False
        self._misses = 0
        if offer.told is not None:
            events += self.inbox.samples(*offer.told, now)[0]
        if offer.aside == "extend":
            flight.extend(now)
            return events
        if offer.aside == "resend" and exchange.tries_left:
            exchange.tries_left -= 1
            self._flights.remove(flight)
            text = f"the robot asked for {exchange.ask.label} again"
            return [*events, Fault(self.spec.name, "sent-again", text), *self._send(exchange, now)]
        if offer.aside:
            times = 1 + exchange.ask.retries
            text = f"the robot asks for {exchange.ask.label} again, and has got it {times} times"
            outcome = Outcome("refused", text)
        elif offer.fields is None:
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

    def _send(self, exchange: Exchange, now: float) -> list[LineEvent]:
        """Send a request, whatever else waits."""
        raise NotImplementedError

    def _late(self, flight: Flight) -> Fault:
        self._flights.remove(flight)
        text = f"the answer to {flight.exchange.ask.label} came too late and was dropped"
        return Fault(self.spec.name, "late-reply", text)

    def _silent(self, flight: Flight, now: float) -> list[LineEvent]:
        """Take the silence of the robot for its answer."""
        if flight.next_stage(now):
            return []
        self._flights.remove(flight)
        done: list[LineEvent] = [Ended(flight.exchange, Outcome(values=flight.values))]
        return done + self.leave(now) if self.is_per_request and self.is_ready else done

    def _overdue(self, flight: Flight, now: float) -> list[LineEvent]:
        if flight not in self._flights:
            return []  # the line was given up for another one
        if flight.is_late:
            self._flights.remove(flight)
            return []
        if flight.ear.answer.is_silence:
            return self._silent(flight, now)
        exchange, reply_s = flight.exchange, flight.ear.answer.timeout_s
        text = f"no answer to {exchange.ask.label} {flight.waited(now)}"
        came = self.inbox.came_since(exchange.sent_at, f"no answer to {exchange.ask.label}")
        text += came
        if came and exchange.ask.match is None and len(self._flights) > 1:
            text += "; answers that come in another order than their requests need 'match'"
        events: list[LineEvent] = [Fault(self.spec.name, "reply-timeout", text)]
        flight.is_late = True
        flight.due = now + reply_s
        if exchange.ask.is_repeated and exchange.tries_left and flight.stage == 0:
            exchange.tries_left -= 1
            wait_s = exchange.ask.retry.wait_s(exchange.ask.retries - exchange.tries_left)
            exchange.waits_until = now + wait_s
            exchange.gives_up_at = expires_at(exchange.ask, now + wait_s)
            if self.is_per_request and exchange.ask.learnt:
                exchange.data = None  # the next connection has a login of its own
            self._outbox.put_back(exchange)
            return events + self.give_up(text, now) if self.is_per_request else events
        events.append(Ended(exchange, Outcome("timed-out", text)))
        self._misses += not exchange.ask.is_miss_harmless
        if self.is_per_request or self._misses >= MISSES_UNTIL_CLOSED:
            events += self.give_up(text, now)
        return events
