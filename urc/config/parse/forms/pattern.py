"""The ``pattern`` form: a frame's text with {name:kind} in place of each field."""

import re
from typing import Any, Final, cast, get_args

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.config.spelling_suggestions import did_you_mean
from urc.model.payload import ReadSpec
from urc.model.text import FieldKind, PatternField

__all__ = ["parse_read", "place_of"]

_KINDS: Final = get_args(FieldKind)
_PIECE = re.compile(r"\{\{|\}\}|\{([^{}]*)\}|[{}]")
_FIELD = re.compile(r"(_?[A-Za-z][A-Za-z0-9_]*)?:([a-z]+)(?::([1-9][0-9]{0,3}))?")
_EATS: Final = {"integer": "0123456789", "number": "0123456789.eE", "hex": "0123456789abcdefABCDEF"}
"""Characters that would count as part of a field if they followed it directly, by field kind."""


class _PatternFault(Exception):
    """A mistake in a pattern, with the mistake's position and a hint."""

    def __init__(self, message: str, offset: int, length: int = 1, hint: str = "") -> None:
        super().__init__(message)
        self.place: dict[str, Any] = {"offset": offset, "length": length, "hint": hint}


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the pattern at `part` with its fields."""
    try:
        holes, tail = _parse(str(part.data))
    except _PatternFault as fault:
        problems.error(part, "bad-pattern", str(fault), **fault.place)
        return None
    names = tuple(hole.name for hole in holes if hole.name)
    return ReadSpec("pattern", {"holes": holes, "tail": tail}, names)


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the field in the pattern."""
    return part, {"offset": str(part.data).find("{" + field + ":") + 1, "length": len(field)}


def _parse(text: str) -> tuple[tuple[PatternField, ...], str]:
    """Return each field with the literal text before it, and the text after the last field."""
    holes: list[PatternField] = []
    literal, position = "", 0
    last = (0, 0)
    for piece in _PIECE.finditer(text):
        literal += text[position : piece.start()]
        position = piece.end()
        if piece[0] in ("{{", "}}"):
            literal += piece[0][0]
        elif piece[1] is None:
            hint = "write {{ or }} for a literal brace"
            raise _PatternFault(f"{piece[0]!r} has no matching brace", piece.start(), hint=hint)
        else:
            # Before a field of fixed width, the number of blanks is significant.
            is_fixed = piece[1].rpartition(":")[2].isdecimal()
            before = literal if is_fixed else _blanks(literal)
            _check_after(holes, before, last)
            holes.append(_hole(piece[1], before, piece.start() + 1, holes))
            literal, last = "", piece.span()
    tail = _blanks(literal + text[position:])
    if tail.strip():
        _check_after(holes, tail, last)
    return tuple(holes), tail.rstrip()


def _blanks(literal: str) -> str:
    return re.sub(r"\s+", " ", literal)


def _hole(inside: str, before: str, offset: int, holes: list[PatternField]) -> PatternField:
    found = _FIELD.fullmatch(inside)
    if found is None:
        text = f"'{{{inside}}}' is not a field"
        hint = f"write {{name:kind}}; kinds are {', '.join(_KINDS)}"
        raise _PatternFault(text, offset - 1, len(inside) + 2, hint)
    name, kind = found[1] or "", found[2]
    if kind not in _KINDS:
        hint = did_you_mean(kind, _KINDS, "kinds")
        text = f"there is no field kind {kind!r}"
        raise _PatternFault(text, offset + found.start(2), len(kind), hint)
    if name and any(hole.name == name for hole in holes):
        raise _PatternFault(f"the field {name!r} occurs twice", offset, len(name))
    if found[3] and kind == "rest":
        text = "a field of kind 'rest' has no width, because it extends to the end of the frame"
        raise _PatternFault(text, offset + found.start(3), len(found[3]))
    return PatternField(before, name, cast("FieldKind", kind), int(found[3] or 0))


def _check_after(holes: list[PatternField], literal: str, last: tuple[int, int]) -> None:
    """Raise `_PatternFault` if the end of the last field is ambiguous."""
    if not holes or holes[-1].width:
        return
    kind, (start, end) = holes[-1].kind, last
    if kind == "rest":
        raise _PatternFault("nothing can follow a field of kind 'rest'", start, end - start)
    if not literal:
        hint = "write the text between the two fields, or give a width: {name:number:6}"
        text = "there is no text between this field and the next"
        raise _PatternFault(text, start, end - start, hint)
    if literal[0] in _EATS.get(kind, ""):
        text = f"{literal[0]!r} after the field could be part of the {kind}"
        raise _PatternFault(text, start, end - start, "use a regex")
