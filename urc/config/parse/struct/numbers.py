"""Parsers for a struct's numbers: widths, constants, enums and ranges."""

import re
from collections.abc import Iterable, Mapping
from typing import Final

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import fraction_of
from urc.model.binary import WORDS_OF_TYPES, Number, number_of, width_of

__all__ = [
    "NumberParser",
    "check_fits",
    "parse_enum",
    "parse_enums",
    "parse_valid",
    "unknown_type",
    "written_constant",
]

Enum = tuple[tuple[int, str], ...]
_COMMON_TYPES: Final = ("u8", "i8", "u16be", "u16le", "u32be", "u32le", "f32be", "f32le", "bool")
_LARGEST: Final = {16: 65504.0, 32: 3.4028234663852886e38, 64: 1.7976931348623157e308}
_WORDS: Final[Mapping[str, int | float | bool]] = {"true": True, "false": False}


def written_constant(text: str) -> int | float | bool | None:
    """Return the constant in a short item; None if the text is a name."""
    if text in _WORDS:
        return _WORDS[text]
    try:
        return int(text, 0)
    except ValueError:
        pass
    if not text[:1].isdigit() and text[:1] not in ("-", "+", "."):
        return None
    try:
        return float(text)
    except ValueError:
        return None


_NUMBER_WORD: Final = re.compile(
    r"(?P<sign>u?)int(?P<bits>8|16|32|64)(?:_t)?_?(?P<order>be|le)?|(?P<word>byte|char|float|double)"
)
"""Pattern for the names of number types in C, Python and ROS."""


def _our_type(found: re.Match[str]) -> str:
    """Return URC's type for a type name of another language, by default little-endian."""
    if found["word"]:
        return {"byte": "u8", "char": "i8", "float": "f32le", "double": "f64le"}[found["word"]]
    name = ("u" if found["sign"] else "i") + found["bits"]
    return name if found["bits"] == "8" else name + (found["order"] or "le")


def unknown_type(
    part: Node, word: str, types: Iterable[str], problems: Problems, *, only_types: bool = False
) -> None:
    """Report an unknown type and suggest a known type."""
    plain = _NUMBER_WORD.fullmatch(word.lower())
    if plain and number_of(other := _our_type(plain)) is not None:
        hint = f"use the type '{other}'"
    elif width_of(word) is not None and number_of(f"{word}be") is None:
        hint = f"only arrays may have numbers of {word[1:]} bits: {{ type: {word}, count: 16 }}"
    elif number_of(f"{word}be") is not None:
        hint = f"add the byte order: {word}be or {word}le"
    elif word[:-2] in ("u8", "i8"):
        hint = f"write {word[:-2]}; one byte has no byte order"
    else:
        known = [*types, *(() if only_types else (*_COMMON_TYPES, *WORDS_OF_TYPES))]
        hint = did_you_mean(word, known, "types")
    problems.error(part, "unknown-type", f"there is no type {word!r}", length=len(word), offset=0,
                   hint=hint)  # fmt: skip


def check_fits(
    part: Node, number: Number, value: object, problems: Problems, *, key: bool = False
) -> None:
    """Report a constant outside the range of its type."""
    if number.kind == "float":
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        is_fine = is_number and abs(value) <= _LARGEST[number.bits]  # type: ignore[arg-type]
        text = f"a number, {_LARGEST[number.bits]:.4g} at most"
    elif number.kind == "boolean":
        is_fine, text = value in (0, 1), "true or false"
    else:
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        is_fine = is_whole and number.least <= value <= number.most  # type: ignore[operator]
        sign = "signed " if number.is_signed else ""
        text = f"a whole number of {number.bits} {sign}bits, {number.least} to {number.most}"
    if not is_fine:
        problems.error(part, "does-not-fit", f"expected {text}, found {value!r}", key=key)


class NumberParser:
    """Parses the keys of one number."""

    def __init__(self, part: Node, problems: Problems) -> None:
        self._part = part
        self._problems = problems

    def width(self) -> Number:
        """Return the number type of one bit field."""
        return Number(
            "integer",
            self._part.integer("width") or 1,
            self._part.flag("signed", default=False),
        )

    def constant(self, number: Number) -> int | float | bool | None:
        """Return the value under ``const``; None if the key is missing."""
        inner = self._part.get("const")
        if inner is None:
            return None
        for key in ("value", "enum", "scale", "offset", "valid"):
            if key in self._part.data:
                text = f"'{key}' has no effect for a constant"
                self._problems.error(self._part, "misplaced-key", text, at=key, key=True)
        check_fits(inner, number, inner.data, self._problems)
        is_number = isinstance(inner.data, (bool, int, float))
        return inner.data if is_number else 0

    def scale(self) -> float:
        """Return the value under ``scale``; report a scale of 0 and return 1."""
        inner = self._part.get("scale")
        if inner is not None and isinstance(inner.data, str):
            return fraction_of(inner.data)
        if inner is not None and inner.data == 0:
            self._problems.error(inner, "zero-scale", "expected a scale other than 0")
            return 1
        return 1 if inner is None else inner.data


def parse_valid(part: Node, problems: Problems) -> tuple[float, float] | None:
    """Return the range under ``valid``; None if the key is missing."""
    inner = part.get("valid")
    if inner is None:
        return None
    low, high = inner.number("min"), inner.number("max")
    low, high = -1e308 if low is None else low, 1e308 if high is None else high
    if low > high:
        problems.error(inner, "wrong-order", f"min {low:g} is above max {high:g}", at="min")
        return None
    return low, high


def parse_enums(part: Node, problems: Problems) -> dict[str, Enum]:
    """Return the driver's enums by name."""
    return {name: _enum(inner, problems) for name, inner in part.named("enums").items()}


def parse_enum(part: Node, number: Number, enums: Mapping[str, Enum], problems: Problems) -> Enum:
    """Return the words under ``enum``: a table of words, or the name of an enum of the driver."""
    inner = part.get("enum")
    if inner is None:
        return ()
    if number.kind == "boolean":
        text = "'enum' has no effect for booleans"
        problems.error(part, "misplaced-key", text, at="enum", key=True)
        return ()
    for key in ("scale", "offset"):
        if key in part.data:
            text = f"'{key}' has no effect with 'enum'"
            problems.error(part, "misplaced-key", text, at=key, key=True)
    is_named = isinstance(inner.data, str)
    enum = enums.get(inner.data) if is_named else _enum(inner, problems)
    if enum is None:
        hint = did_you_mean(inner.data, enums, "enums")
        problems.error(inner, "unknown-enum", f"there is no enum {inner.data!r}", hint=hint)
        return ()
    places = {} if is_named else {int(key, 0): one for key, one in inner.entries().items()}
    for raw, word in enum:
        if number.kind != "float" and not number.least <= raw <= number.most:
            problems.error(
                places.get(raw, inner),
                "does-not-fit",
                f"{raw} ({word}) does not fit into {number.bits} bits with the range"
                f" {number.least} to {number.most}",
                key=not is_named,
            )
            break
    return enum


def _enum(part: Node, problems: Problems) -> Enum:
    found: dict[int, str] = {}
    words: set[str] = set()
    for key, inner in part.entries().items():
        raw, word = int(key, 0), str(inner.data)
        if raw in found:
            text = f"{key} is {raw}, which already has a word"
            problems.error(inner, "duplicate-name", text, key=True)
        elif word in words:
            text = f"another number has the word {word!r}"
            hint = "give each number its own word"
            problems.error(inner, "duplicate-name", text, hint=hint)
        found[raw] = word
        words.add(word)
    return tuple(found.items())
