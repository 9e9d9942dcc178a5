"""Interfaces of readers and writers, and their context.

Pure. A form is one notation for the content of a frame. A form works in both directions, so that
the emulated robot uses the same declaration; `urc.protocol.forms.table` has the table of all forms.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from urc.expressions import quoted
from urc.model.payload import Payload
from urc.model.values import NOTHING
from urc.problems import UrcError
from urc.protocol.values.time_and_nonce import FIXED, TimeAndNonce

__all__ = [
    "BadItem",
    "BadText",
    "CodecContext",
    "Frame",
    "NotWritable",
    "PayloadReader",
    "PayloadWriter",
]


class BadText(ValueError):
    """A frame that is not text in the encoding of the connection; the message says where."""


class BadItem(BadText):
    """A matching frame with an invalid value; the message names the item."""


class NotWritable(UrcError):
    """Values that do not fit into this frame; the message names the invalid one."""


class Frame:
    """One received frame; its text is decoded once, on first use."""

    __slots__ = ("_text", "attributes", "encoding", "fault", "payload", "topic", "was_text_wanted")

    fault: str
    """Why a reader rejected a frame of its kind; unset without a reason."""
    was_text_wanted: bool
    """Whether a reader needed the text of an undecodable frame; unset before that."""

    def __init__(self, payload: Payload, encoding: str) -> None:
        self.payload = payload
        self.encoding = encoding
        self._text: str | None = None
        self.topic: str | None = None
        """Source topic, on a transport that carries messages."""
        self.attributes: Mapping[str, object] = NOTHING
        """Attributes of the envelope that contained it: status, headers."""
        # `fault` stays unset until needed, because a connection makes thousands of frames per
        # second.

    @property
    def text(self) -> str:
        """The frame as text; raises `BadText` when it is not text."""
        text = self._text
        if text is None:
            text = self._text = self._decoded()
        return text

    def _decoded(self) -> str:
        if not isinstance(self.payload, bytes):
            raise BadText("a message without text")
        try:
            return self.payload.decode(self.encoding)
        except UnicodeDecodeError as error:
            wrong = self.payload[error.start : error.end]
            self.was_text_wanted = True
            raise BadText(f"{quoted(wrong)} is not {self.encoding} text") from None


class CodecContext(NamedTuple):
    """Properties of the connection that readers and writers need."""

    encoding: str = "utf-8"
    settings: Mapping[str, object] = NOTHING
    """Values of the settings of the profile, for ``when`` and ``set``."""
    fresh: TimeAndNonce = FIXED
    """Sources of times and nonces for written frames."""
    is_compiled: bool = False
    """Whether to generate functions for messages and commands, worthwhile only in live sessions."""


class PayloadReader(Protocol):
    """Reads the fields of a frame."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields, or None for another kind of frame; may raise `BadText`."""

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a frame that reads as `fields`; raise `NotWritable` if there is no such frame."""


class PayloadWriter(Protocol):
    """Makes a frame."""

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the frame; raise `NotWritable` or `ExpressionError`."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values of the root names that give this frame, or None if impossible."""
