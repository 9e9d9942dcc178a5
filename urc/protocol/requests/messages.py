"""Declared messages of one connection. Pure.

The first declared message that accepts a frame takes it.
"""

from collections.abc import Sequence

from urc.protocol.readings.compiled_value import Taken
from urc.protocol.requests.reply_match import Matcher
from urc.protocol.values.payload import Frame

__all__ = ["Messages"]


class Messages:
    """The messages of one connection, in the order of the document."""

    def __init__(self, declared: Sequence[Matcher]) -> None:
        self.declared = tuple(declared)

    def decode(self, frame: Frame, now: float) -> Taken | None:
        """Return the samples and refused values of a frame, or None when it is no message.

        `Frame.fault` is set when a message recognised the frame but rejected its content.
        """
        for one in self.declared:
            taken = one.take(frame, now)
            if taken is not None:
                return taken
        return None
