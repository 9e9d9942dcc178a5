"""The conversation on one transport: queued requests, requests in flight, and received frames.

Theory of operation. A connection is closed, opening or open. An open connection is *ready* from the
end of ``on_connect`` until the start of ``on_close``. A connection that is not ready sends only the
privileged exchanges of ``on_connect`` and ``on_close``. The session opens persistent connections. A
per-request conversation requests a connection (`Open`) for each request and closes it afterwards
(`Close`). The module is pure: callers pass the time.

Requests in flight are kept in sending order. A received frame is offered to each request in flight,
from the oldest to the newest. A request with a correlation accepts only its own reply. Among
requests without a correlation, only the oldest accepts the frame, because replies arrive in order.
Real-time requests have a separate reply order. After its timeout, a request is *late* and stays in
flight for another reply timeout. A late reply is dropped so that the next request does not accept
it. Requests whose replies could be confused with the late reply wait until it arrives or times out.
After `MISSES_UNTIL_CLOSED` consecutive missing replies, the connection is closed and reopened.
"""

from collections.abc import Mapping, Sequence
from functools import partial

from urc.model.driver import TransportSpec
from urc.model.payload import UNKNOWN_END, CountedFrame, Envelope, Numbered, Payload, size_of
from urc.model.values import Sample
from urc.protocol.events import MotionRefused, NumbersUsed, Open, Send, Violation
from urc.protocol.forms.http_head import is_redirect
from urc.protocol.forms.topics import frame_of
from urc.protocol.framing.base import FrameFault
from urc.protocol.framing.delimited import DelimiterDecoder
from urc.protocol.readings.compiled_value import Taken
from urc.protocol.requests.connection import MOST_IN_FLIGHT, Connection
from urc.protocol.requests.encode import BadArgument
from urc.protocol.requests.exchange import (
    DONE,
    Exchange,
    ExchangeEnded,
    ExchangeOutcome,
    LineEvent,
    expires_at,
    untold,
)
from urc.protocol.requests.hold_replies import HoldRejected
from urc.protocol.requests.pending_replies import PendingReply
from urc.protocol.requests.reply_match import Expectation, Matched, Matcher, MatchResult
from urc.protocol.requests.request_queue import render_retry, written
from urc.protocol.times import soonest
from urc.protocol.values.payload import Frame

__all__ = ["Conversation"]

new = tuple.__new__
"""Fast constructor of named tuples, used for every command."""
MISSES_UNTIL_CLOSED = 3
"""Number of consecutive missing replies after which the connection is closed."""


class Conversation(Connection):
    """The conversation on one transport: requests, replies and messages."""

    def __init__(self, spec: TransportSpec, messages: list[Matcher]) -> None:
        super().__init__(spec, messages)
        self._gap_s = spec.min_gap_s
        self.is_scripted = False
        """Whether a sequence is running that may expect the next frame."""
        self._free_at = float("-inf")
        """Earliest time, in seconds, of the next request after a reply to a motion frame."""
        self._may_recut = False
        """Whether a pending reply or step may have a framing of its own."""
        self._number = 0
        """Number of the last envelope that expects a reply; numbers are never reused."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` is next due; None if there is no deadline."""
        pending_replies = self._pending_replies
        due = (
            None
            if not pending_replies
            else pending_replies[0].due
            if len(pending_replies) == 1
            else pending_replies.deadline
        )
        if not (self._request_queue or self._silent_at or self.receiver.is_timed):
            return due
        times = [due, self.receiver.decoder.deadline, self._silent_at]
        if self._request_queue:
            times += [exchange.gives_up_at for exchange in self._request_queue]
            if self.state != "opening":
                is_ready = self.is_ready or self.state == "closed"
                times.append(self._request_queue.may_send_at(is_ready=is_ready))
        return soonest(times)

    def has(self, label: str) -> bool:
        """Return whether a request with this label is queued or in flight."""
        if not (self._pending_replies or self._request_queue):
            return False
        return self._pending_replies.has(label) or self._request_queue.has(label)

    # -- motion, whose frames bypass the queue

    def motion_must_wait(self, now: float) -> bool:
        """Return whether a motion frame must wait for a pending reply."""
        if not self.spec.is_half_duplex:
            return False
        is_owed = any(not one.is_late for one in self._pending_replies)
        return self.held.must_wait(now, is_owed=is_owed)

    def gave_motion(self, command: str, names: Mapping[str, object], now: float) -> None:
        """Record that a motion frame was sent with the values `names`."""
        self.held.gave(command, names, now)
        if self.spec.is_half_duplex and now < self.held.owed_until_s:
            self._free_at = now + self._gap_s
            self._request_queue.next_send = max(
                self._request_queue.next_send, self.held.owed_until_s
            )

    # -- sending

    def submit(self, exchange: Exchange, now: float) -> list[LineEvent]:
        """Send a request immediately if possible; otherwise queue the request."""
        is_shared = self.is_ready and not self.is_per_request
        if is_shared and self._request_queue.is_free(exchange, now):
            return self._send(exchange, now)
        refusal = self._refusal(exchange)
        if refusal:
            return [ExchangeEnded(exchange, ExchangeOutcome("disconnected", refusal))]
        may_pass = self.is_ready or exchange.is_privileged
        if exchange.is_realtime and may_pass and not self.is_per_request:
            if len(self._pending_replies) >= MOST_IN_FLIGHT:
                text = f"{MOST_IN_FLIGHT} requests are already waiting for replies"
                return [ExchangeEnded(exchange, ExchangeOutcome("queue-full", text))]
            return self._send(exchange, now) + self._pump(now)
        most = self.spec.queue.most_bytes
        if most is not None and not exchange.is_realtime and self._size_of(exchange) > most:
            size = self._size_of(exchange)
            text = f"the request has {size} bytes; the robot accepts at most {most} (queue.bytes)"
            return [ExchangeEnded(exchange, ExchangeOutcome("bad-argument", text))]
        gone = self._request_queue.submit(exchange)
        events: list[LineEvent] = [] if gone is None else [ExchangeEnded(*gone)]
        return events + self._pump(now)

    def _refusal(self, exchange: Exchange) -> str:
        if exchange.is_privileged:
            return "" if self.state == "open" else "the robot is not connected"
        if self.is_per_request or (self.state == "open" and self.is_ready):
            return ""
        if self.state != "open":
            return "the robot is not connected"
        if self._is_leaving:
            return "the connection is being closed"
        if exchange.ask.is_motion:
            return "the robot is not ready: its login is not complete"
        return ""  # it waits in the queue for the login

    def _pump(self, now: float) -> list[LineEvent]:
        """Send all due requests; open and close per-request connections as needed."""
        events: list[LineEvent] = []
        if self.is_behind:
            return events
        while self._request_queue and self.state == "open":
            exchange = self._request_queue.next(now, is_ready=self.is_ready)
            if exchange is None:
                break
            self._request_queue.remove(exchange)
            events += self._send(exchange, now)
        if not self.is_per_request:
            return events
        if (
            self.state == "open"
            and self.is_ready
            and not self._pending_replies
            and not self._request_queue
        ):
            events += self.leave(now)
        if self.state == "closed" and self._request_queue.wants_line(now):
            self.state = "opening"
            events.append(Open(self.spec.name))
        return events

    def _send(self, exchange: Exchange, now: float) -> list[LineEvent]:
        ask = exchange.ask
        if exchange.condition is not None or exchange.unless is not None:
            why_not = exchange.why_not(now)
            if why_not:
                return [ExchangeEnded(exchange, ExchangeOutcome("not-allowed", why_not))]
        number = None
        if ask.is_numbered:
            number = self._number = self._number + 1
        count = None
        uses = ask.has_counters and exchange.data is None and self.counters.is_shared
        sent: list[LineEvent] = [NumbersUsed(self.spec.name)] if uses else []  # even if not encoded
        if exchange.data is None:
            try:
                count = written(exchange, self.counters, self.learnt).takes
            except BadArgument as error:
                why = untold(error) if exchange.is_secret else str(error)
                return [*sent, ExchangeEnded(exchange, ExchangeOutcome("bad-argument", why))]
        elif ask.is_fresh:
            render_retry(exchange, self.counters, self.learnt)
        data = self._as_sent(exchange, number)
        if exchange.on_sent is not None and not exchange.is_secret:
            exchange.on_sent(data)
        if exchange.goal is not None:
            exchange.goal.sent(data)
        exchange.sent_at = now
        if self.counting is None or ask.label in self.counting:
            self.last_sent = now
        self._request_queue.sent(exchange, now)
        shared = None
        if count is not None and count.after and self.counters.is_shared:
            again = partial(self._count_again, exchange, number)
            shared = CountedFrame(Numbered(data, count), again)
        sent.append(new(Send, (self.spec.name, data, exchange.is_secret, shared)))
        self._note_sent(data, exchange, number)
        if not ask.answers:
            sent.append(ExchangeEnded(exchange, DONE))
            return sent
        if ask.framing is not None:
            self._may_recut = True
        pending = PendingReply(exchange, now)
        pending.number, pending.size = number, size_of(data)
        self._pending_replies.append(pending)
        return sent

    def _count_again(self, exchange: Exchange, number: int | None) -> Numbered | None:
        """Render a request's frame again after another frame has used its counter numbers."""
        try:
            made = written(exchange, self.counters, self.learnt)
        except BadArgument:
            return None  # its reply times out, and the timeout is reported
        return made._replace(data=self._as_sent(exchange, number))

    # -- receiving

    def listen(self, expectation: Expectation, now: float) -> list[LineEvent]:
        """Add an expectation, which may have its own framing, for frames other than replies.

        The connection's remaining bytes may be complete frames in the expectation's framing.
        """
        self.receiver.listen(expectation)
        if expectation.answer.framing is None:
            return []
        self._may_recut = True
        return self.process_frames(now) if self.receiver.has_more else []

    def receive(self, data: Payload, now: float, *, is_new: bool = True) -> list[LineEvent]:
        """Process bytes or an envelope from the transport; `is_new` as in `Engine.receive`."""
        if self.state != "open":
            return []
        if is_new and self.spec.stale_after_s is not None:
            self._read_frames(now)
        if isinstance(data, Envelope):
            told = self._unpacked(data, now)
            self.is_behind = self.is_open and bool(told)
            return told
        if self._may_recut:
            self._recut()
        self.receiver.decoder.push(data, now)
        return self.process_frames(now)

    def process_frames(self, now: float) -> list[LineEvent]:
        """Process received frames, up to and including the first frame that a sequence may expect.

        Later frames may belong to the next step, which must first register an expectation.
        """
        receiver = self.receiver
        events: list[LineEvent] = []
        while self.state == "open":
            if self._may_recut:
                self._recut()
            frame = receiver.decoder.next(now)
            if frame is None:
                break
            told = self._frame(frame, now)
            events += told
            if self.is_scripted and any(
                isinstance(event, (Matched, ExchangeEnded)) for event in told
            ):
                self.is_behind = self.state == "open"
                return events
            if receiver.has_more:
                events += self._ahead(now)
        # Queued requests may depend on the new samples, so process the samples first.
        self.is_behind = bool(events) and bool(self._request_queue)
        if receiver.is_prompted:
            events += receiver.find_prompt()
        return events + self._pump(now) if self._request_queue or self.is_per_request else events

    def _ahead(self, now: float) -> list[LineEvent]:
        """Process messages at the front of the stream and report their samples together.

        Processing short frames one by one takes almost twice as long as processing them in batches
        (decision 27). A batch ends after the expected reply or a rejected value, or before another
        kind of frame.
        """
        receiver, decoder, pending = (
            self.receiver,
            self.receiver.decoder,
            self._pending_replies.plain(),
        )
        if self.is_scripted or self._may_recut or receiver.is_listening:
            return []
        if (self._pending_replies and pending is None) or self.held.is_listening(now):
            return []
        if not isinstance(decoder, DelimiterDecoder):
            return []
        reply = None if pending is None else pending.exchange.ask.plain
        samples: list[Sample] = []
        refused: Sequence[str] = ()
        answer: Taken | None = None
        count, size = 0, 0
        for payload in decoder.ahead():
            frame = Frame(payload, self.spec.encoding)
            answer = None if reply is None else reply.take(frame, now)
            taken = answer or receiver.messages.decode(frame, now)
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
        events = receiver.events_of(samples, refused) if count > (answer is not None) else []
        if pending is not None and answer is not None:
            events += self._answered(pending, answer, now)
        return events

    def _recut(self) -> None:
        """Switch to the framing of a pending reply or step, or else to the connection's framing."""
        framing = (
            self._pending_replies.framing() if self._pending_replies else None
        ) or self.receiver.framing
        self._may_recut = framing is not None
        self.receiver.cut_by(framing or self.framing)

    def tick(self, now: float) -> list[LineEvent]:
        """Process all deadlines up to `now`."""
        events: list[LineEvent] = []
        if self.state == "open":
            for frame in self.receiver.decoder.tick(now):
                events += self._frame(frame, now)
        for exchange in tuple(self._request_queue):
            if exchange.gives_up_at <= now:
                self._request_queue.remove(exchange)
                events.append(
                    ExchangeEnded(
                        exchange, ExchangeOutcome("timed-out", "the request was not sent in time")
                    )
                )
        if self._pending_replies:
            for pending in self._pending_replies.overdue(now):
                events += self._overdue(pending, now)
        if self._silent_at is not None and self._silent_at <= now:
            self._silent_at = None
            text = f"nothing received for {self.spec.stale_after_s:g} s"
            events.append(Violation(self.spec.name, "no-data", text))
        return events + self._pump(now)

    def _frame(self, cut: bytes | FrameFault, now: float) -> list[LineEvent]:
        if isinstance(cut, FrameFault):
            fault = Violation(self.spec.name, cut.code, cut.message)
            return [fault, *self.fail(cut.message, now)] if cut.closes else [fault]
        frame = Frame(cut, self.spec.encoding)
        is_motion = self.held.is_listening(now)
        plain = self._pending_replies.plain() if self._pending_replies and not is_motion else None
        if plain is not None:
            return self._plain(plain, frame, now)
        if self._pending_replies:
            # Any frame may be a line of a reply, so messages take precedence.
            message = (
                self.receiver.message(frame, now)
                if self._pending_replies.collects_lines()
                else None
            )
            answered = self._pending_replies.offer(frame, is_message=message is not None)
            if answered is not None:
                told = self._answer(*answered, frame if message is None else None, now)
                return told if message is None else message + told
            if message is not None:
                return message
        of_motion = self._of_motion(frame, now) if is_motion else None
        return self.receiver.publish(frame, now) if of_motion is None else of_motion

    def _plain(self, pending: PendingReply, frame: Frame, now: float) -> list[LineEvent]:
        """Process a frame for a pending reply that contains only samples.

        Most replies contain only samples. `_answer` processes all other replies.
        """
        matcher = pending.exchange.ask.plain
        taken = None if matcher is None else matcher.take(frame, now)
        if taken is None:
            return self.receiver.publish(frame, now)
        return self._answered(pending, taken, now)

    def _answered(self, pending: PendingReply, taken: Taken, now: float) -> list[LineEvent]:
        self._misses = 0
        self._pending_replies.clear()
        samples, refused = taken
        events = self.receiver.events_of(samples, refused)
        values = {sample.signal: sample.value for sample in samples}
        events.append(
            new(ExchangeEnded, (pending.exchange, new(ExchangeOutcome, ("", "", values))))
        )
        return events + self.leave(now) if self.is_per_request and self.is_ready else events

    # -- replies: in time, late, or missing

    def _envelope(self, envelope: Envelope, now: float) -> list[LineEvent]:
        frame = frame_of(envelope, self.spec.encoding)
        if envelope.verb == "response":
            return self._response(envelope, frame, now)
        answered = self._pending_replies.offer(frame) if self._pending_replies else None
        if answered:
            return self._answer(*answered, frame, now)
        told = self._of_motion(frame, now) if self.held.is_listening(now) else None
        return self.receiver.publish(frame, now) if told is None else told

    def _response(self, envelope: Envelope, frame: Frame, now: float) -> list[LineEvent]:
        attributes = envelope.attributes
        number, reason = attributes.get("id"), ""
        if not attributes.get("ok", True):
            reason = str(attributes.get("reason") or "the robot refused")
        code = "timed-out" if attributes.get(UNKNOWN_END) is True else "refused"
        asker = self._askers.pop(number, None)
        if asker is not None and asker.goal is not None:
            asker.goal.ended(code)  # even if its request has already timed out
        pending = self._pending_replies.numbered(number)
        if pending is None:
            if number is None and self.held.is_listening(now):
                return self._motion_response(frame, attributes, now)
            # The reply belongs to a step, or its request has already timed out.
            if asker is None:
                return []
            return self.receiver.answered(asker.owner, frame, reason, now)
        if reason and pending.expectation.answer.takes_redirects and is_redirect(frame):
            reason = ""
        offer = pending.refused(frame, reason, code) if reason else pending.answer(frame)
        return self._answer(pending, offer, frame, now)

    def _motion_response(
        self, frame: Frame, attributes: Mapping[str, object], now: float
    ) -> list[LineEvent]:
        """Return the events for a response envelope that answers a motion frame."""
        if attributes.get("ok", True):
            return self._of_motion(frame, now) or []
        reason = str(attributes.get("reason") or "the robot refused")
        return self._motion_refused(self.held.refuse(frame, reason, now), frame, now)

    def _of_motion(self, frame: Frame, now: float) -> list[LineEvent] | None:
        """Return the events for a reply to a motion frame; None for other frames."""
        owed_until_s = self.held.owed_until_s
        told = self._told_of_motion(frame, now)
        if self.held.owed_until_s < owed_until_s and self.spec.is_half_duplex:
            self._request_queue.next_send = self._free_at
        return told

    def _told_of_motion(self, frame: Frame, now: float) -> list[LineEvent] | None:
        refused = self.held.refusals(frame, now)
        if refused:
            return self._motion_refused(refused, frame, now)
        if self.receiver.is_listening:
            return None  # a sequence is waiting for a frame, and may match this one
        message = self.receiver.message(frame, now)
        accepted = self.held.accepted(frame, now) if message is None else None
        if accepted is None:
            return message
        answer, offer = accepted
        events = self.receiver.dropped(offer) if offer.dropped else []
        if offer.fields is not None:
            events += self.receiver.samples(answer.matcher, offer.fields, now)[0]
        return events

    def _motion_refused(
        self, refused: Sequence[HoldRejected], frame: Frame, now: float
    ) -> list[LineEvent]:
        name, stops = self.spec.name, list[LineEvent]()  # motion ends before anything else happens
        events: list[LineEvent] = [*(self.receiver.message(frame, now) or ())]
        for command, offer in refused:
            if offer.told is not None:
                events += self.receiver.samples(*offer.told, now)[0]
            why = self.receiver.secrets.hide(offer.refusal)
            stops.append(MotionRefused(name, command, why))
            events.append(Violation(name, "motion-refused", f"{command}: {why}"))
        return stops + events

    def _answer(
        self, pending: PendingReply, offer: MatchResult, frame: Frame | None, now: float
    ) -> list[LineEvent]:
        """Return the events for a frame whose match result for a request is `offer`.

        A provisional reply may also be a message. A missing `frame` means that the message has
        already been reported.
        """
        exchange = pending.exchange
        events: list[LineEvent] = self.receiver.dropped(offer) if offer.dropped else []
        if offer.fields is None and not (offer.refusal or offer.aside):
            return events  # more lines follow
        if offer.fields is None and frame is not None:
            events += self.receiver.message(frame, now) or ()
        if pending.is_late:
            late = self._late_answer(pending, offer, now)
            if late is not None:
                return events + late
        self._misses = 0
        if offer.told is not None:
            events += self.receiver.samples(*offer.told, now)[0]
        if offer.aside == "extend":
            pending.extend(now)
            return events
        if offer.aside == "resend" and exchange.tries_left:
            exchange.tries_left -= 1
            self._pending_replies.remove(pending)
            text = f"the robot requested a retransmission of {exchange.ask.label}"
            return [
                *events,
                Violation(self.spec.name, "retransmitted", text),
                *self._send(exchange, now),
            ]
        if offer.aside:
            times = 1 + exchange.ask.retries
            text = f"the robot requested {exchange.ask.label} again after {times} transmissions"
            outcome = ExchangeOutcome("refused", text)
        elif offer.fields is None:
            outcome = ExchangeOutcome(offer.code, self.receiver.secrets.hide(offer.refusal))
        else:
            told, samples = self.receiver.samples(
                pending.expectation.answer.matcher, offer.fields, now
            )
            events += told
            pending.add(offer.fields, samples)
            if pending.next_stage(now):
                return events
            outcome = ExchangeOutcome(values=pending.values)
        self._pending_replies.remove(pending)
        events.append(ExchangeEnded(exchange, outcome))
        # Each request has its own connection: close after the reply.
        return events + self.leave(now) if self.is_per_request and self.is_ready else events

    def _late_answer(
        self, pending: PendingReply, offer: MatchResult, now: float
    ) -> list[LineEvent] | None:
        """Return the events for a late reply; None if the reply also answers a retransmission."""
        exchange = pending.exchange
        again = self._pending_replies.again(exchange)
        if again is not None:
            again.is_late = True
        elif exchange in self._request_queue:
            self._request_queue.remove(exchange)
        elif offer.aside == "extend":
            # Its reply is still pending, and still matches no other request.
            pending.extend(now)
            return []
        else:
            self._pending_replies.remove(pending)
            text = f"the late reply to {exchange.ask.label} was dropped"
            return [Violation(self.spec.name, "late-reply", text)]
        pending.is_late = False
        return None

    def _silent(self, pending: PendingReply, now: float) -> list[LineEvent]:
        """Treat the robot's silence as a successful reply."""
        if pending.next_stage(now):
            return []
        self._pending_replies.remove(pending)
        done: list[LineEvent] = [
            ExchangeEnded(pending.exchange, ExchangeOutcome(values=pending.values))
        ]
        return done + self.leave(now) if self.is_per_request and self.is_ready else done

    def _overdue(self, pending: PendingReply, now: float) -> list[LineEvent]:
        if pending not in self._pending_replies:
            return []  # the connection was closed because of another request
        if pending.is_late:
            self._pending_replies.remove(pending)
            return []
        if pending.expectation.answer.is_silence:
            return self._silent(pending, now)
        exchange, reply_s = pending.exchange, pending.expectation.answer.timeout_s
        is_alone = len(self._pending_replies) == 1
        text = self.receiver.no_answer(exchange, pending.waited(now), is_alone=is_alone)
        events: list[LineEvent] = [Violation(self.spec.name, "reply-timeout", text)]
        pending.is_late = True
        pending.due = now + reply_s
        if exchange.ask.is_repeated and exchange.tries_left and pending.stage == 0:
            exchange.tries_left -= 1
            wait_s = exchange.ask.retry.wait_s(exchange.ask.retries - exchange.tries_left)
            exchange.waits_until = now + wait_s
            exchange.gives_up_at = expires_at(exchange.ask, now + wait_s)
            if self.is_per_request and exchange.ask.learnt:
                exchange.data = None  # the next connection has a login of its own
            self._request_queue.put_back(exchange)
            return events + self.fail(text, now) if self.is_per_request else events
        events.append(ExchangeEnded(exchange, ExchangeOutcome("timed-out", text)))
        self._misses += not exchange.ask.is_miss_harmless
        if self.is_per_request or self._misses >= MISSES_UNTIL_CLOSED:
            events += self.fail(text, now)
        return events
