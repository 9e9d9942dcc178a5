"""Frames received on one connection, except replies to requests.

Pure. See `urc.protocol.requests.conversation` for the theory of operation.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from urc.expressions import quoted
from urc.model.driver import TransportSpec
from urc.model.payload import CountedFrame
from urc.model.values import Sample
from urc.patterns import Pattern
from urc.protocol.events import Noted, Samples, Send, Violation
from urc.protocol.forms.http_head import is_redirect
from urc.protocol.framing.base import Decoder, Framing, StreamDecoder
from urc.protocol.framing.receive_buffer import ReceiveBuffer
from urc.protocol.requests.exchange import Exchange, LineEvent
from urc.protocol.requests.message_effects import Acknowledgements, Collector
from urc.protocol.requests.messages import Messages
from urc.protocol.requests.reply_match import (
    Expectation,
    Fields,
    Matched,
    Matcher,
    MatchResult,
    shown,
)
from urc.protocol.values.payload import BadText, Frame

__all__ = ["FrameReceiver"]


_HIDDEN: Final = "•••"
_MOST_SECRETS: Final = 8
_SHORTEST: Final = 3
"""Minimum length of a secret, in characters, for which only the secret is removed from a message. A
shorter secret may occur in ordinary words, so the whole message is hidden."""


class SentSecrets:
    """Secrets sent on a connection, which are redacted if the robot echoes them."""

    __slots__ = ("_texts",)

    def __init__(self) -> None:
        self._texts: deque[str] = deque(maxlen=_MOST_SECRETS)

    def add(self, data: bytes, encoding: str) -> None:
        """Register bytes that contain a secret."""
        text = data.decode(encoding, "replace").strip()
        if text:
            self._texts.append(text)

    def hide(self, text: str) -> str:
        """Return a message in which secrets that were sent on the connection are redacted."""
        for secret in self._texts:
            if secret in text:
                text = text.replace(secret, _HIDDEN) if len(secret) >= _SHORTEST else _HIDDEN
        return text


new = tuple.__new__
"""Fast constructor of named tuples, used for every frame."""
_SHOWN_BYTES = 20
"""Maximum number of bytes of an unknown frame that a message shows."""
_NO_MATCH = "no declaration matches "


class FrameReceiver:
    """The receiving side of one connection: framing, messages and expectations."""

    def __init__(self, spec: TransportSpec, framing: Framing, messages: list[Matcher]) -> None:
        self._spec = spec
        self._name = spec.name
        self._framing = framing
        self.messages = Messages(messages)
        self._stream = ReceiveBuffer()
        self._cut(framing)
        self.secrets = SentSecrets()
        self.replies = Acknowledgements()
        """Acknowledgements to send."""
        self.collectors: list[Collector] = []
        """Collectors that build values from several messages; they are reset when the connection is
        lost."""
        self._expectations: list[Expectation] = []
        self._prompt: tuple[Pattern, Expectation] | None = None
        self.is_listening = False
        """Whether an expectation is waiting for a frame or a prompt."""
        self._stray: tuple[float, str] = (float("-inf"), "")

    def reset(self, *, is_new: bool) -> None:
        """Clear the received data and all expectations of a connection.

        Secrets are kept until the next connection, because late messages may still contain them.
        """
        self._stream = ReceiveBuffer()
        self._cut(self._framing)
        self._expectations.clear()
        self._prompt = None
        self.is_listening = False
        self.replies.clear()
        for one in self.collectors:
            one.forget()
        if is_new:
            self.secrets = SentSecrets()

    def cut_by(self, framing: Framing) -> None:
        """Switch to `framing`, whose decoder begins with the bytes that remain in the buffer."""
        if framing is not self._cut_by:
            self._cut(framing)

    @property
    def has_more(self) -> bool:
        """Whether the buffer contains undecoded bytes."""
        return self._stream.at < len(self._stream.data)

    def _cut(self, framing: Framing) -> None:
        self._cut_by = framing
        self.decoder: Decoder = framing.decoder(self._stream)
        self.is_timed = getattr(type(self.decoder), "deadline", None) is not StreamDecoder.deadline
        """Whether the decoder has timeouts."""

    def publish(self, frame: Frame, now: float) -> list[LineEvent]:
        """Return the events for a frame that is not a reply."""
        heard = self._listeners(frame, now) if self._expectations else None
        told = self.message(frame, now)
        if heard is None and told is None:
            fault = self._unknown(frame)
            self._stray = (now, fault.message)
            return [fault]
        return told or [] if heard is None else heard + (told or [])

    def came_since(self, since: float, instead: str) -> str:
        """Return a clause about the last unexpected frame since `since`; "" if none arrived.

        Args:
            since: start time of the wait, in seconds.
            instead: words after "which is" in the clause, such as "no answer to home".
        """
        time_s, text = self._stray
        if time_s < since:
            return ""
        shown = text.removeprefix(_NO_MATCH)
        return f"; received {shown}, which is {instead}" if shown != text else f"; {text}"

    def no_answer(self, exchange: Exchange, waited: str, *, is_alone: bool) -> str:
        """Return why a request counts as unanswered.

        Args:
            exchange: the request.
            waited: the time waited in vain, such as ``within 2 s``.
            is_alone: whether no other request waits for a reply.
        """
        text = f"no answer to {exchange.ask.label}"
        came = self.came_since(exchange.sent_at, text)
        text = f"{text} {waited}{came}"
        if came and exchange.ask.match is None and not is_alone:
            text += "; if replies arrive in a different order from requests, declare 'match'"
        return text

    def listen(self, expectation: Expectation) -> None:
        """Add an expectation for frames other than replies."""
        self._expectations.append(expectation)
        self.is_listening = True

    @property
    def framing(self) -> Framing | None:
        """Framing for the expectations; None means the connection's framing."""
        return next(
            (
                expectation.answer.framing
                for expectation in self._expectations
                if expectation.answer.framing
            ),
            None,
        )

    def look_for(self, pattern: Pattern, expectation: Expectation) -> list[LineEvent]:
        """Search the text after the last complete frame for the prompt of `expectation`."""
        self._prompt = (pattern, expectation)
        self.is_listening = True
        return self.find_prompt()

    def unlisten(self, expectation: Expectation) -> None:
        """Remove an expectation."""
        self._expectations = [one for one in self._expectations if one is not expectation]
        if self._prompt is not None and self._prompt[1] is expectation:
            self._prompt = None
        self.is_listening = bool(self._expectations) or self._prompt is not None

    @property
    def is_prompted(self) -> bool:
        """Whether an expectation is waiting for a prompt."""
        return self._prompt is not None

    def find_prompt(self) -> list[LineEvent]:
        """Search for the expected prompt; return the events if the prompt is found."""
        if self._prompt is None:
            return []
        pattern, expectation = self._prompt
        stream = self._stream
        text = stream.data[stream.at :].decode(self._spec.encoding, "replace")
        if not text or pattern.search(text) is None:
            return []
        stream.at = len(stream.data)
        self._cut(self._cut_by)
        self._prompt = None
        self.is_listening = bool(self._expectations)
        return [Matched(expectation, MatchResult({}))]

    def message(self, frame: Frame, now: float) -> list[LineEvent] | None:
        """Return the events for a frame that a declared message matches; None for other frames."""
        taken = self.messages.decode(frame, now)
        return None if taken is None else self.events_of(*taken)

    def _listeners(self, frame: Frame, now: float) -> list[LineEvent] | None:
        for expectation in self._expectations:
            offer = expectation.offer(frame)
            if offer is not None:
                return self._match(expectation, offer, now)
        return None

    def _match(self, expectation: Expectation, offer: MatchResult, now: float) -> list[LineEvent]:
        """Return the events for a frame that matches an expectation."""
        events: list[LineEvent] = self.dropped(offer)
        if offer.fields is not None:
            events += self.samples(expectation.answer.matcher, offer.fields, now)[0]
        elif offer.told is not None:
            events += self.samples(*offer.told, now)[0]
        if offer.fields is not None or offer.refusal:
            self.unlisten(expectation)
            events.append(Matched(expectation, offer))
        return events

    def answered(self, asker: object, frame: Frame, refusal: str, now: float) -> list[LineEvent]:
        """Return the events for a reply that a step of `asker` expects.

        Args:
            asker: the sequence that made the request; only this sequence receives the reply.
            frame: the reply.
            refusal: the robot's refusal as text; "" means no refusal.
            now: current time, in seconds.
        """
        expectation = next((one for one in self._expectations if one.owner is asker), None)
        if expectation is None:
            return []
        offer = expectation.offer(frame)
        is_redirected = expectation.answer.takes_redirects and is_redirect(frame)
        if refusal and not is_redirected and (offer is None or not offer.refusal):
            offer = MatchResult(refusal=refusal)
        if offer is None:
            offer = MatchResult(refusal=f"the reply does not match the declaration: {shown(frame)}")
        return self._match(expectation, offer, now)

    def dropped(self, offer: MatchResult) -> list[LineEvent]:
        """Return the violation for collected lines that did not match the reply."""
        return [Violation(self._spec.name, "no-match", offer.dropped)] if offer.dropped else []

    def _unknown(self, frame: Frame) -> Violation:
        """Return the violation for a frame that does not match any declaration."""
        fault = getattr(frame, "fault", "")
        if fault:
            return Violation(self._spec.name, "bad-value", self.secrets.hide(fault))
        if frame.topic is not None:
            where = f"no declaration matches the data on {frame.topic!r}"
            return Violation(self._spec.name, "no-match", self.secrets.hide(where))
        was_text_wanted = getattr(frame, "was_text_wanted", False)
        try:
            text = self.secrets.hide(frame.text)
        except BadText as error:
            if was_text_wanted:
                return Violation(self._spec.name, "bad-text", str(error))
            return Violation(self._spec.name, "no-match", f"{_NO_MATCH}{self._in_hex(frame)}")
        return Violation(self._spec.name, "no-match", f"{_NO_MATCH}{quoted(text, most=60)}")

    def samples(
        self, matcher: Matcher, found: Fields, now: float
    ) -> tuple[list[LineEvent], list[Sample]]:
        """Return the events for the fields in a frame, and the samples from those fields."""
        samples, refused = matcher.decode(found, now)
        return self.events_of(samples, refused), samples

    def events_of(self, samples: list[Sample], refused: Sequence[str]) -> list[LineEvent]:
        """Return the events for samples and rejected values.

        A valid frame without values also causes an event, because it shows that the robot is alive.
        """
        if not refused and not self.replies:
            return [new(Samples, (self._name, tuple(samples)))]
        name = self._spec.name
        events: list[LineEvent] = []
        if samples or not refused:
            events.append(Samples(name, tuple(samples)))
        events += [Violation(name, "bad-value", line) for line in refused]
        if self.replies:
            for one in self.replies:
                if isinstance(one, Noted):
                    events.append(one)
                    continue
                shared = one if isinstance(one, CountedFrame) else None
                data = one.numbered.data if isinstance(one, CountedFrame) else one
                events.append(Send(name, data, counted=shared))
            self.replies.clear()
        return events

    def _in_hex(self, frame: Frame) -> str:
        data = frame.payload if isinstance(frame.payload, bytes) else b""
        text = data.decode(self._spec.encoding, "replace")
        if self.secrets.hide(text) != text:
            return f"{len(data)} bytes that contain a secret"
        return data[:_SHOWN_BYTES].hex(" ") + (" …" if len(data) > _SHOWN_BYTES else "")
