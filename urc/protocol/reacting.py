"""What a message does beside setting signals: collect over several frames, and be answered.

Floor 3, pure. Both hang on the step from fields to samples, which is done exactly once for a frame
that is a message. What is collected is forgotten with the connection; what is answered waits in
`Replies` until the line tells of the frame.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model.codec import Collect, Counted, Numbered, Payload
from urc.protocol.convert import Unusable
from urc.protocol.encode import BadArgument, Encode
from urc.protocol.gate import Counters
from urc.protocol.readings import Decode

__all__ = ["Collector", "Replies", "answering", "collecting"]

MOST_REPLIES: Final = 256
"""Answers that are made before they are told; a frame makes one at most."""


class Replies(list[Payload | Counted]):
    """Answers to messages, in their order, that are still to be sent."""


class Collector:
    """One value that is put together out of several frames."""

    def __init__(self, spec: Collect) -> None:
        self._spec = spec
        self._parts: list[object] | None = None
        self._size = 0
        self.forget()

    def forget(self) -> None:
        """Begin as on a fresh connection: without a mark, the first frame is the first part."""
        self._parts = [] if self._spec.begin is None else None
        self._size = 0

    def take(self, names: Mapping[str, object]) -> object:
        """Take the fields of a frame; return the whole when it is complete, else None."""
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
            return Unusable(f"a part cannot be collected: {error}")
        self._size += len(value) if isinstance(value, (list, tuple, bytes)) else 1
        if self._size > spec.most:
            self._parts = None
            return Unusable(f"more than {spec.most} values came before the last; dropped")
        self._parts.append(value)
        if spec.end is not None and _holds(spec.end, names):
            whole = _joined(self._parts)
            self.forget()
        return whole


def _holds(condition: Template | None, names: Mapping[str, object]) -> bool:
    try:
        return condition is not None and bool(condition.evaluate(names))
    except ExpressionError:
        return False  # it asks for a field that only another frame has


def _joined(parts: list[object]) -> object:
    """Return bytes as bytes, lists as one list, and all else as a list."""
    if parts and all(isinstance(part, bytes) for part in parts):
        return b"".join(part for part in parts if isinstance(part, bytes))
    whole: list[object] = []
    for part in parts:
        whole += part if isinstance(part, (list, tuple)) else (part,)
    return whole


def collecting(
    collectors: Mapping[str, Collector], settings: Mapping[str, object], decode: Decode
) -> Decode:
    """Return `decode` with what is collected as fields beside those of the frame."""

    def decode_collected(found: Mapping[str, object], now: float) -> object:
        names = {"settings": settings, **found}
        fields = dict(found)
        for name, collector in collectors.items():
            whole = collector.take(names)
            if whole is not None:
                fields[name] = whole
        return decode(fields, now)

    return decode_collected  # type: ignore[return-value]  # what `decode` returns


def answering(
    encode: Encode,
    names: Callable[[float, Mapping[str, object]], Mapping[str, object]],
    counters: Callable[[], Counters] | None,
    replies: Replies,
    decode: Decode,
) -> Decode:
    """Return `decode` that makes the answer to the frame as well.

    Args:
        encode: what the answer is.
        names: the time and the fields → what its expressions know.
        counters: of the connection; None where the answer counts nothing.
        replies: takes the answer.
        decode: what becomes of the fields.
    """

    def decode_answered(found: Mapping[str, object], now: float) -> tuple[list[object], list[str]]:
        samples, refused = decode(found, now)
        try:
            reply = made(now, found)
        except BadArgument as error:
            return samples, [*refused, f"the answer cannot be sent: {error}"]  # type: ignore[return-value]
        if len(replies) < MOST_REPLIES:
            replies.append(reply)
        return samples, refused  # type: ignore[return-value]

    def made(now: float, found: Mapping[str, object]) -> Payload | Counted:
        if counters is None:
            return encode(names(now, found))
        own = counters()
        numbered = drawn(own, now, found)
        if not own.is_shared:
            return numbered.data
        return Counted(numbered, partial(drawn, own, now, found))

    def drawn(own: Counters, now: float, found: Mapping[str, object]) -> Numbered:
        draw = own.draw()
        numbered = Numbered(encode(names(now, {**found, COUNTERS: draw})), draw.count)
        own.count(draw)
        return numbered

    return decode_answered  # type: ignore[return-value]
