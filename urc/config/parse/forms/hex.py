"""The ``hex`` form: pairs of hex digits and expressions with a given width."""

import re
from collections.abc import Iterable

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.config.parse.forms.byte_pieces import Piece, Placed, spec_of, templates_at
from urc.expressions import (
    ExpressionError,
    Template,
    compile_expression,
    is_byte_filter,
    is_nonce,
    last_filter,
    split_template,
)
from urc.model.payload import WriteSpec

__all__ = ["parse_write", "templates"]

_NOT_HEX = re.compile(r"[^0-9A-Fa-f\s]")
_ODD = re.compile(r"(?<![0-9A-Fa-f])(?:[0-9A-Fa-f]{2})*[0-9A-Fa-f](?![0-9A-Fa-f])")


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the constant bytes and the expressions in the text at `part`."""
    pieces: list[Placed] = []
    try:
        for offset, literal, expression in split_template(part.data):
            if expression is None:
                piece: Piece | None = _digits(part, literal, offset, problems)
            else:
                piece = _expression(part, expression, offset, problems)
            if piece is None:
                return None
            pieces.append(Placed(piece, offset=offset))
    except ExpressionError as error:
        problems.error(part, "bad-template", str(error), offset=error.offset)
        return None
    return spec_of("hex", pieces)


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return every expression in the text, with its position."""
    return templates_at(part, spec)


def _digits(part: Node, literal: str, offset: int, problems: Problems) -> bytes | None:
    wrong = _NOT_HEX.search(literal)
    if wrong is not None:
        text = f"{wrong[0]!r} is not a hex digit"
        hint = "write bytes as 02 FF 0D, and values as {{ x | u8 }}"
        problems.error(part, "not-hex", text, offset=offset + wrong.start(), hint=hint)
        return None
    odd = _ODD.search(literal)
    if odd is not None:
        text = f"{odd[0]!r} has an odd number of hex digits"
        at = offset + odd.start()
        hint = "each byte needs two digits"
        problems.error(part, "not-hex", text, offset=at, length=len(odd[0]), hint=hint)
        return None
    return bytes.fromhex(literal)


def _expression(part: Node, text: str, offset: int, problems: Problems) -> Template | None:
    try:
        template = compile_expression(text, allows_bytes=True)
    except ExpressionError as error:
        problems.error(part, "bad-template", str(error), offset=offset + error.offset)
        return None
    if not (is_byte_filter(last_filter(template)) or is_nonce(template)):
        shown = text.strip()
        value = shown.rpartition("|")[0].strip() or shown
        plain = f"({value})" if re.search(r"\W", value) else value
        problems.error(
            part,
            "no-width",
            f"{shown!r} does not define its size in bytes",
            offset=offset + len(text) - len(text.lstrip()),
            length=len(shown),
            hint=f"end it with a filter: {{{{ {plain} | u8 }}}}, u16be, f32le, hexbytes, utf8 …",
        )
        return None
    return template
