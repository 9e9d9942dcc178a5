"""Additional effects of messages: collected values, acknowledgements and log entries.

Pure. Values are collected and messages acknowledged while fields are converted to samples, so
exactly once per message. Incomplete collected values are discarded when the connection is lost.
Acknowledgements and log entries wait in `Acknowledgements` until the conversation has reported the
frame.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from urc.expressions import COUNTERS, ExpressionError, Template, quoted
from urc.model.driver import LogLine
from urc.model.payload import Collect, CountedFrame, Numbered, Payload
from urc.problems import printable
from urc.protocol.events import Noted
from urc.protocol.readings.readings import Decode
from urc.protocol.requests.encode import BadArgument, Encode
from urc.protocol.requests.rate import Counters
from urc.protocol.values.convert import Unusable

__all__ = ["Collector", "Acknowledgements", "answering", "collecting", "noting"]

MOST_REPLIES: Final = 256
"""Maximum number of pending acknowledgements; each frame adds at most one."""
LONGEST_NOTE: Final = 500
"""Maximum length of a log entry from a message, in characters."""
_LEVELS: Final = ("info", "warning", "error")


class Acknowledgements(list[Payload | CountedFrame | Noted]):
    """Pending acknowledgements and log entries of messages, in order."""

    def note_of(self, transport: str) -> Callable[[str], None]:
        """Return a function that adds a line to the log of a transport."""

        def note(text: str) -> None:
            if len(self) < MOST_REPLIES:
                self.append(Noted(transport, "info", printable(text)[:LONGEST_NOTE]))

        return note


class Collector:
    """A collector that builds one value from several frames."""

    def __init__(self, spec: Collect) -> None:
        self._spec = spec
        self._parts: list[object] | None = None
        self._size = 0
        self.forget()

    def forget(self) -> None:
        """Discard the collected parts; without ``begin``, the next frame begins a new value."""
        self._parts = [] if self._spec.begin is None else None
        self._size = 0

    def add(self, names: Mapping[str, object]) -> object:
        """Process the fields of a frame; return the value if it is complete, or None."""
        spec, whole = self._spec, None
        if spec.begin is not None and _holds(spec.begin, names):
            if spec.end is None and self._parts is not None:
                whole = _joined(self._parts)
            self._parts, self._size = [], 0
        if self._parts is None:
            if spec.begin is None and _holds(spec.end, names):
                self.forget()
            return whole
        try:
            value = spec.value.evaluate(names)
        except ExpressionError as error:
            self._parts = None
            return Unusable(f"part of the value cannot be computed: {error}")
        self._size += len(value) if isinstance(value, (list, tuple, bytes)) else 1
        if self._size > spec.max:
            self._parts = None
            return Unusable(f"more than {spec.max} values before the last frame; dropped")
        self._parts.append(value)
        if spec.end is not None and _holds(spec.end, names):
            whole = _joined(self._parts)
            self.forget()
        return whole


def _holds(condition: Template | None, names: Mapping[str, object]) -> bool:
    try:
        return condition is not None and bool(condition.evaluate(names))
    except ExpressionError:
        return False  # the condition reads a field of another frame


def _joined(parts: list[object]) -> object:
    """Return bytes or lists joined to one value, and any other values as a list."""
    if parts and all(isinstance(part, bytes) for part in parts):
        return b"".join(part for part in parts if isinstance(part, bytes))
    whole: list[object] = []
    for part in parts:
        whole += part if isinstance(part, (list, tuple)) else (part,)
    return whole


def collecting(
    collectors: Mapping[str, Collector], settings: Mapping[str, object], decode: Decode
) -> Decode:
    """Return a variant of `decode` that adds the collected values to the fields."""

    def decode_collected(found: Mapping[str, object], now: float) -> object:
        names = {"settings": settings, **found}
        fields = dict(found)
        for name, collector in collectors.items():
            whole = collector.add(names)
            if whole is not None:
                fields[name] = whole
        return decode(fields, now)

    return decode_collected  # type: ignore[return-value]  # the result of `decode`


def answering(
    encode: Encode,
    names: Callable[[float, Mapping[str, object]], Mapping[str, object]],
    counters: Callable[[], Counters] | None,
    replies: Acknowledgements,
    decode: Decode,
) -> Decode:
    """Return a variant of `decode` that also renders the frame's acknowledgement.

    Args:
        encode: function that renders the acknowledgement.
        names: function that returns the namespace for a time and fields.
        counters: function that returns the connection's counters; None for a frame without
            counters.
        replies: list of pending acknowledgements, to which the new acknowledgement is added.
        decode: function that converts the fields to samples.
    """

    def decode_answered(found: Mapping[str, object], now: float) -> tuple[list[object], list[str]]:
        samples, refused = decode(found, now)
        try:
            reply = made(now, found)
        except BadArgument as error:
            return samples, [*refused, f"the acknowledgement cannot be sent: {error}"]  # type: ignore[return-value]
        if len(replies) < MOST_REPLIES:
            replies.append(reply)
        return samples, refused  # type: ignore[return-value]

    def made(now: float, found: Mapping[str, object]) -> Payload | CountedFrame:
        if counters is None:
            return encode(names(now, found))
        own = counters()
        numbered = drawn(own, now, found)
        if not own.is_shared:
            return numbered.data
        return CountedFrame(numbered, partial(drawn, own, now, found))

    def drawn(own: Counters, now: float, found: Mapping[str, object]) -> Numbered:
        draw = own.draw()
        numbered = Numbered(encode(names(now, {**found, COUNTERS: draw})), draw.count)
        own.count(draw)
        return numbered

    return decode_answered  # type: ignore[return-value]


def noting(
    line: LogLine,
    transport: str,
    names: Callable[[float, Mapping[str, object]], Mapping[str, object]],
    notes: Acknowledgements,
    decode: Decode,
) -> Decode:
    """Return a variant of `decode` that also creates the log entry of the message.

    Args:
        line: declaration of the log entry.
        transport: name of the transport.
        names: function that returns the namespace for a time and fields.
        notes: list of pending effects, to which the log entry is added.
        decode: function that converts the fields to samples.
    """

    def decode_noted(found: Mapping[str, object], now: float) -> tuple[list[object], list[str]]:
        samples, refused = decode(found, now)
        known = names(now, found)
        try:
            level = "info" if line.level is None else line.level.evaluate(known)
            if level is None or level == "":
                return samples, refused  # type: ignore[return-value]
            text = printable(str(line.text.evaluate(known)))[:LONGEST_NOTE]
        except ExpressionError as error:
            return samples, [*refused, f"the log entry cannot be created: {error}"]  # type: ignore[return-value]
        if level not in _LEVELS:
            fault = f"the level of a log entry is info, warning or error, found {quoted(level)}"
            return samples, [*refused, fault]  # type: ignore[return-value]
        if len(notes) < MOST_REPLIES:
            notes.append(Noted(transport, level, text))  # type: ignore[arg-type]  # one of _LEVELS
        return samples, refused  # type: ignore[return-value]

    return decode_noted  # type: ignore[return-value]
