"""Filters that parse the content of one field, such as tables, digits and packed numbers.

Private to `urc.filters.table`. Each filter accepts any value from a document, runs in linear time,
and returns at most `MAX_PARTS` values. If a filter cannot handle a value, it raises TypeError or
ValueError with a message for users.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final

from urc._number_codec import reader_of
from urc._number_types import number_of

__all__ = ["CUT_FILTERS"]

MAX_PARTS: Final = 65536
_MOST_BITS: Final = 64


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _list(value: object) -> Sequence[Any]:
    if isinstance(value, (list, tuple)):
        return value
    raise TypeError(f"expected a list, found {_short(value)}")


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    raise TypeError(f"expected text, found {_short(value)}")


def _whole(value: object, what: str, least: int, most: int) -> int:
    if isinstance(value, int) and not isinstance(value, bool) and least <= value <= most:
        return value
    raise ValueError(f"{what} must be a whole number from {least} to {most}, found {_short(value)}")


def _check_count(count: int, what: str) -> None:
    if count > MAX_PARTS:
        raise ValueError(f"there are more than {MAX_PARTS} {what}")


def _column(value: Any, key: Any, between: Any = None) -> list[Any]:
    """Return one column of all rows; `key` is a name, or an index into a list or split text."""
    rows = _list(value)
    if between is not None:
        if not _text(between):
            raise ValueError("'column' needs a separator for rows of text")
        # Count before splitting: the same text may be in the list many times.
        rows = [_text(row) for row in rows if row]
        _check_count(sum(row.count(between) + 1 for row in rows), "parts")
    found = []
    for row in rows:
        if between is not None:
            row = row.split(between)
        if (isinstance(row, Mapping) and key in row) or _is_place(row, key):
            found.append(row[key])
        else:
            raise ValueError(f"the row {_short(row)} has no column {_short(key)}")
    return found


def _is_place(row: Any, key: Any) -> bool:
    is_row = isinstance(row, (list, tuple)) and isinstance(key, int) and not isinstance(key, bool)
    return is_row and -len(row) <= key < len(row)


def _cut(value: Any, start: Any, stop: Any = None) -> list[Any]:
    """Return the slice from `start` up to `stop` of each text or list in a list."""
    begin = _whole(start, "the start", -MAX_PARTS, MAX_PARTS)
    end = None if stop is None else _whole(stop, "the end", -MAX_PARTS, MAX_PARTS)
    for row in _list(value):
        if not isinstance(row, (str, list, tuple)):
            raise TypeError(f"expected text or a list, found {_short(row)}")
    _check_count(sum(len(range(len(row))[begin:end]) for row in value), "parts")
    return [row[begin:end] for row in value]


def _digits(value: Any, width: Any, base: Any, zero: Any = 48) -> list[int]:
    """Split text into groups of `width` digits, and convert each group to a number."""
    text, size = _text(value), _whole(width, "the width", 1, 16)
    radix = _whole(base, "the base", 2, 256)
    first = ord(zero) if isinstance(zero, str) and len(zero) == 1 else zero
    least = _whole(first, "the code of the digit zero", 0, 0x10FFFF)
    if len(text) % size:
        raise ValueError(f"{len(text)} characters cannot be split into groups of {size}")
    numbers, number = [], 0
    for place, char in enumerate(text, 1):
        digit = ord(char) - least
        if not 0 <= digit < radix:
            raise ValueError(f"{char!r} is not a digit of base {radix}")
        number = number * radix + digit
        if place % size == 0:
            numbers.append(number)
            number = 0
    return numbers


def _signed(value: Any, bits: Any) -> int:
    """Return the signed value of a `bits`-bit two's complement number."""
    size = _whole(bits, "the number of bits", 1, _MOST_BITS)
    number = _whole(value, "the number", 0, (1 << size) - 1)
    return number - (1 << size) if number >> size - 1 else number


class _Short(ValueError):
    """The data ends before the end of the number."""


@cache  # there are few type names
def _reader(name: str) -> Callable[[bytes, int, int], tuple[Any, int]]:
    number = number_of(name)
    if number is None:
        raise ValueError(f"expected a type such as 'u16le', found {_short(name)}")
    return reader_of(number, _Short)


def _bytes(value: Any) -> bytes:
    if isinstance(value, bytes):
        return value
    raise TypeError(f"expected bytes, such as from 'hexbytes', found {_short(value)}")


def _unpack(value: Any, name: Any, at: Any = 0) -> int | float:
    """Decode the number at a byte offset as the given type."""
    read = _reader(_text(name))
    data, place = _bytes(value), _whole(at, "the offset", 0, MAX_PARTS)
    try:
        number: int | float = read(data, place, len(data))[0]
    except _Short:
        raise ValueError(f"{len(data)} bytes contain no {name!r} at offset {place}") from None
    return number


def _numbers(value: Any, name: Any) -> list[int | float]:
    """Decode the bytes as consecutive numbers of one type."""
    read, data = _reader(_text(name)), _bytes(value)
    _check_count(len(data), "bytes")
    found, place = [], 0
    while place < len(data):
        try:
            number, place = read(data, place, len(data))
        except _Short:
            raise ValueError(f"{len(data)} bytes contain no {name!r} at offset {place}") from None
        found.append(number)
    return found


def _hexdigits(value: Any) -> str:
    return _bytes(value).hex().upper()


def _ramp(value: Any, step: Any, count: Any) -> list[float]:
    """Return `count` numbers that begin with the filtered value and increase by `step`."""
    for one in (value, step):
        if not isinstance(one, (int, float)):
            raise TypeError(f"expected a number, found {_short(one)}")
    return [value + place * step for place in range(_whole(count, "the count", 0, 8192))]


CUT_FILTERS: Final[dict[str, tuple[Callable[..., Any], tuple[int, int]]]] = {
    "column": (_column, (1, 2)),
    "cut": (_cut, (1, 2)),
    "digits": (_digits, (2, 3)),
    "hexdigits": (_hexdigits, (0, 0)),
    "numbers": (_numbers, (1, 1)),
    "ramp": (_ramp, (2, 2)),
    "signed": (_signed, (1, 1)),
    "unpack": (_unpack, (1, 2)),
}
"""Filters for the content of one field, by name: function, and minimum and maximum number of
arguments."""
