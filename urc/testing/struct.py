"""Helpers that build the form of a binary frame from YAML text, without a whole document."""

from collections.abc import Mapping

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.config.parse.forms.struct import parse_read, parse_write
from urc.config.parse.struct.numbers import parse_enums
from urc.config.parse.types import parse_types
from urc.model.payload import ReadSpec, WriteSpec
from urc.problems import to_text
from urc.protocol.forms.table import build_reader, build_writer
from urc.protocol.values.payload import CodecContext, Frame, PayloadReader, PayloadWriter
from urc.source import parse_document

__all__ = ["frame", "reader", "struct_read", "struct_write", "writer"]


def struct_read(source: str) -> ReadSpec:
    """Return the form under ``struct:`` in the YAML `source`.

    Besides ``struct:``, the source may contain ``types:`` and ``enums:``.

    Raises:
        AssertionError: the form in `source` has problems.
    """
    part, context, problems = _context(source)
    spec = parse_read(part.must("struct"), problems, context)
    _assert_none(problems)
    assert spec is not None  # noqa: S101  # the purpose of this function
    return spec


def struct_write(source: str) -> WriteSpec:
    """Return the form under ``struct:`` in the YAML `source`, for sending."""
    part, context, problems = _context(source)
    spec = parse_write(part.must("struct"), problems, context)
    _assert_none(problems)
    assert spec is not None  # noqa: S101  # the purpose of this function
    return spec


def reader(source: str, encoding: str = "utf-8") -> PayloadReader:
    """Return a reader for frames of the form in `source`."""
    return build_reader(struct_read(source), CodecContext(encoding))


def writer(source: str, encoding: str = "utf-8") -> PayloadWriter:
    """Return a writer for frames of the form in `source`."""
    return build_writer(struct_write(source), CodecContext(encoding))


def frame(data: bytes | str) -> Frame:
    """Return a frame that contains `data`, given as bytes or hex digits."""
    return Frame(bytes.fromhex(data) if isinstance(data, str) else data, "utf-8")


def _context(source: str) -> tuple[Node, FormContext, Problems]:
    document = parse_document(source, "test.yaml")
    problems = Problems()
    assert isinstance(document.data, Mapping)  # noqa: S101  # a mistake in the test
    part = Node(document, (), document.data)
    enums = parse_enums(part, problems)
    types = parse_types(part, enums, problems)
    return part, FormContext(types=types, enums=enums), problems


def _assert_none(problems: Problems) -> None:
    told = "".join(map(to_text, problems))
    assert not told, told  # noqa: S101  # the purpose of this module
