"""Interfaces for readers and writers, and their context.

Pure. A form is one notation for the content of a frame. A form works in both directions, so the
emulated robot can use the same declaration. `urc.protocol.forms.table` contains all forms.
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
    """The frame is not valid text in the connection's encoding; the message shows the bytes."""


class BadItem(BadText):
    """The frame matches but contains an invalid value; the message names the item."""


class NotWritable(UrcError):
    """The values cannot be encoded in this frame; the message names the invalid value."""


class Frame:
    """A received frame; the text is decoded once, on first use."""

    __slots__ = ("_text", "attributes", "encoding", "fault", "payload", "topic", "was_text_wanted")

    fault: str
    """Reason why a reader rejected a value in the frame; not set if no value was rejected."""
    was_text_wanted: bool
    """Whether a reader needed the text, although it cannot be decoded; not set if no reader needed
    it."""

    def __init__(self, payload: Payload, encoding: str) -> None:
        self.payload = payload
        self.encoding = encoding
        self._text: str | None = None
        self.topic: str | None = None
        """Source topic of the frame; None on transports without topics."""
        self.attributes: Mapping[str, object] = NOTHING
        """Attributes of the frame's envelope, such as status and headers."""
        # `fault` stays unset until needed, because a connection creates thousands of frames per
        # second.

    @property
    def text(self) -> str:
        """Text of the frame; raises `BadText` if undecodable."""
        text = self._text
        if text is None:
            text = self._text = self._decoded()
        return text

    def _decoded(self) -> str:
        if not isinstance(self.payload, bytes):
            raise BadText("the message has no text")
        try:
            return self.payload.decode(self.encoding)
        except UnicodeDecodeError as error:
            wrong = self.payload[error.start : error.end]
            self.was_text_wanted = True
            raise BadText(f"{quoted(wrong)} is not {self.encoding} text") from None


class CodecContext(NamedTuple):
    """Encoding, settings and other properties of a connection, for its readers and writers."""

    encoding: str = "utf-8"
    settings: Mapping[str, object] = NOTHING
    """Values of the profile's settings, for ``when`` and ``set``."""
    fresh: TimeAndNonce = FIXED
    """Source of times and nonces for sent frames."""
    is_compiled: bool = False
    """Whether to generate functions for messages and commands; generated functions save time only
    in live sessions."""
    has_keys: bool = False
    """Whether topics are Zenoh keys, with the wildcards of key expressions."""
    namespace: str | None = None
    """Namespace of ROS for relative names; None to keep all names as written."""


class PayloadReader(Protocol):
    """A reader for the fields of a frame."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields; None if the frame does not match. May raise `BadText`."""

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a frame with `fields`; raise `NotWritable` if impossible."""


class PayloadWriter(Protocol):
    """A writer for frames."""

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the frame; raise `NotWritable` or `ExpressionError`."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the values, keyed by name, for which `write` returns this frame, or None."""
