"""Conversion of raw values to typed values, and the inverse conversion for emulated robots.

Pure. A conversion is a chain of small functions, built once for each engine. Each function converts
the result of the function before it. The result None means "not available" and ends the chain.
"""

import math
import sys
from bisect import bisect_right
from collections.abc import Callable
from itertools import pairwise
from typing import Final

from urc.expressions import quoted
from urc.model.values import Conversion, Value

__all__ = [
    "BadValue",
    "Unusable",
    "build_conversion",
    "build_inverse",
    "divisor_of",
    "number_of",
    "spelt",
    "whole_of",
]

Step = Callable[[object], object]

_LARGEST: Final = sys.float_info.max
"""Largest absolute value of a whole number that a conversion accepts."""
_DIGITS: Final = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_ALL_ONES: Final = frozenset((1 << 8 * size) - 1 for size in range(1, 9))


class BadValue(ValueError):
    """An invalid raw value; the message contains the actual and the expected value."""


class Unusable:
    """A marker in place of the value of a field that could not be converted, with the reason."""

    __slots__ = ("why",)

    def __init__(self, why: str) -> None:
        self.why = why

    def __repr__(self) -> str:
        return f"Unusable({self.why!r})"


def build_conversion(conversion: Conversion) -> Step | None:
    """Return a function that converts raw values; None if there is no conversion.

    The returned function raises `BadValue` for an invalid raw value.
    """
    steps: list[Step] = []
    if conversion.base:
        steps.append(_from_base(conversion.base))
    if conversion.not_available:
        steps.append(_absent(conversion.not_available))
    if conversion.polynomial:
        steps.append(_polynomial(conversion.polynomial))
    if conversion.points:
        steps.append(_on_points(conversion.points))
    if conversion.states:
        steps.append(_words(conversion.states))
    return _chain(steps)


def build_inverse(conversion: Conversion) -> Step | None:
    """Return a function that converts values to raw values; None if there is no conversion.

    The returned function raises `BadValue` if a value has no corresponding raw value.
    """
    steps: list[Step] = []
    if conversion.states:
        steps.append(_words_back(conversion.states))
    if conversion.points:
        steps.append(_on_points(_turned(conversion.points)))
    if conversion.polynomial:
        steps.append(_line_back(conversion.polynomial))
    if conversion.base:
        steps.append(_to_base(conversion.base))
    chain = _chain(steps)
    if not conversion.not_available:
        return chain
    absent = _first_absent(conversion)

    def back(value: object) -> object:
        if value is None:
            return absent
        return value if chain is None else chain(value)

    return back


def whole_of(raw: object) -> int:
    """Return a raw value as a whole number; raise `BadValue` if impossible."""
    if isinstance(raw, int) and not isinstance(raw, bool):
        return raw
    if isinstance(raw, float) and raw.is_integer():
        return int(raw)
    if isinstance(raw, str) and _is_plain(raw):
        try:
            return int(raw)
        except ValueError:
            pass
    raise BadValue(f"{quoted(raw)} is not a whole number")


def number_of(raw: object) -> float:
    """Return a raw value as a number; raise `BadValue` if impossible."""
    if isinstance(raw, float):
        return raw
    if isinstance(raw, int) and not isinstance(raw, bool) and -_LARGEST <= raw <= _LARGEST:
        return raw
    if isinstance(raw, str) and _is_plain(raw):
        try:
            return float(raw)
        except ValueError:
            pass
    raise BadValue(f"{quoted(raw)} is not a number")


def spelt(raw: object) -> str:
    """Return a raw value in the notation of documents: ``true``, ``3``, ``2.5``."""
    if isinstance(raw, bool):
        return "true" if raw else "false"
    if isinstance(raw, float) and raw.is_integer():
        return str(int(raw))
    return str(raw)


def _is_plain(text: str) -> bool:
    """Return whether a number is plain ASCII; Python also accepts '1_0' and non-ASCII digits."""
    return text.isascii() and "_" not in text


def _chain(steps: list[Step]) -> Step | None:
    if not steps:
        return None
    first, *others = steps
    if not others:
        return lambda raw: None if raw is None else first(raw)

    def convert(raw: object) -> object:
        for step in steps:
            if raw is None:
                return None
            raw = step(raw)
        return raw

    return convert


def _from_base(base: int) -> Step:
    def convert(raw: object) -> object:
        if not isinstance(raw, str):
            return raw
        if _is_plain(raw):
            try:
                return int(raw, base)
            except ValueError:
                pass
        raise BadValue(f"{quoted(raw)} is not a whole number in base {base}")

    return convert


def _to_base(base: int) -> Step:
    def convert(value: object) -> object:
        number = whole_of(value)
        if base == 10:
            return number
        digits, rest = "", abs(number)
        while rest:
            rest, digit = divmod(rest, base)
            digits = _DIGITS[digit] + digits
        return ("-" if number < 0 else "") + (digits or "0")

    return convert


def _absent(values: tuple[Value, ...]) -> Step:
    """Return the step that converts NaN and `values` (also ``inf``, ``all_ones``) to None."""
    texts = {value for value in values if isinstance(value, str)}
    booleans = {value for value in values if isinstance(value, bool)}
    numbers = {
        value for value in values if isinstance(value, (int, float)) and not isinstance(value, bool)
    }
    numbers |= {float(word) for word in ("inf", "-inf") if word in texts}
    if "all_ones" in texts:
        numbers |= _ALL_ONES

    def convert(raw: object) -> object:
        if isinstance(raw, str):
            return None if raw in texts or _number_in(raw) in numbers else raw
        if isinstance(raw, bool):
            return None if raw in booleans else raw
        if isinstance(raw, (int, float)):
            return None if raw in numbers or raw != raw else raw
        return raw

    return convert


def _number_in(text: str) -> float | None:
    try:
        return float(text) if _is_plain(text) else None
    except ValueError:
        return None


def _first_absent(conversion: Conversion) -> Value:
    first = conversion.not_available[0]
    if first == "all_ones":
        return "FF" if conversion.base == 16 else 255
    return float(first) if first in ("nan", "inf", "-inf") else first


def _polynomial(coefficients: tuple[float, ...]) -> Step:
    if len(coefficients) == 2:
        return _line(*coefficients)
    falling = coefficients[::-1]

    def convert(raw: object) -> object:
        number, value = number_of(raw), 0.0
        for coefficient in falling:
            value = value * number + coefficient
        return value

    return convert


def _line(offset: float, scale: float) -> Step:
    divisor = divisor_of(scale)
    if divisor:
        # Adding before dividing keeps decimals exact: (2512 - 4000) / 100 is -14.88.
        shift = _tidy(offset * divisor)
        if shift == 0:  # adding zero would lose the sign of -0.0
            return lambda raw: number_of(raw) / divisor
        if isinstance(shift, int):
            return lambda raw: (number_of(raw) + shift) / divisor
        return lambda raw: number_of(raw) / divisor + offset
    if offset:
        return lambda raw: number_of(raw) * scale + offset
    return lambda raw: number_of(raw) * scale


def divisor_of(scale: float) -> int:
    """Return n if `scale` is 1/n with a whole number n, else 0.

    Division is more accurate than multiplication: 3 / 10 is 0.3, but 3 * 0.1 is not.
    """
    if not 1e-15 < abs(scale) < 1:
        return 0
    divisor = round(1 / scale)
    return divisor if 1 / divisor == scale else 0


def _line_back(coefficients: tuple[float, ...]) -> Step:
    if len(coefficients) != 2 or not coefficients[1]:

        def refuse(value: object) -> object:
            raise BadValue("only a scale and an offset can be inverted")

        return refuse
    offset, scale = coefficients
    divisor = divisor_of(scale)

    def convert(value: object) -> object:
        number = number_of(value) - offset
        raw = number * divisor if divisor else number / scale
        if not math.isfinite(raw):
            raise BadValue(f"{quoted(value)} has no corresponding raw number")
        return _tidy(raw)

    return convert


def _tidy(number: float) -> float:
    """Return `number`, or the nearest whole number if the difference is only a rounding error."""
    if not math.isfinite(number):
        return number
    nearest = round(number)
    return nearest if abs(number - nearest) <= 1e-9 * max(1.0, abs(number)) else number


def _turned(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    turned = tuple((after, before) for before, after in points)
    return turned if turned[0][0] < turned[-1][0] else turned[::-1]


def _on_points(points: tuple[tuple[float, float], ...]) -> Step:
    places = [place for place, _ in points]
    rising = all(before < after for before, after in pairwise(places))

    def convert(raw: object) -> object:
        number = number_of(raw)
        if not rising:
            raise BadValue("non-monotonic points cannot be inverted")
        if number != number:
            return None
        if number <= places[0]:
            return points[0][1]
        if number >= places[-1]:
            return points[-1][1]
        after = bisect_right(places, number)
        (x0, y0), (x1, y1) = points[after - 1], points[after]
        return y0 + (number - x0) * (y1 - y0) / (x1 - x0)

    return convert


def _words(states: tuple[tuple[str, str], ...]) -> Step:
    words = dict(states)
    known = ", ".join(sorted(words))

    def convert(raw: object) -> object:
        word = words.get(spelt(raw))
        if word is None:
            raise BadValue(f"{quoted(raw)} is not one of the states {known}")
        return word

    return convert


def _words_back(states: tuple[tuple[str, str], ...]) -> Step:
    raws = {word: raw for raw, word in reversed(states)}

    def convert(value: object) -> object:
        raw = raws.get(value) if isinstance(value, str) else None
        if raw is None:
            raise BadValue(f"{quoted(value)} is not one of the states {', '.join(raws)}")
        # A binary frame needs the number; in text, both forms are the same.
        return int(raw) if raw.isdecimal() and str(int(raw)) == raw else raw

    return convert
