"""The form of a reply or message, built from its YAML."""

from collections.abc import Collection

from urc.config.parse.form import FormContext, parse_read
from urc.config.part import Findings, Part
from urc.model.codec import ReadSpec
from urc.problems import ProblemsError
from urc.protocol.codec import CodecContext, Reader
from urc.protocol.forms import build_reader
from urc.source import parse_document

__all__ = ["read_spec", "reader_of"]


def read_spec(text: str, signals: Collection[str] = (), encoding: str = "utf-8") -> ReadSpec:
    """Return the form in `text`, which fits the schema.

    Raises:
        ProblemsError: the form has errors.
    """
    document = parse_document(text, "reply.yaml")
    findings = Findings()
    context = FormContext(encoding, frozenset(signals))
    spec = parse_read(Part(document, (), document.data), findings, context)
    if findings.problems:
        raise ProblemsError(findings.problems)
    return spec


def reader_of(text: str, signals: Collection[str] = (), encoding: str = "utf-8") -> Reader:
    """Return the reader of the form in `text`."""
    return build_reader(read_spec(text, signals, encoding), CodecContext(encoding))
