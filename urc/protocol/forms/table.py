"""Tables of the forms' readers and writers, and functions that build a declared reader or writer.

Pure. Each value in `READERS` and `WRITERS` is a factory with the parameters ``(spec, context)``,
which returns a reader or a writer. An engine calls each declaration's factory once, when the engine
is created. `urc.protocol.values.payload` defines the interfaces of readers and writers.
"""

from urc.model.payload import ReadSpec, WriteSpec
from urc.protocol.values.payload import CodecContext, PayloadReader, PayloadWriter
from urc.registry import Table

__all__ = ["READERS", "WRITERS", "build_reader", "build_writer"]


def build_reader(spec: ReadSpec, context: CodecContext) -> PayloadReader:
    """Return the reader that `spec` declares."""
    reader: PayloadReader = READERS[spec.form].load()(spec, context)
    if spec.topic is not None:
        from urc.protocol.forms.topics import TopicReader

        reader = TopicReader(reader, spec, context)
    if spec.head:
        from urc.protocol.forms.http_head import HeadReader

        reader = HeadReader(reader, spec)
    if not (spec.conversions or spec.sets or spec.when):
        return reader
    from urc.protocol.forms.field_mapping import ShapedReader

    return ShapedReader(reader, spec, context)


def build_writer(spec: WriteSpec, context: CodecContext) -> PayloadWriter:
    """Return the writer that `spec` declares."""
    writer: PayloadWriter = WRITERS[spec.form].load()(spec, context)
    return writer


READERS = Table(
    "urc.readers",
    {
        "silence": "urc.protocol.forms.equals:SilenceReader",
        "regex": "urc.protocol.forms.regex:RegexReader",
        "pattern": "urc.protocol.forms.pattern:PatternReader",
        "split": "urc.protocol.forms.split:SplitReader",
        "keyvalue": "urc.protocol.forms.split:KeyvalueReader",
        "json": "urc.protocol.forms.json_paths:JsonReader",
        "xml": "urc.protocol.forms.xml:XmlReader",
        "equals": "urc.protocol.forms.equals:EqualsReader",
        "struct": "urc.protocol.struct.form:StructReader",
        "any": "urc.protocol.forms.equals:AnyReader",
        "raw": "urc.protocol.forms.equals:RawReader",
    },
)
WRITERS = Table(
    "urc.writers",
    {
        "text": "urc.protocol.forms.text:TextWriter",
        "hex": "urc.protocol.forms.hex:BytesWriter",
        "bytes": "urc.protocol.forms.hex:BytesWriter",
        "json": "urc.protocol.forms.json_text:JsonWriter",
        "struct": "urc.protocol.struct.form:StructWriter",
        "envelope": "urc.protocol.forms.envelope:EnvelopeWriter",
    },
)
