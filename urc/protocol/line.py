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
misses `MISSES_UNTIL_CLOSED` answers in a row is given up and opened afresh.
"""

from typing import Literal

from urc.model.driver import TransportSpec
from urc.protocol.encode import BadArgument
from urc.protocol.events import Close, Fault, Open, Send
from urc.protocol.exchange import (
    DONE,
    Ended,
    Exchange,
    Flight,
    Heard,
    Leaving,
    LineEvent,
    Matcher,
    Offer,
    Outcome,
    expires_at,
)
from urc.protocol.flights import Flights
from urc.protocol.forms import Frame
from urc.protocol.framing import FrameFault, Framing, build_framing
from urc.protocol.gate import Counters
from urc.protocol.inbox import Inbox
from urc.protocol.outbox import Outbox, counted
from urc.protocol.times import soonest

__all__ = ["Line"]

MISSES_UNTIL_CLOSED = 3
MOST_IN_FLIGHT = 256
"""Requests that wait for answers, late and real-time ones included."""


class Line:
    """The conversation on one transport."""

    def __init__(self, spec: TransportSpec, messages: list[Matcher]) -> None:
        self.spec = spec
        self.is_per_request = spec.connection == "per_request"
        """Whether each request brings its own connection."""
        self.framing: Framing = build_framing(spec.framing)
        self.state: Literal["closed", "opening", "open"] = "closed"
        self.is_ready = False
        """Whether anybody may talk here; else only those who make it so, or say good-bye."""
        self.last_sent = float("-inf")
        self.counters = Counters()
        self._flights = Flights()
        self._outbox = Outbox(spec, self._flights)
        self.inbox = Inbox(spec, self.framing, messages)
        self.is_behind = False
        """Whether something that came in waits for `go_on`."""
        self.is_scripted = False
        """Whether a sequence is at work, which may wait for the next frame."""
        self._is_leaving = False
        self._misses = 0
        self._silent_at: float | None = None

    @property
    def is_open(self) -> bool:
        """Whether the transport is connected."""
        return self.state == "open"

    @property
    def deadline(self) -> float | None:
        """When `tick` has something to do, or None."""
        times = [self._flights.deadline, self.inbox.decoder.deadline, self._silent_at]
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

    # -- the connection

    def opened(self, now: float) -> list[LineEvent]:
        """Take note that the transport is connected, with nothing received on it yet."""
        events = self._lose("the line was connected anew") if self.state == "open" else []
        self._reset("open")
        self.last_sent = now
        self._hear(now)
        self.is_ready = not self.spec.on_connect
        return events + self._pump(now)

    def ready(self, now: float) -> list[LineEvent]:
        """Let everybody talk: the connection is as it must be."""
        self.is_ready = True
        return self._pump(now)

    def closed(self, reason: str, now: float) -> list[LineEvent]:
        """Take note that the transport is not connected (any more)."""
        if self.state == "closed":
            return []
        events: list[LineEvent] = []
        was_open, pending = self.state == "open", self.inbox.decoder.pending
        if was_open and pending:
            text = f"the connection ended in the middle of a frame ({pending} bytes)"
            events.append(Fault(self.spec.name, "cut-frame", text))
        events += self._lose(reason or "the robot hung up")
        return events + self._pump(now)

    def give_up(self, reason: str, now: float) -> list[LineEvent]:
        """Close the connection for a reason; what waits for it fails."""
        if self.state == "closed":
            return []
        reason = self.inbox.secrets.hide(reason)
        events = self._lose(reason)
        events.append(Close(self.spec.name, reason))
        return events + self._pump(now)

    def leave(self, now: float) -> list[LineEvent]:
        """Begin to close in good order: say good-bye where that is declared, else close at once."""
        if self.state != "open":
            return []
        if self.spec.on_close:
            lost = self._lost()
            self.is_ready, self._is_leaving = False, True
            return [*_disconnected(lost, "the line is being closed"), Leaving(self.spec.name)]
        return self.shut(now)

    def shut(self, now: float) -> list[LineEvent]:
        """Close after the good-bye."""
        events = self._lose("the line was closed")
        return [*events, Close(self.spec.name), *self._pump(now)]

    def _lose(self, reason: str) -> list[LineEvent]:
        """Forget the connection; fail what it was for."""
        lost = self._lost()
        for exchange in tuple(self._outbox):
            if exchange.is_privileged:
                self._outbox.remove(exchange)
        self._reset("closed")
        return _disconnected(lost, self.inbox.secrets.hide(reason))

    def _lost(self) -> list[Exchange]:
        """Take out the requests that end with this connection."""
        lost = self._flights.drain()
        if not self.is_per_request:
            return lost + self._outbox.drain()
        if not (self.is_ready or self._is_leaving):
            for exchange in list(self._outbox)[:1]:  # it could not be made usable for this one
                self._outbox.remove(exchange)
                lost.append(exchange)
        return lost

    def _reset(self, state: Literal["closed", "open"]) -> None:
        self.state = state
        self.is_ready = self._is_leaving = False
        self._flights.clear()
        self.inbox.reset(is_new=state == "open")
        self._misses = 0
        self._silent_at = None
        self.is_behind = False
        if state == "open":
            self.counters = Counters()

    # -- sending

    def submit(self, exchange: Exchange, now: float) -> list[LineEvent]:
        """Queue a request, and send it at once when the line is free."""
        refusal = self._refusal(exchange)
        if refusal:
            return [Ended(exchange, Outcome("disconnected", refusal))]
        if exchange.is_realtime and not self.is_per_request:  # the line is ready
            if len(self._flights) >= MOST_IN_FLIGHT:
                text = f"{MOST_IN_FLIGHT} requests wait for their answers already"
                return [Ended(exchange, Outcome("queue-full", text))]
            return self._send(exchange, now) + self._pump(now)
        if self.is_ready and not self.is_per_request and self._outbox.is_free(exchange, now):
            return self._send(exchange, now)
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
        if exchange.ask.is_motion or exchange.is_realtime:
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
        why_not = exchange.condition(now) if exchange.condition is not None else ""
        if why_not:
            return [Ended(exchange, Outcome("not-allowed", why_not))]
        data = exchange.data
        if data is None:
            try:
                data = counted(exchange, self.counters)
            except BadArgument as error:
                return [Ended(exchange, Outcome("bad-argument", str(error)))]
        if exchange.is_secret:
            self.inbox.secrets.add(data, self.spec.encoding)
        self.last_sent = exchange.sent_at = now
        self._outbox.sent(exchange, now)
        sent: list[LineEvent] = [Send(self.spec.name, data, exchange.is_secret)]
        if not ask.answers:
            return [*sent, Ended(exchange, DONE)]
        self._flights.append(Flight(exchange, now))
        return sent

    # -- receiving

    def receive(self, data: bytes, now: float) -> list[LineEvent]:
        """Take bytes from the transport."""
        if self.state != "open":
            return []
        if self.spec.stale_after_s is not None:
            self._hear(now)
        self.inbox.cut_by(self._framing_for())
        self.inbox.decoder.push(data, now)
        return self.go_on(now)

    def go_on(self, now: float) -> list[LineEvent]:
        """Look at what came in, up to something that a sequence may have waited for.

        What follows it may be for the next step: that step is to listen first.
        """
        events: list[LineEvent] = []
        inbox = self.inbox
        while self.state == "open":
            if self._flights or inbox.is_recut:
                inbox.cut_by(self._framing_for())
            frame = inbox.decoder.next(now)
            if frame is None:
                break
            told = self._frame(frame, now)
            events += told
            if self.is_scripted and any(isinstance(event, (Heard, Ended)) for event in told):
                self.is_behind = self.state == "open"
                return events
        # What waits may depend on what has just come in: that is to be known before it is sent.
        self.is_behind = bool(events) and bool(self._outbox)
        if inbox.is_prompted:
            events += inbox.look()
        return events + self._pump(now) if self._outbox or self.is_per_request else events

    def _framing_for(self) -> Framing:
        """Return what cuts the stream now: an answer may bring its own framing."""
        return (self._flights.framing() if self._flights else None) or self.framing

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

    def _hear(self, now: float) -> None:
        if self.spec.stale_after_s is not None:
            self._silent_at = now + self.spec.stale_after_s

    def _frame(self, cut: bytes | FrameFault, now: float) -> list[LineEvent]:
        if isinstance(cut, FrameFault):
            fault = Fault(self.spec.name, cut.code, cut.message)
            return [fault, *self.give_up(cut.message, now)] if cut.closes else [fault]
        if not self._flights:
            told = self.inbox.quick(cut, now)
            if told is not None:
                return told
        frame = Frame(cut, self.spec.encoding)
        if self._flights:
            # Any frame may be one of a reply's lines, so what has a name of its own goes first.
            message = self.inbox.message(frame, now) if self._flights.collects_lines() else None
            if message is not None:
                return message
            answered = self._flights.offer(frame)
            if answered is not None:
                return self._answer(*answered, now)
        return self.inbox.tell(frame, now)

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

    # -- answers that do not come

    def _overdue(self, flight: Flight, now: float) -> list[LineEvent]:
        if flight not in self._flights:
            return []  # the line was given up for another one
        if flight.is_late:
            self._flights.remove(flight)
            return []
        exchange, reply_s = flight.exchange, flight.ear.answer.timeout_s
        text = f"no answer to {exchange.ask.label} within {reply_s:g} s"
        events: list[LineEvent] = [Fault(self.spec.name, "reply-timeout", text)]
        flight.is_late = True
        flight.due = now + reply_s
        if exchange.tries_left and flight.stage == 0:
            exchange.tries_left -= 1
            exchange.gives_up_at = expires_at(self.spec, exchange.ask, flight.due)
            self._outbox.put_back(exchange)
            return events + self.give_up(text, now) if self.is_per_request else events
        events.append(Ended(exchange, Outcome("timed-out", text)))
        self._misses += not exchange.ask.is_miss_harmless
        if self.is_per_request or self._misses >= MISSES_UNTIL_CLOSED:
            events += self.give_up(text, now)
        return events


def _disconnected(lost: list[Exchange], reason: str) -> list[LineEvent]:
    outcome = Outcome("disconnected", reason)
    return [Ended(exchange, outcome) for exchange in lost]
