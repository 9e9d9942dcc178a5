"""The form ``pattern``: literal text with typed fields.

A pattern becomes a regular expression that runs in linear time. Every quantifier is possessive and
repeats only characters that cannot begin the next part.
"""

import re
from collections.abc import Callable, Mapping
from typing import Final, cast

from urc.expressions import quoted
from urc.model.payload import Payload, ReadSpec
from urc.model.text import FieldKind, PatternField
from urc.protocol.values.convert import spelt
from urc.protocol.values.payload import CodecContext, Frame, NotWritable
from urc.protocol.values.text_values import encoded, field_text

__all__ = ["CASTS", "PatternReader", "pattern_source"]

_BLANK: Final = r"\s\x1c-\x1f"
"""The ASCII characters that Python's `split` and `float` treat as whitespace."""
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
_WHOLE: Final[Mapping[FieldKind, Callable[[str], object]]] = {
    kind: re.compile(source).fullmatch
    for kind, source in _SOURCES.items()
    if kind in ("integer", "number", "hex")
}
_FILLERS: Final[Mapping[FieldKind, object]] = {"integer": 0, "number": 0, "hex": 0, "word": "x"}


class PatternReader:
    """A reader for typed fields in text; it also writes text with field values."""

    def __init__(self, spec: ReadSpec, context: CodecContext) -> None:
        self._holes = cast("tuple[PatternField, ...]", spec.options["holes"])
        self._tail = cast("str", spec.options["tail"])
        self._start = _start(self._holes, self._tail)
        """First literal word of the pattern; "" means that the pattern begins with a field."""
        self._match: Callable[[str], re.Match[str] | None] | None = None
        """Regular expression of the pattern. Patterns are compiled on first use, because a document
        test uses only a few of a driver's patterns."""
        self._casts = [
            (place, hole.name, _cast_of(hole))
            for place, hole in enumerate(self._holes, 1)
            if hole.name
        ]
        self._words = _words(self._holes, self._tail)
        """Literal words and fields of the pattern; None if only a regular expression can read
        it."""
        self._has_widths = any(hole.width for hole in self._holes)
        self._encoding = context.encoding

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields with converted numbers; None if the text does not match."""
        return self._read(frame.text)

    def _read(self, text: str) -> dict[str, object] | None:
        if self._start and not text.lstrip().startswith(self._start):
            return None
        if self._words is not None:
            return _by_words(self._words, text.split())
        match = self._match
        if match is None:
            match = self._match = re.compile(pattern_source(self._holes, self._tail)).match
        found = match(text)
        if found is None:
            return None
        if not self._has_widths:
            return {name: cast_to(found[place]) for place, name, cast_to in self._casts}
        try:
            return {name: cast_to(found[place]) for place, name, cast_to in self._casts}
        except ValueError:  # another value in a fixed-width column
            return None

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return the pattern's text, filled with the values of `fields`."""
        pieces = []
        for hole in self._holes:
            value = fields.get(hole.name) if hole.name else None
            if value is None and not hole.width:
                value = _FILLERS.get(hole.kind, "")
            pieces += [hole.before, _written(value, hole)]
        text = "".join((*pieces, self._tail))
        found = self._read(text)
        for name, value in fields.items():
            if found is None or (name in found and not _is_same(found[name], value)):
                raise NotWritable(
                    f"{name}: {quoted(value)} differs when read back from {quoted(text)}"
                )
        return encoded(text, self._encoding)


def _words(holes: tuple[PatternField, ...], tail: str) -> list[str | PatternField] | None:
    """Return the pattern as literal words and fields; None if a field is only part of a word."""
    words: list[str | PatternField] = []
    for place, hole in enumerate(holes):
        before = hole.before.lstrip() if place == 0 else hole.before
        if hole.width or hole.kind in ("text", "rest") or (before and before[-1] != " "):
            return None
        if place and before[:1] != " ":
            return None
        words += [*before.split(), hole]
    if holes and tail and tail[0] != " ":
        return None
    if not holes:
        return None
    # Several blanks in a row, and blanks other than spaces, stay literal.
    literals = [holes[0].before.lstrip(), *(hole.before for hole in holes[1:]), tail]
    is_plain = all(" ".join(text.split()) == text.strip(" ") for text in literals)
    is_single = not any("  " in text for text in literals)
    return [*words, *tail.split()] if is_plain and is_single else None


def _by_words(words: list[str | PatternField], found: list[str]) -> dict[str, object] | None:
    """Return the fields of text that was split into words; None if the text does not match."""
    if len(found) != len(words):
        return None
    fields: dict[str, object] = {}
    for word, text in zip(words, found, strict=True):
        if isinstance(word, str):
            if word != text:
                return None
            continue
        if word.kind != "word" and _WHOLE[word.kind](text) is None:
            return None
        if word.name:
            fields[word.name] = CASTS[word.kind](text)
    return fields


def _start(holes: tuple[PatternField, ...], tail: str) -> str:
    """Return the first literal word of a pattern; "" for a pattern that begins with a field."""
    if holes and holes[0].width:
        return ""
    return (holes[0].before if holes else tail).lstrip().partition(" ")[0]


def pattern_source(holes: tuple[PatternField, ...], tail: str) -> str:
    """Return the regular expression of a pattern, with one group for each field."""
    befores = [hole.before for hole in holes]
    pieces = [] if holes and holes[0].width else [rf"[{_BLANK}]*+"]
    for place, hole in enumerate(holes):
        before = hole.before.lstrip() if place == 0 else hole.before
        after = (*befores[place + 1 :], tail)[0]
        if hole.width:
            pieces += [re.escape(hole.before), rf"([^\r\n]{{{hole.width}}})"]
        else:
            pieces += [_literal(before), f"({_field(hole.kind, after)})"]
    end = "" if holes and holes[-1].kind in ("text", "rest") and not tail else rf"[{_BLANK}]*+"
    return "".join(pieces) + _literal(tail if holes else tail.lstrip()) + end + r"\Z"


def _literal(text: str) -> str:
    return "".join(rf"[{_BLANK}]++" if piece == " " else re.escape(piece) for piece in text)


def _field(kind: FieldKind, after: str) -> str:
    if kind in _SOURCES:
        return _SOURCES[kind]
    # A word or text ends before the first character that can follow it.
    stop = _BLANK if after[:1] == " " else re.escape(after[:1])
    if kind == "word":
        return rf"[^{_BLANK}{'' if after[:1] == ' ' else stop}]++"
    return rf"[^{stop}]*+" if stop else r"(?s:.*+)"


def _cast_of(hole: PatternField) -> Callable[[str], object]:
    """Return a function that converts text to a value; an empty column becomes None."""
    cast_to = CASTS[hole.kind]
    if not hole.width:
        return cast_to

    def column(text: str) -> object:
        inner = text.strip()
        if hole.kind in ("word", "text"):
            return inner or None
        if not inner.isascii() or "_" in inner:
            raise ValueError(text)  # int() and float() accept more notations than robots use
        return cast_to(inner) if inner else None

    return column


def _written(value: object, hole: PatternField) -> str:
    if hole.width:
        text = _written(value, hole._replace(width=0))
        is_text = hole.kind in ("word", "text")
        return text.ljust(hole.width) if is_text else text.rjust(hole.width)
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
