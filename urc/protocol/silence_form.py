"""The answer of a robot that says nothing when it does what was asked: no frame is that."""

from collections.abc import Mapping

from urc.model.codec import ReadSpec
from urc.protocol.codec import CodecContext, Frame

__all__ = ["SilenceReader"]


class SilenceReader:
    """Takes no frame at all; the line takes the time that passes."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        """Nothing of them matters."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return None: whatever comes is something else."""
