"""Helpers that build the form of a reply or message from YAML text."""

from collections.abc import Collection

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, parse_read
from urc.model.payload import ReadSpec
from urc.problems import ProblemsError
from urc.protocol.forms.table import build_reader
from urc.protocol.values.payload import CodecContext, PayloadReader
from urc.source import parse_document

__all__ = ["read_spec", "reader_of"]


def read_spec(text: str, signals: Collection[str] = (), encoding: str = "utf-8") -> ReadSpec:
    """Parse the YAML `text`, which must match the schema, and return the form.

    Raises:
        ProblemsError: the form has errors.
    """
    document = parse_document(text, "reply.yaml")
    problems = Problems()
    context = FormContext(encoding, frozenset(signals))
    spec = parse_read(Node(document, (), document.data), problems, context)
    if problems.problems:
        raise ProblemsError(problems.problems)
    return spec


def reader_of(text: str, signals: Collection[str] = (), encoding: str = "utf-8") -> PayloadReader:
    """Return the reader for the form in the YAML `text`."""
    return build_reader(read_spec(text, signals, encoding), CodecContext(encoding))
