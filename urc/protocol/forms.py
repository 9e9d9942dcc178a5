"""Readers and writers: what is in a frame, in both directions.

Floor 3, pure. A row of `READERS` or `WRITERS` is a factory ``(spec, context) -> reader`` (or
writer), called once when an engine is built. Each owns both directions, so that the emulated robot
comes from the same declaration.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from urc.model.codec import Payload, ReadSpec, WriteSpec
from urc.model.values import NOTHING
from urc.problems import UrcError
from urc.registry import Table

__all__ = [
    "READERS",
    "WRITERS",
    "BadItem",
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


class BadItem(BadText):
    """A frame that is meant here, with a value that it cannot have; the message names the item."""


class NotWritable(UrcError):
    """Values that cannot be put into this frame; the message names the one at fault."""


class Frame:
    """One frame as it came in; its text is decoded once, and only when somebody wants it."""

    __slots__ = ("_text", "encoding", "fault", "payload", "topic", "was_text_wanted")

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
            raise BadText(f"{wrong!r} is not {self.encoding} text") from None


class CodecContext(NamedTuple):
    """What a reader or writer must know of its line."""

    encoding: str = "utf-8"
    settings: Mapping[str, object] = NOTHING
    """Values of the profile's settings, for ``when`` and ``set``."""


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
    if spec.topic is not None:
        from urc.protocol.topics import TopicReader

        reader = TopicReader(reader, spec, context)
    if not (spec.conversions or spec.sets or spec.when):
        return reader
    from urc.protocol.shaped import ShapedReader

    return ShapedReader(reader, spec, context)


def build_writer(spec: WriteSpec, context: CodecContext) -> Writer:
    """Return the writer that `spec` declares."""
    writer: Writer = WRITERS[spec.form].load()(spec, context)
    return writer


READERS = Table(
    "urc.readers",
    {
        "regex": "urc.protocol.regex_form:RegexReader",
        "pattern": "urc.protocol.pattern_form:PatternReader",
        "split": "urc.protocol.split_form:SplitReader",
        "keyvalue": "urc.protocol.split_form:KeyvalueReader",
        "json": "urc.protocol.json_paths:JsonReader",
        "xml": "urc.protocol.xml_form:XmlReader",
        "equals": "urc.protocol.equals_form:EqualsReader",
        "struct": "urc.protocol.struct_form:StructReader",
        "any": "urc.protocol.equals_form:AnyReader",
        "raw": "urc.protocol.equals_form:RawReader",
    },
)
WRITERS = Table(
    "urc.writers",
    {
        "text": "urc.protocol.text_form:TextWriter",
        "hex": "urc.protocol.hex_form:BytesWriter",
        "bytes": "urc.protocol.hex_form:BytesWriter",
        "json": "urc.protocol.json_text_form:JsonWriter",
        "struct": "urc.protocol.struct_form:StructWriter",
        "envelope": "urc.protocol.envelope_form:EnvelopeWriter",
    },
)
