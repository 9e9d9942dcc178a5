"""The form ``equals``: one text, and no field."""

from collections.abc import Mapping
from typing import cast

from urc.model.codec import Payload, ReadSpec
from urc.model.values import NOTHING
from urc.protocol.forms import CodecContext, Frame
from urc.protocol.texts import encoded

__all__ = ["EqualsReader"]


class EqualsReader:
    """Takes exactly one frame."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._payload = encoded(cast("str", spec.options["text"]), context.encoding)

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return no fields for that frame, None for any other."""
        return NOTHING if frame.payload == self._payload else None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return that frame."""
        return self._payload
