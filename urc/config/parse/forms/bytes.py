"""The ``bytes`` form: a list of numbers, names of control characters, strings and expressions."""

from collections.abc import Iterable

from urc.config.node import Node, Problems
from urc.config.parse.bytes import parse_bytes
from urc.config.parse.form import FormContext
from urc.config.parse.forms.byte_pieces import Piece, Placed, spec_of, templates_at
from urc.expressions import ExpressionError, Template, compile_expression, split_template
from urc.model.payload import WriteSpec

__all__ = ["parse_write", "templates"]


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the constant bytes and the expressions in the list at `part`."""
    pieces: list[Placed] = []
    for place, inner in enumerate(part.items()):
        if isinstance(inner.data, str) and "{{" in inner.data:
            piece: Piece | None = _expression(inner, problems)
        else:
            piece = parse_bytes(inner, context.encoding, problems)
        if piece is None:
            return None
        offset = inner.data.find("{{") + 2 if isinstance(piece, Template) else 0
        pieces.append(Placed(piece, (place,), offset))
    return spec_of("bytes", pieces)


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return every expression in the list, with its position."""
    return templates_at(part, spec)


def _expression(part: Node, problems: Problems) -> Template | None:
    try:
        split = list(split_template(part.data))
        if len(split) != 1 or split[0][2] is None:
            problems.error(
                part,
                "bad-template",
                "an expression must be alone in its list item",
                hint='write the text and the expression as two items: ["SET ", "{{ x }}"]',
            )
            return None
        offset, _, text = split[0]
        try:
            return compile_expression(text or "", allows_bytes=True)
        except ExpressionError as error:
            problems.error(part, "bad-template", str(error), offset=offset + error.offset)
    except ExpressionError as error:
        problems.error(part, "bad-template", str(error), offset=error.offset)
    return None
