"""Readers and writers: what is in a frame, in both directions.

Floor 3, pure. A row of `READERS` or `WRITERS` is a factory ``(spec, context) -> reader`` (or
writer), called once when an engine is built. Each owns both directions, so that the emulated robot
comes from the same declaration.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from urc.model.codec import Payload, ReadSpec, WriteSpec
from urc.problems import UrcError
from urc.registry import Table

__all__ = [
    "READERS",
    "WRITERS",
    "BadText",
    "CodecContext",
    "Frame",
    "NotWritable",
    "Reader",
    "Writer",
    "build_reader",
    "build_writer",
]


class BadText(ValueError):
    """A frame that is not text in the line's encoding; the message says where."""


class NotWritable(UrcError):
    """Values that cannot be put into this frame; the message names the one at fault."""


class Frame:
    """One frame as it came in; its text is decoded once, and only when somebody wants it."""

    __slots__ = ("_text", "encoding", "payload")

    def __init__(self, payload: Payload, encoding: str) -> None:
        self.payload = payload
        self.encoding = encoding
        self._text: str | None = None

    @property
    def text(self) -> str:
        """The frame as text; raise `BadText` when it is none."""
        if self._text is None:
            if not isinstance(self.payload, bytes):
                raise BadText("a message is no text")
            try:
                self._text = self.payload.decode(self.encoding)
            except UnicodeDecodeError as error:
                wrong = self.payload[error.start : error.end]
                raise BadText(f"{wrong!r} is not {self.encoding} text") from None
        return self._text


class CodecContext(NamedTuple):
    """What a reader or writer must know of its line."""

    encoding: str = "utf-8"


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


def build_reader(spec: ReadSpec, context: CodecContext) -> Reader:
    """Return the reader that `spec` declares."""
    reader: Reader = READERS[spec.form].load()(spec, context)
    return reader


def build_writer(spec: WriteSpec, context: CodecContext) -> Writer:
    """Return the writer that `spec` declares."""
    writer: Writer = WRITERS[spec.form].load()(spec, context)
    return writer


READERS = Table(
    "urc.readers",
    {
        "regex": "urc.protocol.regex_form:RegexReader",
    },
)
WRITERS = Table(
    "urc.writers",
    {
        "text": "urc.protocol.text_form:TextWriter",
    },
)
