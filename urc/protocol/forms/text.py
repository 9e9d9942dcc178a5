"""The form ``text``: text from a template, as in the key ``send``."""

import re
from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple, cast

from urc.expressions import Template, quoted, split_template, text_of
from urc.model.payload import Payload, WriteSpec
from urc.protocol.values.payload import BadText, CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import counter_in

__all__ = ["TextWriter"]

_NAME = re.compile(
    r"\s*([A-Za-z_][A-Za-z0-9_]*)\s*"
    r"(?:\|\s*(?:fixed|round|int|float|string|pad|trim|join)\s*(?:\([^()]*\))?\s*)*"
)
"""Pattern for an expression that has only a name and formatting filters, so its value can be read
back."""


class TextWriter:
    """A writer for text from a template; it also reads back expressions that are only a name."""

    def __init__(self, spec: WriteSpec, context: CodecContext) -> None:
        self._template = cast("Template", spec.options["template"])
        self._encoding = context.encoding

    def write(self, namespace: Mapping[str, object]) -> Payload:
        """Return the rendered text in the connection's encoding."""
        text = text_of(self._template.evaluate(namespace))
        try:
            return text.encode(self._encoding)
        except UnicodeEncodeError as error:
            wrong = error.object[error.start]
            raise NotWritable(f"{quoted(wrong)} cannot be encoded in {self._encoding}") from None

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the text for each plain name, keyed by name; None if the frame does not match.

        A counter's number has the key ``seq.NAME``. A field ends at the next occurrence of the
        literal text that follows it. The last field ends before the literal text at the end of the
        frame.
        """
        try:
            text = frame.text
        except BadText:
            return None
        first, *pieces = self._pieces
        if not text.startswith(first.literal) or (not pieces and text != first.literal):
            return None
        found: dict[str, object] = {}
        position = len(first.literal)
        for piece in pieces:
            if piece is pieces[-1]:
                end = len(text) - len(piece.literal)
                end = end if text.endswith(piece.literal) and end >= position else -1
            else:
                end = text.find(piece.literal, position)
            if end < 0:
                return None
            if piece.name:
                found.setdefault(piece.name, text[position:end])
            position = end + len(piece.literal)
        return found

    @cached_property
    def _pieces(self) -> tuple["_TextPiece", ...]:
        pieces = [_TextPiece("", "")]
        for _, literal, expression in split_template(self._template.source):
            if expression is None:
                last = pieces.pop()
                pieces.append(_TextPiece(last.name, last.literal + literal))
            else:
                pieces.append(_TextPiece(_name_in(expression), ""))
        return tuple(pieces)


class _TextPiece(NamedTuple):
    """A field and the literal text after it; the first piece has only literal text."""

    name: str
    """Name of the field; "" for an expression that cannot be read back."""
    literal: str


def _name_in(expression: str) -> str:
    name = _NAME.fullmatch(expression)
    if name is not None:
        return name[1]
    counter = counter_in(expression)
    return f"seq.{counter}" if counter else ""
