"""What comes in on one line and answers no request.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from collections.abc import Sequence

from urc.model.driver import TransportSpec
from urc.model.values import Sample
from urc.patterns import Pattern
from urc.protocol.events import Event, Fault, Samples
from urc.protocol.exchange import Ear, Fields, Heard, LineEvent, Matcher, Offer
from urc.protocol.forms import BadText, Frame
from urc.protocol.framing import Decoder, Framing, Stream
from urc.protocol.messages import Messages
from urc.protocol.secrets import Secrets

__all__ = ["Inbox"]

_SHOWN_BYTES = 20
"""Of a frame that nothing matches."""


class Inbox:
    """The stream of one line: cut into frames, and told by messages and those who listen."""

    def __init__(self, spec: TransportSpec, framing: Framing, messages: list[Matcher]) -> None:
        self._spec = spec
        self._framing = self._cut_by = framing
        self.messages = Messages(messages, spec.encoding)
        self._stream = Stream()
        self.decoder: Decoder = framing.decoder(self._stream)
        self.secrets = Secrets()
        self._ears: list[Ear] = []
        self._prompt: tuple[Pattern, Ear] | None = None

    def reset(self, *, is_new: bool) -> None:
        """Forget a connection. Its secrets are kept until there `is_new` one, for late messages."""
        self._stream = Stream()
        self._cut_by = self._framing
        self.decoder = self._framing.decoder(self._stream)
        self._ears.clear()
        self._prompt = None
        if is_new:
            self.secrets = Secrets()

    def cut_by(self, framing: Framing) -> None:
        """Let `framing` cut what comes next, beginning with what is left of the stream."""
        if framing is not self._cut_by:
            self._cut_by = framing
            self.decoder = framing.decoder(self._stream)

    @property
    def is_recut(self) -> bool:
        """Whether another framing than the line's own cuts the stream."""
        return self._cut_by is not self._framing

    def tell(self, frame: Frame, now: float) -> list[LineEvent]:
        """Return what a frame says that answers no request."""
        heard = self._listeners(frame, now)
        told = self.message(frame, now)
        if heard is None and told is None:
            return [self._unknown(frame)]
        return [*(heard or ()), *(told or ())]

    def listen(self, ear: Ear) -> None:
        """Let `ear` have the frames that answer no request."""
        self._ears.append(ear)

    def look_for(self, pattern: Pattern, ear: Ear) -> list[LineEvent]:
        """Let `ear` have the text that `pattern` finds after the last whole frame."""
        self._prompt = (pattern, ear)
        return self.look()

    def unlisten(self, ear: Ear) -> None:
        """Nobody listens there any more."""
        self._ears = [one for one in self._ears if one is not ear]
        if self._prompt is not None and self._prompt[1] is ear:
            self._prompt = None

    @property
    def is_prompted(self) -> bool:
        """Whether somebody waits for a prompt."""
        return self._prompt is not None

    def look(self) -> list[LineEvent]:
        """Look for the prompt that somebody waits for."""
        if self._prompt is None:
            return []
        pattern, ear = self._prompt
        stream = self._stream
        text = stream.data[stream.at :].decode(self._spec.encoding, "replace")
        if not text or pattern.search(text) is None:
            return []
        stream.at = len(stream.data)
        self.decoder = self._cut_by.decoder(stream)
        self._prompt = None
        return [Heard(ear, Offer({}))]

    def message(self, frame: Frame, now: float) -> list[LineEvent] | None:
        """Return what a declared message makes of the frame, or None when it is none."""
        taken = self.messages.take(frame.payload, now, frame)
        return None if taken is None else list(self._told(*taken))

    def quick(self, payload: bytes, now: float) -> list[LineEvent] | None:
        """Do what `tell` does with most frames: nobody listens, and it is a message."""
        if self._ears:
            return None
        taken = self.messages.take(payload, now)
        return None if taken is None else list(self._told(*taken))

    def _listeners(self, frame: Frame, now: float) -> list[LineEvent] | None:
        for ear in self._ears:
            offer = ear.offer(frame)
            if offer is None:
                continue
            events: list[LineEvent] = self.dropped(offer)
            if offer.fields is not None:
                events += self.samples(ear.answer.matcher, offer.fields, now)[0]
            if offer.fields is not None or offer.refusal:
                self.unlisten(ear)
                events.append(Heard(ear, offer))
            return events
        return None

    def dropped(self, offer: Offer) -> list[LineEvent]:
        """Return what to say of lines that turned out to be no answer."""
        return [Fault(self._spec.name, "no-match", offer.dropped)] if offer.dropped else []

    def _unknown(self, frame: Frame) -> Fault:
        """Return what to say of a frame that nothing declared matches."""
        fault = getattr(frame, "fault", "")
        if fault:
            return Fault(self._spec.name, "bad-value", self.secrets.hide(fault))
        was_text_wanted = getattr(frame, "was_text_wanted", False)
        try:
            text = self.secrets.hide(frame.text)
        except BadText as error:
            if was_text_wanted:
                return Fault(self._spec.name, "bad-text", str(error))
            return Fault(
                self._spec.name, "no-match", f"nothing declared matches {self._in_hex(frame)}"
            )
        shown = text if len(text) <= 60 else text[:57] + "..."
        return Fault(self._spec.name, "no-match", f"nothing declared matches {shown!r}")

    def samples(
        self, matcher: Matcher, found: Fields, now: float
    ) -> tuple[list[Event], list[Sample]]:
        """Return what to tell of a frame's fields, and the readings among them."""
        samples, refused = matcher.decode(found, now)
        return self._told(samples, refused), samples

    def _told(self, samples: list[Sample], refused: Sequence[str]) -> list[Event]:
        # A good frame without values is told of, too: it shows that the line lives.
        is_good = bool(samples) or not refused
        events: list[Event] = [Samples(self._spec.name, tuple(samples))] if is_good else []
        events += [Fault(self._spec.name, "bad-value", line) for line in refused]
        return events

    def _in_hex(self, frame: Frame) -> str:
        data = frame.payload if isinstance(frame.payload, bytes) else b""
        text = data.decode(self._spec.encoding, "replace")
        if self.secrets.hide(text) != text:
            return f"{len(data)} bytes, with a secret among them"
        return data[:_SHOWN_BYTES].hex(" ") + (" …" if len(data) > _SHOWN_BYTES else "")
