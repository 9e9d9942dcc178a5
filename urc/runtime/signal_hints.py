"""Hints about signals that a test failed to set, with suggested corrections to the test.

Layer 4, pure. This module is used only after a failed test.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from urc.model.driver import Driver, Reply
from urc.model.payload import ReadSpec
from urc.protocol.forms.table import build_reader
from urc.protocol.framing.table import build_framing
from urc.protocol.values.payload import BadText, CodecContext, Frame
from urc.runtime.test_engine import TestEngine

__all__ = ["SignalHints"]

_SHOWN: Final = 40
_WAITED_FOR: Final = {
    "length": "for the rest of the declared length",
    "fixed": "for the rest of the frame",
    "idle": "for the silence after the frame",
    "slip": "for the end byte of the frame",
    "cobs": "for the end byte of the frame",
    "brackets": "for the closing bracket",
    "json": "for the end of the JSON value",
    "xml": "for the end of the XML element",
    "regex": "for bytes that match the pattern",
}
"""Text after "waits" that names what a frame still lacks, keyed by framing type."""


class _Asked(NamedTuple):
    """A request whose reply may match a frame."""

    how: str
    """Key and value to write in the test so that it sends the request."""
    transport: str
    reply: Reply


class SignalHints:
    """A search for the reason why a test did not set a signal."""

    def __init__(self, trial: TestEngine, *, in_steps: bool) -> None:
        self._trial = trial
        self._driver: Driver = trial.driver
        self._in_steps = in_steps

    def of(self, signal: str) -> str:
        """Return the reason to append to the text "nothing set it"; "" if the reason is unknown."""
        for transport in self._driver.transports:
            reason = self._of_line(transport, signal)
            if reason:
                return f": {reason}"
        if not self._trial.fed:
            return ": nothing was fed"
        others = sorted(self._trial.fresh)
        if others:
            return f": the data in 'feed' set {', '.join(others[:5])}"
        return ""

    def _of_line(self, transport: str, signal: str) -> str:
        fed = self._trial.fed.get(transport, b"")
        if not fed:
            return ""
        line = self._trial.engine.lines[transport]
        asked = self._asked_in_vain(transport, fed, signal)
        asked = asked or self._answered_by(transport, fed, signal)
        if not line.is_open and not line.is_per_request:
            return f"{transport} is not connected (add connects: {transport})"
        if asked:
            return asked
        if not line.is_open:
            return f"{transport} connects only for a request, and the test sent none"
        waiting = line.receiver.decoder.pending
        return self._waits(transport, fed[-waiting:]) if waiting else ""

    def _waits(self, transport: str, rest: bytes) -> str:
        spec = self._driver.transports[transport]
        framing = spec.framing
        text = _shown(rest, spec.encoding)
        if framing.type == "delimiter":
            end = framing.options.get("rx")
            return f"{text} waits for the delimiter {end!r} (write the delimiter in double quotes)"
        what = _WAITED_FOR.get(framing.type, "for the end of the frame")
        passes = " (add 'wait' to the step)" if framing.type == "idle" and self._in_steps else ""
        return f"{text} waits {what}{passes}"

    def _answered_by(self, transport: str, fed: bytes, signal: str) -> str:
        """Return a hint about an unsent request to which the frame may be the reply, or ""."""
        spec = self._driver.transports[transport]
        for asked in self._could_ask():
            reads = [asked.reply.read, *(stage.read for stage in asked.reply.stages)]
            if asked.transport != transport or all(signal not in read.fields for read in reads):
                continue
            framing = asked.reply.framing or spec.framing
            decoder = build_framing(framing).decoder()
            for cut in decoder.feed(fed):
                if isinstance(cut, bytes) and any(self._fits(cut, transport, one) for one in reads):
                    text = _shown(cut, spec.encoding)
                    return f"{text} is a reply without its request (add {asked.how})"
        return ""

    def _asked_in_vain(self, transport: str, fed: bytes, signal: str) -> str:
        """Return a hint if no received frame matches a sent request's reply format, else ""."""
        spec = self._driver.transports[transport]
        for label, reply in self._were_asked(transport):
            reads = [reply.read, *(stage.read for stage in reply.stages)]
            if all(signal not in read.fields for read in reads):
                continue
            decoder = build_framing(reply.framing or spec.framing).decoder()
            cuts = [cut for cut in decoder.feed(fed) if isinstance(cut, bytes)]
            if cuts and not any(self._fits(cut, transport, one) for cut in cuts for one in reads):
                form = next(one.form for one in reads if signal in one.fields)
                text = _shown(cuts[-1], spec.encoding)
                return f"{text} does not match the {form!r} of {label}, which was sent"
        return ""

    def _were_asked(self, transport: str) -> Iterator[tuple[str, Reply]]:
        """Yield the sent requests of the test that expect a reply on this transport."""
        for poll in self._trial.polls:
            is_ours = poll.transport == transport and ("poll", poll.name) in self._trial.used
            if is_ours and poll.reply is not None:
                # A poll without a name is identified by its position, such as polls.0.
                yield poll.name if "." in poll.name else f"poll {poll.name}", poll.reply
        for command in self._driver.commands.values():
            name = command.name
            is_ours = command.transport == transport and ("command", name) in self._trial.used
            if is_ours and command.reply is not None:
                yield f"command {name}", command.reply

    def _fits(self, payload: bytes, transport: str, read: ReadSpec) -> bool:
        encoding = self._driver.transports[transport].encoding
        reader = build_reader(read, CodecContext(encoding, self._trial.settings))
        try:
            return reader.read(Frame(payload, encoding)) is not None
        except BadText:
            return False

    def _could_ask(self) -> Iterator[_Asked]:
        """Yield the driver's requests that the test does not send but could send."""
        used = self._trial.used
        for poll in self._trial.polls:
            if poll.reply is not None and ("poll", poll.name) not in used:
                key = f"polls: [{poll.name}]" if self._in_steps else f"reply_to: {poll.name}"
                yield _Asked(key, poll.transport, poll.reply)
        for command in self._driver.commands.values():
            if command.reply is not None and ("command", command.name) not in used:
                yield _Asked(f"run: {command.name}", command.transport, command.reply)


def _shown(data: bytes, encoding: str) -> str:
    """Return bytes as readable text if possible, otherwise in hex."""
    cut = data[:_SHOWN]
    more = " …" if len(data) > _SHOWN else ""
    try:
        text = cut.decode(encoding)
    except UnicodeDecodeError:
        return f"{cut.hex(' ')}{more}"
    return f"{text!r}{more}" if text.isprintable() or text.strip().isprintable() else cut.hex(" ")
