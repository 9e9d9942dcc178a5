"""The form ``pattern``: the frame as it is written, with holes for its fields.

A pattern becomes a regular expression that runs in linear time by construction: every repeat is
possessive, and is over characters that cannot follow it.
"""

import re
from collections.abc import Callable, Mapping
from typing import Final, cast

from urc.model.codec import Payload, ReadSpec
from urc.model.text import FieldKind, Hole
from urc.protocol.convert import spelt
from urc.protocol.forms import CodecContext, Frame, NotWritable
from urc.protocol.texts import encoded, field_text

__all__ = ["CASTS", "PatternReader", "pattern_source"]

_BLANK: Final = r"\s\x1c-\x1f"
"""What Python's `split` and `float` take for blanks in ASCII text."""
_SOURCES: Final[Mapping[FieldKind, str]] = {
    "integer": r"[+-]?[0-9]{1,400}+",
    "number": r"[+-]?(?:(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
    r"|(?i:nan|inf(?:inity)?))",
    "hex": r"[0-9a-fA-F]{1,400}+",
    "rest": r"(?s:.*+)",
}
CASTS: Final[Mapping[FieldKind, Callable[[str], object]]] = {
    "integer": int,
    "number": float,
    "hex": lambda text: int(text, 16),
    "word": str,
    "text": str,
    "rest": str,
}
_FILLERS: Final[Mapping[FieldKind, object]] = {"integer": 0, "number": 0, "hex": 0, "word": "x"}


class PatternReader:
    """Reads typed fields out of text, and writes the text with fields put in."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._holes = cast("tuple[Hole, ...]", spec.options["holes"])
        self._tail = cast("str", spec.options["tail"])
        self._match = re.compile(pattern_source(self._holes, self._tail)).match
        self._casts = [
            (place, hole.name, CASTS[hole.kind])
            for place, hole in enumerate(self._holes, 1)
            if hole.name
        ]
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields, numbers as numbers."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        found = self._match(text)
        if found is None:
            return None
        return {name: cast_to(found[place]) for place, name, cast_to in self._casts}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the pattern with `fields` in its holes."""
        pieces = []
        for hole in self._holes:
            value = fields.get(hole.name) if hole.name else None
            if value is None:
                value = _FILLERS.get(hole.kind, "")
            pieces += [hole.before, _written(value, hole)]
        text = "".join((*pieces, self._tail))
        found = self._read(text)
        for name, value in fields.items():
            if found is None or (name in found and not _is_same(found[name], value)):
                raise NotWritable(f"{name}: {value!r} does not fit {text!r}")
        return encoded(text, self._encoding)


def pattern_source(holes: tuple[Hole, ...], tail: str) -> str:
    """Return the regular expression of a pattern, with a group for each hole."""
    befores = [hole.before for hole in holes]
    pieces = [rf"[{_BLANK}]*+"]
    for place, hole in enumerate(holes):
        before = hole.before.lstrip() if place == 0 else hole.before
        after = (*befores[place + 1 :], tail)[0]
        pieces += [_literal(before), f"({_field(hole.kind, after)})"]
    end = "" if holes and holes[-1].kind in ("text", "rest") and not tail else rf"[{_BLANK}]*+"
    return "".join(pieces) + _literal(tail if holes else tail.lstrip()) + end + r"\Z"


def _literal(text: str) -> str:
    return "".join(rf"[{_BLANK}]++" if piece == " " else re.escape(piece) for piece in text)


def _field(kind: FieldKind, after: str) -> str:
    if kind in _SOURCES:
        return _SOURCES[kind]
    # A word or text ends where what follows it can begin.
    stop = _BLANK if after[:1] == " " else re.escape(after[:1])
    if kind == "word":
        return rf"[^{_BLANK}{'' if after[:1] == ' ' else stop}]++"
    return rf"[^{stop}]*+" if stop else r"(?s:.*+)"


def _written(value: object, hole: Hole) -> str:
    if hole.kind == "hex" and isinstance(value, int) and not isinstance(value, bool):
        return f"{value:X}"
    return field_text(value)


def _is_same(found: object, wanted: object) -> bool:
    if isinstance(found, (int, float)) and isinstance(wanted, str):
        try:
            return float(wanted) == found
        except ValueError:
            return False
    both_nan = found != found and wanted != wanted
    return both_nan or found == wanted or field_text(found) == spelt(wanted)
