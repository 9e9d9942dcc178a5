"""What a reader and a writer are, and what they are given.

Floor 3, pure. A form is one way to say what is in a frame. It owns both directions, so that the
emulated robot comes from the same declaration; `urc.protocol.forms` has the table of all forms.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from urc.expressions import quoted
from urc.model.codec import Payload
from urc.model.values import NOTHING
from urc.problems import UrcError
from urc.protocol.fresh import FIXED, Fresh

__all__ = ["BadItem", "BadText", "CodecContext", "Frame", "NotWritable", "Reader", "Writer"]


class BadText(ValueError):
    """A frame that is not text in the line's encoding; the message says where."""


class BadItem(BadText):
    """A frame that is meant here, with a value that it cannot have; the message names the item."""


class NotWritable(UrcError):
    """Values that cannot be put into this frame; the message names the one at fault."""


class Frame:
    """One frame as it came in; its text is decoded once, and only when somebody wants it."""

    __slots__ = ("_text", "attributes", "encoding", "fault", "payload", "topic", "was_text_wanted")

    fault: str
    """Why a reader that knew it could not take it; unset when there was none."""
    was_text_wanted: bool
    """A reader wanted text where there is none; unset when nobody did."""

    def __init__(self, payload: Payload, encoding: str) -> None:
        self.payload = payload
        self.encoding = encoding
        self._text: str | None = None
        self.topic: str | None = None
        """Where it comes from, on a transport that carries messages."""
        self.attributes: Mapping[str, object] = NOTHING
        """Of the envelope that brought it: status, headers."""
        # The fault is set when there is one: a line makes thousands of frames a second.

    @property
    def text(self) -> str:
        """The frame as text; raise `BadText` when it is none."""
        text = self._text
        if text is None:
            text = self._text = self._decoded()
        return text

    def _decoded(self) -> str:
        if not isinstance(self.payload, bytes):
            raise BadText("a message is no text")
        try:
            return self.payload.decode(self.encoding)
        except UnicodeDecodeError as error:
            wrong = self.payload[error.start : error.end]
            self.was_text_wanted = True
            raise BadText(f"{quoted(wrong)} is not {self.encoding} text") from None


class CodecContext(NamedTuple):
    """What a reader or writer must know of its line."""

    encoding: str = "utf-8"
    settings: Mapping[str, object] = NOTHING
    """Values of the profile's settings, for ``when`` and ``set``."""
    fresh: Fresh = FIXED
    """What is new in each frame that is written."""
    is_compiled: bool = False
    """Whether to compile functions of messages and commands, which pays in live sessions only."""


class Reader(Protocol):
    """Tells what is in a frame."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields, or None when the frame is another one; may raise `BadText`."""

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a frame that would be read as `fields`; raise `NotWritable` when none would."""


class Writer(Protocol):
    """Makes a frame."""

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the frame; raise `NotWritable` or `ExpressionError`."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the root names' values that give this frame, or None when none do."""
