"""The plain forms ``equals``, ``raw``, ``any`` and ``silence``."""

from collections.abc import Mapping
from typing import cast

from urc.expressions import quoted
from urc.model.payload import Payload, ReadSpec
from urc.model.values import NOTHING
from urc.protocol.values.payload import CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import encoded

__all__ = ["AnyReader", "EqualsReader", "RawReader", "SilenceReader"]


class SilenceReader:
    """A reader that never matches, for robots that stay silent on success."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        """Ignore both arguments: the form has no options."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return None, because no frame matches."""


class EqualsReader:
    """A reader that matches exactly one frame."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._payload = encoded(cast("str", spec.options["text"]), context.encoding)

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return an empty mapping for the expected frame and None for any other frame."""
        return NOTHING if frame.payload == self._payload else None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the expected frame."""
        return self._payload


class AnyReader:
    """A reader that matches every frame, for replies whose content does not matter."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        """Ignore both arguments: the form has no options."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return no fields."""
        return NOTHING

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return an empty frame, because this form matches every frame."""
        return b""


class RawReader:
    """A reader that returns the bytes of each frame as one field."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._field = cast("str", spec.options["field"])

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the bytes of the frame as a field; None for a message without bytes."""
        payload = frame.payload
        return {self._field: payload} if isinstance(payload, bytes) else None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the bytes of the field; raise `NotWritable` if the value is not bytes."""
        value = fields.get(self._field)
        if not isinstance(value, bytes):
            raise NotWritable(f"{self._field}: expected bytes, found {quoted(value)}")
        return value
