"""Expression filters and operators for lists and text.

Private to `urc.filters.table`. Each function accepts any value from a document. If a function
cannot handle a value, it raises TypeError or ValueError with a message for users. The size of the
input limits the size of the result.
"""

import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

from urc._formatting import spelt

if TYPE_CHECKING:
    from urc._patterns import Pattern

__all__ = ["LIST_FILTERS", "compiled", "is_match", "is_search", "sliced"]

MAX_TEXT: Final = 65536
MAX_PARTS: Final = 4096
_DDMM: Final = re.compile(r"([0-9]{0,3}?)([0-9]{1,2}(?:\.[0-9]{0,15})?)", re.ASCII)
_HEMISPHERES: Final = {"N": 1, "E": 1, "S": -1, "W": -1}


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _list(value: object) -> Sequence[Any]:
    if isinstance(value, (list, tuple)):
        return value
    raise TypeError(f"expected a list, found {_short(value)}")


def _numbers(value: object) -> Sequence[Any]:
    items = _list(value)
    if not items:
        raise ValueError("an empty list has no minimum or maximum")
    for item in items:
        if not isinstance(item, (int, float)):
            raise TypeError(f"expected a list of numbers, found the element {_short(item)}")
    return items


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    raise TypeError(f"expected text, found {_short(value)}")


def sliced(value: Any, start: Any, stop: Any) -> Any:
    """Return a slice of text, a list or bytes; None for `start` or `stop` sets no bound."""
    if not isinstance(value, (str, list, tuple, bytes)):
        raise TypeError(f"expected text, a list or bytes, found {_short(value)}")
    for place in (start, stop):
        if place is not None and (not isinstance(place, int) or isinstance(place, bool)):
            raise TypeError(f"expected a whole number as index, found {_short(place)}")
    return value[start:stop]


@lru_cache(maxsize=512)
def compiled(source: str, test: str) -> "Pattern":
    """Return the pattern, anchored at the start for ``match``, or raise `PatternError`."""
    from urc._patterns import compile_pattern  # takes 2 ms, and only these tests need it

    pattern = compile_pattern(source)  # done first, so that errors refer to the original text
    return compile_pattern(f"^(?:{source})") if test == "match" else pattern


def is_match(value: Any, source: str) -> bool:
    """Return whether the pattern matches at the beginning of the text."""
    return compiled(source, "match").search(_text(value)) is not None


def is_search(value: Any, source: str) -> bool:
    """Return whether the pattern matches anywhere in the text."""
    return compiled(source, "search").search(_text(value)) is not None


def _join(value: Any, between: Any = "") -> str:
    parts = [spelt(one) for one in _list(value)]
    if any(isinstance(one, bytes) for one in _list(value)):
        raise TypeError("bytes are not text; send bytes with 'hex:' or 'bytes:'")
    text = _text(between)
    if sum(map(len, parts)) + len(parts) * len(text) > MAX_TEXT:
        raise ValueError(f"the text has more than {MAX_TEXT} characters")
    return text.join(parts)


def _split(value: Any, between: Any = None) -> list[str]:
    if between is not None and not _text(between):
        raise ValueError("'split' needs a separator")
    parts = _text(value).split(between)
    if len(parts) > MAX_PARTS:
        raise ValueError(f"the text has more than {MAX_PARTS} parts")
    return parts


def _end(place: int) -> Callable[[Any], Any]:
    def end(value: Any) -> Any:
        items: Sequence[Any] = value if isinstance(value, (str, bytes)) else _list(value)
        if not items:
            raise ValueError("the list or text is empty")
        return items[place : place + 1 or None] if isinstance(items, str) else items[place]

    return end


def _sum(value: Any) -> Any:
    return sum(_numbers(value)) if _list(value) else 0


def _ddmm(value: Any, hemisphere: Any = "N") -> float | None:
    """Convert a number in the format DDMM.mmm to degrees; return None for an empty value."""
    if value is None or value == "":
        return None
    sign = _HEMISPHERES.get(hemisphere) if isinstance(hemisphere, str) else None
    if sign is None:
        raise ValueError(f"expected N, S, E or W, found {_short(hemisphere)}")
    text = value if isinstance(value, str) else repr(value)
    found = _DDMM.fullmatch(text)
    if found is None or float(found[2]) >= 60:
        raise ValueError(f"expected degrees and minutes, such as 4807.038, found {_short(value)}")
    return sign * (int(found[1] or 0) + float(found[2]) / 60)


def _pick(values: Any, names: Any, wanted: Any) -> Any:
    """Return the value of a name, or of each name in a list; None for a value that is missing.

    ROS messages such as JointState contain a list of names and lists of values in the same order.
    That order depends on the robot.
    """
    items, known = _list(values), _list(names)
    if max(len(items), len(known)) > MAX_PARTS:
        raise ValueError(f"'pick' takes at most {MAX_PARTS} names")
    if not all(isinstance(name, str) for name in known):
        raise TypeError("'pick' needs a list of names as text")
    found = dict(zip(known, items, strict=False))
    if isinstance(wanted, str):
        return found.get(wanted)
    return [found.get(_text(name)) for name in _list(wanted)]


LIST_FILTERS: Final[dict[str, tuple[Callable[..., Any], tuple[int, int]]]] = {
    "ddmm": (_ddmm, (0, 1)),
    "first": (_end(0), (0, 0)),
    "join": (_join, (0, 1)),
    "last": (_end(-1), (0, 0)),
    "max": (lambda value: max(_numbers(value)), (0, 0)),
    "min": (lambda value: min(_numbers(value)), (0, 0)),
    "pick": (_pick, (2, 2)),
    "split": (_split, (0, 1)),
    "sum": (_sum, (0, 0)),
}
"""Filters for lists and text, by name: function, and minimum and maximum number of arguments."""
