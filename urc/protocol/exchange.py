"""One line of a driver: what waits to be sent, what waits for its answer, what came in.

Floor 3, pure. An `Exchange` is one request and its answer; a `Line` runs them one at a time over
one transport and cuts what comes back into frames.

Theory of operation. A line is closed, opening or open. A persistent line is opened from outside; a
per-request one asks for it (`Open`) when something waits, and asks for the end (`Close`) when
nothing does. After an answer is overdue the line is *wary* for one more reply time: the next frame
is then the late answer, not the answer of the next request, so it is dropped. A line that misses
`MISSES_UNTIL_CLOSED` answers in a row is given up and opened afresh.
"""

from collections import deque
from collections.abc import Mapping
from typing import Literal, NamedTuple

from urc.model.driver import TransportSpec
from urc.model.values import Sample, Value
from urc.patterns import Pattern
from urc.protocol.decode import Decode
from urc.protocol.events import Close, Event, Failed, Fault, Open, Replied, Samples, Send
from urc.protocol.forms import BadText, Frame, Reader
from urc.protocol.framing import Decoder, FrameFault, Framing, build_framing

__all__ = ["Exchange", "Line", "Matcher"]

Fields = Mapping[str, object]
"""What a frame says: name → raw value."""

QUEUE_LIMIT = 64
"""Requests waiting on one line; one more is refused."""
MISSES_UNTIL_CLOSED = 3


class Matcher(NamedTuple):
    """A reader and what becomes of its fields."""

    reader: Reader
    decode: Decode

    def read(self, frame: Frame) -> Fields | None:
        """Return the fields, or None when the frame is another one or no text at all."""
        try:
            return self.reader.read(frame)
        except BadText:
            return None


class Exchange:
    """A request and how it is answered."""

    __slots__ = (
        "answer_due",
        "data",
        "errors",
        "gives_up_at",
        "label",
        "matcher",
        "reply_s",
        "request_id",
    )

    def __init__(
        self,
        label: str,
        data: bytes,
        matcher: Matcher | None,
        errors: tuple[Pattern, ...],
        *,
        reply_s: float,
        gives_up_at: float,
        request_id: int | None = None,
    ) -> None:
        self.label = label
        """For messages: ``polls.0`` or the command's name."""
        self.data = data
        self.matcher = matcher
        """What its answer looks like; None when none comes."""
        self.errors = errors
        """Answers that mean failure."""
        self.reply_s = reply_s
        """How long the answer may take, in seconds."""
        self.gives_up_at = gives_up_at
        """When it fails for having waited too long to be sent."""
        self.request_id = request_id
        """None for polls."""
        self.answer_due = 0.0


class Line:
    """The conversation on one transport. Time is passed in; nothing is called back."""

    def __init__(self, spec: TransportSpec, messages: list[Matcher]) -> None:
        self.spec = spec
        self.framing: Framing = build_framing(spec.framing)
        self.state: Literal["closed", "opening", "open"] = "closed"
        self.waiting: deque[Exchange] = deque()
        self.in_flight: Exchange | None = None
        self._messages = messages
        self._decoder: Decoder = self.framing.decoder()
        self._next_send = float("-inf")
        self._wary_until: float | None = None
        self._late: Exchange | None = None
        self._misses = 0

    @property
    def is_per_request(self) -> bool:
        """Whether each request brings its own connection."""
        return self.spec.connection == "per_request"

    def is_open(self) -> bool:
        """Return whether the transport is connected."""
        return self.state == "open"

    @property
    def deadline(self) -> float | None:
        """When `tick` has something to do, or None."""
        times = [exchange.gives_up_at for exchange in self.waiting]
        if self._decoder.deadline is not None:
            times.append(self._decoder.deadline)
        if self.in_flight is not None:
            times.append(self.in_flight.answer_due)
        elif self._wary_until is not None:
            times.append(self._wary_until)
        elif self.waiting and self.state == "open":
            times.append(self._next_send)
        return min(times, default=None)

    def has(self, label: str) -> bool:
        """Return whether a request of that label waits or is in flight."""
        if self.in_flight is not None and self.in_flight.label == label:
            return True
        return any(exchange.label == label for exchange in self.waiting)

    def opened(self, now: float) -> list[Event]:
        """Take note that the transport is connected, with nothing received on it yet."""
        self._reset("open")
        return self._pump(now)

    def closed(self, reason: str, now: float) -> list[Event]:
        """Take note that the transport is not connected (any more)."""
        if self.state == "closed":
            return []
        events: list[Event] = []
        was_open, pending = self.state == "open", self._decoder.pending
        if was_open and pending:
            text = f"the connection ended in the middle of a frame ({pending} bytes)"
            events.append(Fault(self.spec.name, "cut-frame", text))
        lost = [self.in_flight] if self.in_flight is not None else []
        if not self.is_per_request:
            lost += self.waiting
            self.waiting.clear()
        elif self.waiting and not was_open:
            lost.append(self.waiting.popleft())  # it could not be connected for this one
        for exchange in lost:
            events += self._failed(exchange, "disconnected", reason or "the robot hung up")
        self._reset("closed")
        return events + self._pump(now)

    def submit(self, exchange: Exchange, now: float) -> list[Event]:
        """Queue a request, and send it at once when the line is free."""
        if self.state == "closed" and not self.is_per_request:
            return self._failed(exchange, "disconnected", "the robot is not connected")
        if len(self.waiting) >= QUEUE_LIMIT:
            text = f"{QUEUE_LIMIT} requests are waiting on {self.spec.name} already"
            return self._failed(exchange, "queue-full", text)
        self.waiting.append(exchange)
        return self._pump(now)

    def receive(self, data: bytes, now: float) -> list[Event]:
        """Take bytes from the transport."""
        if not self.is_open():
            return []
        return self._frames(self._decoder.feed(data, now), now) + self._pump(now)

    def tick(self, now: float) -> list[Event]:
        """Do what is due at `now`."""
        events: list[Event] = []
        if self.is_open():
            events += self._frames(self._decoder.tick(now), now)
        for exchange in [late for late in self.waiting if late.gives_up_at <= now]:
            self.waiting.remove(exchange)
            events += self._failed(exchange, "timed-out", "it could not be sent in time")
        if self.in_flight is not None and self.in_flight.answer_due <= now:
            events += self._missed(self.in_flight, now)
        if self._wary_until is not None and self._wary_until <= now:
            self._wary_until = self._late = None
        return events + self._pump(now)

    def _reset(self, state: Literal["closed", "open"]) -> None:
        self.state = state
        self.in_flight = self._late = self._wary_until = None
        self._misses = 0
        self._decoder = self.framing.decoder()

    def _pump(self, now: float) -> list[Event]:
        """Send what may be sent; open and close a per-request line as needed."""
        events: list[Event] = []
        while self.in_flight is None and self._wary_until is None:
            if not self.waiting:
                if self.is_per_request and self.state == "open":
                    self.state = "closed"
                    events.append(Close(self.spec.name))
                break
            if self.state != "open":
                if self.is_per_request and self.state == "closed":
                    self.state = "opening"
                    events.append(Open(self.spec.name))
                break
            if now < self._next_send:
                break
            events += self._send(self.waiting.popleft(), now)
        return events

    def _send(self, exchange: Exchange, now: float) -> list[Event]:
        self._next_send = now + self.spec.min_gap_s
        sent: list[Event] = [Send(self.spec.name, exchange.data)]
        if exchange.matcher is None:
            return sent + self._done(exchange, {})
        exchange.answer_due = now + exchange.reply_s
        self.in_flight = exchange
        return sent

    def _frames(self, frames: list[bytes | FrameFault], now: float) -> list[Event]:
        events: list[Event] = []
        for frame in frames:
            if not self.is_open():
                break  # what follows the answer on a connection of one request is nobody's
            if isinstance(frame, FrameFault):
                events.append(Fault(self.spec.name, frame.code, frame.message))
            else:
                events += self._frame(frame, now)
        return events

    def _frame(self, payload: bytes, now: float) -> list[Event]:
        frame = Frame(payload, self.spec.encoding)
        if self.in_flight is not None and self.in_flight.matcher is not None:
            events = self._answer(self.in_flight, self.in_flight.matcher, frame, now)
            if events is not None:
                self.in_flight = None
                self._misses = 0
                # One connection, one request: the next one waits for a connection of its own.
                return events + self._hang_up()
        late = self._late
        if late is not None and late.matcher and late.matcher.read(frame) is not None:
            self._wary_until = self._late = None
            text = f"the answer to {late.label} came too late and was dropped"
            return [Fault(self.spec.name, "late-reply", text)]
        for matcher in self._messages:
            found = matcher.read(frame)
            if found is not None:
                return self._samples(matcher, found, now)[0]
        return [self._unknown(frame)]

    def _unknown(self, frame: Frame) -> Fault:
        """Return what to say of a frame that nothing declared matches."""
        try:
            text = frame.text
        except BadText as error:
            return Fault(self.spec.name, "bad-text", str(error))
        shown = text if len(text) <= 60 else text[:57] + "..."
        return Fault(self.spec.name, "no-match", f"nothing declared matches {shown!r}")

    def _answer(
        self, exchange: Exchange, matcher: Matcher, frame: Frame, now: float
    ) -> list[Event] | None:
        """Return what the frame means for `exchange`, or None when it is no answer to it."""
        if any(_matches(pattern, frame) for pattern in exchange.errors):
            return self._failed(exchange, "refused", f"the robot answered {frame.text[:80]!r}")
        found = matcher.read(frame)
        if found is None:
            return None
        events, samples = self._samples(matcher, found, now)
        # What the reply says beside the signals is the command's own result.
        values = {name[1:]: _plain(raw) for name, raw in found.items() if name.startswith("_")}
        values |= {sample.signal: sample.value for sample in samples}
        return events + self._done(exchange, values)

    def _samples(
        self, matcher: Matcher, found: Fields, now: float
    ) -> tuple[list[Event], list[Sample]]:
        samples, refused = matcher.decode(found, now)
        # A good frame without values is told of, too: it shows that the line lives.
        is_good = bool(samples) or not refused
        events: list[Event] = [Samples(self.spec.name, tuple(samples))] if is_good else []
        events += [Fault(self.spec.name, "bad-value", line) for line in refused]
        return events, samples

    def _missed(self, exchange: Exchange, now: float) -> list[Event]:
        self.in_flight = None
        self._misses += 1
        text = f"no answer to {exchange.label} within {exchange.reply_s:g} s"
        events: list[Event] = [Fault(self.spec.name, "reply-timeout", text)]
        if exchange.request_id is not None:
            events += self._failed(exchange, "timed-out", text)
        if self.is_per_request or self._misses >= MISSES_UNTIL_CLOSED:
            return events + self._hang_up(text)
        self._late = exchange
        self._wary_until = now + exchange.reply_s
        return events

    def _hang_up(self, reason: str = "") -> list[Event]:
        """End the connection when it belonged to one request, or when it is given up."""
        if not self.is_per_request and not reason:
            return []
        self._reset("closed")
        return [Close(self.spec.name, reason)]

    def _done(self, exchange: Exchange, values: Mapping[str, Value]) -> list[Event]:
        if exchange.request_id is None:
            return []
        return [Replied(exchange.request_id, exchange.label, values)]

    def _failed(self, exchange: Exchange, code: str, message: str) -> list[Event]:
        if exchange.request_id is not None:
            return [Failed(exchange.request_id, exchange.label, code, message)]
        # A poll comes again by itself, so only a robot that refuses it is worth a line.
        if code == "refused":
            return [Fault(self.spec.name, code, f"{exchange.label}: {message}")]
        return []


def _matches(pattern: Pattern, frame: Frame) -> bool:
    try:
        return pattern.search(frame.text) is not None
    except BadText:
        return False


def _plain(raw: object) -> Value:
    """Return a raw value as something that a reply may carry."""
    return raw if raw is None or isinstance(raw, (bool, int, float, str)) else str(raw)
