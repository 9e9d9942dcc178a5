"""Declared messages of one connection. Pure.

A frame belongs to the first declared message that matches it.
"""

from collections.abc import Sequence

from urc.protocol.readings.compiled_value import Taken
from urc.protocol.requests.reply_match import Matcher
from urc.protocol.values.payload import Frame

__all__ = ["Messages"]


class Messages:
    """The declared messages of one connection, in document order."""

    def __init__(self, declared: Sequence[Matcher]) -> None:
        self.declared = tuple(declared)

    def decode(self, frame: Frame, now: float) -> Taken | None:
        """Return the samples and rejected values of a frame; None if no declared message matches.

        If a message matches the frame but rejects a value, the reason is stored in `Frame.fault`.
        """
        for one in self.declared:
            taken = one.take(frame, now)
            if taken is not None:
                return taken
        return None
