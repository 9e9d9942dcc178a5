"""Tables of the forms, in both directions, and the construction of readers and writers.

Pure. A row of `READERS` or `WRITERS` is a factory ``(spec, context) -> reader`` (or writer). Each
engine calls it once; `urc.protocol.codec` has the interfaces.
"""

from urc.model.codec import ReadSpec, WriteSpec
from urc.protocol.codec import CodecContext, Reader, Writer
from urc.registry import Table

__all__ = ["READERS", "WRITERS", "build_reader", "build_writer"]


def build_reader(spec: ReadSpec, context: CodecContext) -> Reader:
    """Return the reader that `spec` declares."""
    reader: Reader = READERS[spec.form].load()(spec, context)
    if spec.topic is not None:
        from urc.protocol.topics import TopicReader

        reader = TopicReader(reader, spec, context)
    if spec.head:
        from urc.protocol.head import HeadReader

        reader = HeadReader(reader, spec)
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
        "silence": "urc.protocol.equals_form:SilenceReader",
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
