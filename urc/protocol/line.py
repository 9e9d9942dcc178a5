"""One transport's conversation: what waits to be sent, what waits for its answer, what came in.

Floor 3, pure. Time is passed in; nothing is called back.

Theory of operation. A line is closed, opening or open, and while open it is *ready* or not: what
makes a fresh connection usable (``on_connect``) and what says good-bye (``on_close``) is done while
it is not, by exchanges marked as privileged. A persistent line is opened from outside; a
per-request one asks for it (`Open`) when something waits, and for the end (`Close`) when nothing
does.

What is in flight is kept in the order of sending. A frame is offered to those that wait, the oldest
first: one with a correlation takes its own answer only; of the others only the oldest may answer,
since answers come in order (what is real-time has an order of its own). After an answer is overdue
its flight stays as *late* for one more reply time: a frame for it is dropped, not taken for the
answer of the next request, and meanwhile nothing is sent that it could be mistaken for. A line that
misses `urc.protocol.answering.MISSES_UNTIL_CLOSED` answers in a row is given up and opened afresh.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial

from urc.expressions import COUNTERS
from urc.model.codec import Counted, Envelope, Numbered, Payload, size_of, traffic_of
from urc.model.driver import TransportSpec
from urc.model.values import Sample
from urc.protocol.answer import Ear, Heard, Matcher
from urc.protocol.answering import Answering
from urc.protocol.codec import Frame
from urc.protocol.encode import BadArgument
from urc.protocol.events import Fault, Open, Send
from urc.protocol.exchange import DONE, Ended, Exchange, LineEvent, Outcome, untold
from urc.protocol.fast_value import Taken
from urc.protocol.flights import Flight
from urc.protocol.framings.base import FrameFault
from urc.protocol.framings.delimited import DelimiterDecoder
from urc.protocol.outbox import written
from urc.protocol.times import soonest

__all__ = ["Line"]

MOST_IN_FLIGHT = 256
"""Requests that wait for answers, late and real-time ones included."""


class Line(Answering):
    """The conversation on one transport."""

    def __init__(self, spec: TransportSpec, messages: list[Matcher]) -> None:
        super().__init__(spec, messages)
        self._gap_s = spec.min_gap_s
        self.is_scripted = False
        """Whether a sequence is at work, which may wait for the next frame."""
        self._free_at = float("-inf")
        """When something may be sent again, once the answer to motion has come."""
        self._may_recut = False
        """Whether an answer brings its own framing, or did before the last bytes came."""
        self._number = 0
        """Of the last envelope whose answer carries it; never used twice."""

    @property
    def deadline(self) -> float | None:
        """When `tick` has something to do, or None."""
        flights = self._flights
        due = None if not flights else flights[0].due if len(flights) == 1 else flights.deadline
        if not (self._outbox or self._silent_at or self.inbox.is_timed):
            return due
        times = [due, self.inbox.decoder.deadline, self._silent_at]
        if self._outbox:
            times += [exchange.gives_up_at for exchange in self._outbox]
            if self.state != "opening":
                is_ready = self.is_ready or self.state == "closed"
                times.append(self._outbox.may_send_at(is_ready=is_ready))
        return soonest(times)

    def has(self, label: str) -> bool:
        """Return whether a request of that name waits or is in flight."""
        if not (self._flights or self._outbox):
            return False
        return self._flights.has(label) or self._outbox.has(label)

    # -- motion, which does not come by here

    def motion_must_wait(self, now: float) -> bool:
        """Return whether a frame of motion has to wait for an answer that the robot owes."""
        if not self.spec.is_half_duplex:
            return False
        is_owed = any(not one.is_late for one in self._flights)
        return self.held.must_wait(now, is_owed=is_owed)

    def gave_motion(self, command: str, names: Mapping[str, object], now: float) -> None:
        """Take note that a frame of motion goes out, made of `names`."""
        self.held.gave(command, names, now)
        if self.spec.is_half_duplex and now < self.held.owed_until_s:
            self._free_at = now + self._gap_s
            self._outbox.next_send = max(self._outbox.next_send, self.held.owed_until_s)

    def _motion_answered(self) -> None:
        if self.spec.is_half_duplex:
            self._outbox.next_send = self._free_at

    # -- sending

    def submit(self, exchange: Exchange, now: float) -> list[LineEvent]:
        """Queue a request, and send it at once when the line is free."""
        is_shared = self.is_ready and not self.is_per_request
        if is_shared and self._outbox.is_free(exchange, now):
            return self._send(exchange, now)
        refusal = self._refusal(exchange)
        if refusal:
            return [Ended(exchange, Outcome("disconnected", refusal))]
        may_pass = self.is_ready or exchange.is_privileged
        if exchange.is_realtime and may_pass and not self.is_per_request:
            if len(self._flights) >= MOST_IN_FLIGHT:
                text = f"{MOST_IN_FLIGHT} requests wait for their answers already"
                return [Ended(exchange, Outcome("queue-full", text))]
            return self._send(exchange, now) + self._pump(now)
        most = self.spec.queue.most_bytes
        if most is not None and not exchange.is_realtime and self._size_of(exchange) > most:
            text = f"it has {self._size_of(exchange)} bytes, and the robot takes {most} at a time"
            return [Ended(exchange, Outcome("bad-argument", f"{text} (queue.bytes)"))]
        gone = self._outbox.take(exchange)
        events: list[LineEvent] = [] if gone is None else [Ended(*gone)]
        return events + self._pump(now)

    def _refusal(self, exchange: Exchange) -> str:
        if exchange.is_privileged:
            return "" if self.state == "open" else "the robot is not connected"
        if self.is_per_request or (self.state == "open" and self.is_ready):
            return ""
        if self.state != "open":
            return "the robot is not connected"
        if self._is_leaving:
            return "the line is being closed"
        if exchange.ask.is_motion:
            return "the robot is not ready: the steps of its connection are not done"
        return ""  # it waits for them, as long as for any other turn

    def _pump(self, now: float) -> list[LineEvent]:
        """Send what may be sent; open and close a per-request line as needed."""
        events: list[LineEvent] = []
        if self.is_behind:
            return events
        while self._outbox and self.state == "open":
            exchange = self._outbox.next(now, is_ready=self.is_ready)
            if exchange is None:
                break
            self._outbox.remove(exchange)
            events += self._send(exchange, now)
        if not self.is_per_request:
            return events
        if self.state == "open" and self.is_ready and not self._flights and not self._outbox:
            events += self.leave(now)
        if self.state == "closed" and self._outbox.wants_line(now):
            self.state = "opening"
            events.append(Open(self.spec.name))
        return events

    def _send(self, exchange: Exchange, now: float) -> list[LineEvent]:
        ask = exchange.ask
        if exchange.condition is not None or exchange.unless is not None:
            why_not = exchange.why_not(now)
            if why_not:
                return [Ended(exchange, Outcome("not-allowed", why_not))]
        number = None
        if ask.is_numbered:
            number = self._number = self._number + 1
        count = None
        if exchange.data is None:
            try:
                count = written(exchange, self.counters, self.learnt).takes
            except BadArgument as error:
                why = untold(error) if exchange.is_secret else str(error)
                return [Ended(exchange, Outcome("bad-argument", why))]
        elif ask.is_fresh:
            self._freshen(exchange)
        data = self._as_sent(exchange, number)
        if exchange.on_sent is not None and not exchange.is_secret:
            exchange.on_sent(data)
        exchange.sent_at = now
        if self.counting is None or ask.label in self.counting:
            self.last_sent = now
        self._outbox.sent(exchange, now)
        shared = None
        if count is not None and count.after and self.counters.is_shared:
            again = partial(self._count_again, exchange, number)
            shared = Counted(Numbered(data, count), again)
        sent: list[LineEvent] = [Send(self.spec.name, data, exchange.is_secret, shared)]
        if not ask.answers:
            if number is not None:
                if len(self._askers) >= MOST_IN_FLIGHT:
                    self._askers.pop(next(iter(self._askers)))
                self._askers[number] = exchange.owner
            sent.append(Ended(exchange, DONE))
            return sent
        if ask.framing is not None:
            self._may_recut = True
        flight = Flight(exchange, now)
        flight.number, flight.size = number, size_of(data)
        self._flights.append(flight)
        return sent

    def _freshen(self, exchange: Exchange) -> None:
        """Make what is sent again anew, but for its numbers: nothing fresh is sent twice."""
        draw = self.counters.draw()
        draw.values.update(exchange.numbers)
        names = {**self.learnt, **exchange.namespace, COUNTERS: draw}
        with suppress(BadArgument):  # it could be written before; what it has is better than none
            exchange.data = exchange.ask.encode(names)

    def _size_of(self, exchange: Exchange) -> int:
        if exchange.data is not None:
            return size_of(exchange.data)
        names = {**self.learnt, **exchange.namespace, COUNTERS: self.counters.draw()}
        try:
            return size_of(exchange.ask.encode(names))
        except BadArgument:
            return 0  # it is told when it is sent

    def _as_sent(self, exchange: Exchange, number: int | None) -> Payload:
        """Return the frame of a request; what is secret in it is not shown from now on."""
        data = exchange.data
        assert data is not None  # noqa: S101 - it was made just before
        if exchange.is_secret:
            self.inbox.secrets.add(traffic_of(data), self.spec.encoding)
        if isinstance(data, Envelope) and number is not None:
            data = data._replace(attributes={**data.attributes, "id": number})
        return data

    def _count_again(self, exchange: Exchange, number: int | None) -> Numbered | None:
        """Make the frame of a request again: another frame has used up its numbers."""
        try:
            made = written(exchange, self.counters, self.learnt)
        except BadArgument:
            return None  # its answer does not come, which is told in time
        return made._replace(data=self._as_sent(exchange, number))

    # -- receiving

    def listen(self, ear: Ear, now: float) -> list[LineEvent]:
        """Let `ear` have the frames that answer no request, cut by its own framing if it has one.

        Bytes that the line's framing has left may be whole frames of that one.
        """
        self.inbox.listen(ear)
        if ear.answer.framing is None:
            return []
        self._may_recut = True
        return self.go_on(now) if self.inbox.has_more else []

    def receive(self, data: Payload, now: float) -> list[LineEvent]:
        """Take bytes or an envelope from the transport."""
        if self.state != "open":
            return []
        if self.spec.stale_after_s is not None:
            self._hear(now)
        if isinstance(data, Envelope):
            told = self._envelope(data, now)
            self.is_behind = self.is_open and bool(told)
            return told
        if self._may_recut:
            self._recut()
        self.inbox.decoder.push(data, now)
        return self.go_on(now)

    def go_on(self, now: float) -> list[LineEvent]:
        """Look at what came in, up to something that a sequence may have waited for.

        What follows it may be for the next step: that step is to listen first.
        """
        inbox = self.inbox
        events: list[LineEvent] = []
        while self.state == "open":
            if self._may_recut:
                self._recut()
            frame = inbox.decoder.next(now)
            if frame is None:
                break
            told = self._frame(frame, now)
            events += told
            if self.is_scripted and any(isinstance(event, (Heard, Ended)) for event in told):
                self.is_behind = self.state == "open"
                return events
            if inbox.has_more:
                events += self._ahead(now)
        # What waits may depend on what has just come in: that is to be known before it is sent.
        self.is_behind = bool(events) and bool(self._outbox)
        if inbox.is_prompted:
            events += inbox.look()
        return events + self._pump(now) if self._outbox or self.is_per_request else events

    def _ahead(self, now: float) -> list[LineEvent]:
        """Take messages off the front of the stream, and tell their readings together.

        Frame by frame, a flood of short lines costs almost twice as much (decision 27). The batch
        ends with the awaited answer, with a refused value, or before a frame that is no message.
        """
        inbox, decoder, flight = self.inbox, self.inbox.decoder, self._flights.plain()
        if self.is_scripted or self._may_recut or inbox.is_listening:
            return []
        if (self._flights and flight is None) or self.held.is_listening(now):
            return []
        if not isinstance(decoder, DelimiterDecoder):
            return []
        reply = None if flight is None else flight.exchange.ask.plain
        samples: list[Sample] = []
        refused: Sequence[str] = ()
        answer: Taken | None = None
        count, size = 0, 0
        for payload in decoder.ahead():
            frame = Frame(payload, self.spec.encoding)
            answer = None if reply is None else reply.take(frame, now)
            taken = answer or inbox.messages.take(frame, now)
            if taken is None:
                break
            count, size = count + 1, size + len(payload)
            if answer is not None:
                break
            samples += taken[0]
            refused = taken[1]
            if refused:
                break
        decoder.skip(count, size)
        events = inbox.told(samples, refused) if count > (answer is not None) else []
        if flight is not None and answer is not None:
            events += self._answered(flight, answer, now)
        return events

    def _recut(self) -> None:
        """Choose what cuts the stream now: an answer, or a step, may bring its own framing."""
        framing = (self._flights.framing() if self._flights else None) or self.inbox.framing
        self._may_recut = framing is not None
        self.inbox.cut_by(framing or self.framing)

    def tick(self, now: float) -> list[LineEvent]:
        """Do what is due at `now`."""
        events: list[LineEvent] = []
        if self.state == "open":
            for frame in self.inbox.decoder.tick(now):
                events += self._frame(frame, now)
        for exchange in tuple(self._outbox):
            if exchange.gives_up_at <= now:
                self._outbox.remove(exchange)
                events.append(Ended(exchange, Outcome("timed-out", "it could not be sent in time")))
        if self._flights:
            for flight in self._flights.overdue(now):
                events += self._overdue(flight, now)
        if self._silent_at is not None and self._silent_at <= now:
            self._silent_at = None
            text = f"nothing received for {self.spec.stale_after_s:g} s"
            events.append(Fault(self.spec.name, "silent", text))
        return events + self._pump(now)

    def _frame(self, cut: bytes | FrameFault, now: float) -> list[LineEvent]:
        if isinstance(cut, FrameFault):
            fault = Fault(self.spec.name, cut.code, cut.message)
            return [fault, *self.give_up(cut.message, now)] if cut.closes else [fault]
        frame = Frame(cut, self.spec.encoding)
        is_motion = self.held.is_listening(now)
        plain = self._flights.plain() if self._flights and not is_motion else None
        if plain is not None:
            return self._plain(plain, frame, now)
        if self._flights:
            # Any frame may be one of a reply's lines, so what has a name of its own goes first.
            message = self.inbox.message(frame, now) if self._flights.collects_lines() else None
            answered = self._flights.offer(frame, is_message=message is not None)
            if answered is not None:
                told = self._answer(*answered, frame if message is None else None, now)
                return told if message is None else message + told
            if message is not None:
                return message
        of_motion = self._of_motion(frame, now) if is_motion else None
        return self.inbox.tell(frame, now) if of_motion is None else of_motion

    def _plain(self, flight: Flight, frame: Frame, now: float) -> list[LineEvent]:
        """Take a frame while the only request in flight expects nothing but readings.

        Most requests are such: this is what `_answer` does, without the steps that others need.
        """
        matcher = flight.exchange.ask.plain
        taken = None if matcher is None else matcher.take(frame, now)
        if taken is None:
            return self.inbox.tell(frame, now)
        return self._answered(flight, taken, now)

    def _answered(self, flight: Flight, taken: Taken, now: float) -> list[LineEvent]:
        self._misses = 0
        self._flights.clear()
        samples, refused = taken
        events = self.inbox.told(samples, refused)
        values = {sample.signal: sample.value for sample in samples}
        events.append(Ended(flight.exchange, Outcome("", "", values)))
        return events + self.leave(now) if self.is_per_request and self.is_ready else events
