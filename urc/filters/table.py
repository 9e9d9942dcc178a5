"""Expression operators and filters: every function that compiled templates call.

Private to `urc.expressions`. Every function accepts any value from a document. A function that
cannot handle a value raises TypeError, ValueError or ArithmeticError with a message for users. No
function produces a large result from small operands.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from urc import _checksum_math, _rotation
from urc._formatting import spelt
from urc._number_types import NUMBER_NAMES
from urc.filters import binary, lists, math, parse, poses

__all__ = ["FILTERS", "SCOPE", "filter_names"]

MAX_TEXT = 65536
MAX_BITS = 4096
"""Maximum size of integers, in bits."""
MAX_DIGITS = 15
"""Maximum number of digits on either side of the decimal point that `round` accepts."""


def _number(value: object) -> Any:
    if isinstance(value, (int, float)):
        return value
    raise TypeError(f"expected a number, found {_short(value)}")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _bounded(value: Any) -> Any:
    if isinstance(value, int) and value.bit_length() > MAX_BITS:
        raise ValueError("the number is too large")
    return value


def _add(left: Any, right: Any) -> Any:
    if isinstance(left, str) and isinstance(right, str):
        return _joined([left, right])
    if isinstance(left, bytes) or isinstance(right, bytes):
        return binary.together(left, right)
    return _bounded(_number(left) + _number(right))


def _sub(left: Any, right: Any) -> Any:
    return _bounded(_number(left) - _number(right))


def _mul(left: Any, right: Any) -> Any:
    return _bounded(_number(left) * _number(right))


def _div(left: Any, right: Any) -> Any:
    return _number(left) / _number(right)


def _floordiv(left: Any, right: Any) -> Any:
    return _number(left) // _number(right)


def _mod(left: Any, right: Any) -> Any:
    return _number(left) % _number(right)


def _pow(left: Any, right: Any) -> Any:
    base, exponent = _number(left), _number(right)
    if isinstance(base, int) and isinstance(exponent, int):
        if base.bit_length() * abs(exponent) > MAX_BITS:
            raise ValueError("the number is too large")
    elif base < 0:
        raise ValueError("a negative number cannot be raised to a fractional power")
    return base**exponent


def _item(value: Any, key: Any) -> Any:
    if isinstance(value, Mapping):
        if key in value:
            return value[key]
        raise ValueError(f"{key!r} has no value here")
    if isinstance(value, (list, tuple)) and isinstance(key, int):
        if -len(value) <= key < len(value):
            return value[key]
        raise ValueError(f"there is no item {key} in a list of {len(value)}")
    raise TypeError(f"{_short(value)} has no key {key!r}")


def _joined(parts: list[str]) -> str:
    if sum(map(len, parts)) > MAX_TEXT:
        raise ValueError(f"the text has more than {MAX_TEXT} characters")
    return "".join(parts)


def _join(*parts: Any) -> str:
    return _joined([part if isinstance(part, str) else _text(part) for part in parts])


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        raise TypeError("bytes are not text; send bytes with 'hex:' or 'bytes:'")
    return spelt(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _is_string(value: Any) -> bool:
    return isinstance(value, str)


def _is_none(value: Any) -> bool:
    return value is None


def _is_defined(look: Callable[[], Any]) -> bool:
    try:
        look()
    except (KeyError, ValueError, TypeError):
        return False
    return True


def _default(look: Callable[[], Any], fallback: Any = "") -> Any:
    try:
        value = look()
    except KeyError:
        return fallback
    return fallback if value is None else value


def _int(value: Any, fallback: Any = None, base: Any = 10) -> Any:
    try:
        return int(value, base) if isinstance(value, str) else int(_number(value))
    except (ValueError, OverflowError):
        if fallback is None:
            raise ValueError(f"expected a whole number, found {_short(value)}") from None
        return fallback


def _float(value: Any, fallback: Any = None) -> Any:
    try:
        return float(value) if isinstance(value, str) else float(_number(value))
    except ValueError:
        if fallback is None:
            raise ValueError(f"expected a number, found {_short(value)}") from None
        return fallback


def _round(value: Any, digits: Any = 0) -> Any:
    places = _number(digits)
    if not -MAX_DIGITS <= places <= MAX_DIGITS:  # Python would accept any number of digits
        raise ValueError(f"'round' takes -{MAX_DIGITS} to {MAX_DIGITS} digits, found {places}")
    return round(_number(value), int(places))


def _require_text(value: Any) -> str:
    if isinstance(value, str):
        return value
    raise TypeError(f"expected text, found {_short(value)}")


def _length(value: Any) -> int:
    if isinstance(value, (str, bytes, list, tuple, Mapping)):
        return len(value)
    raise TypeError(f"{_short(value)} has no length")


def _replace(value: Any, old: Any, new: Any) -> str:
    text, found, put = _require_text(value), _require_text(old), _require_text(new)
    if found == "":
        raise ValueError("'replace' needs text to search for")
    if len(text) + text.count(found) * (len(put) - len(found)) > MAX_TEXT:
        raise ValueError(f"the text has more than {MAX_TEXT} characters")
    return text.replace(found, put)


def _fixed(value: Any, digits: Any) -> str:
    places = int(_number(digits))
    if not 0 <= places <= 20:
        raise ValueError(f"'fixed' takes 0 to 20 digits, found {places}")
    return f"{_number(value):.{places}f}"


def _hex(value: Any, width: Any = 0) -> str:
    number, places = _number(value), int(_number(width))
    if not isinstance(number, int) or number < 0:
        raise ValueError(f"'hex' takes a non-negative whole number, found {_short(value)}")
    if not 0 <= places <= 64:
        raise ValueError(f"'hex' takes a width from 0 to 64, found {places}")
    return f"{number:0{places}X}" if places else f"{number:X}"


def _pad(value: Any, width: Any, fill: Any = "0") -> str:
    places, filler = int(_number(width)), _require_text(fill)
    if not 0 <= places <= 256 or len(filler) != 1:
        raise ValueError("'pad' takes a width from 0 to 256 and one character")
    return _text(value).rjust(places, filler)


def _sign(value: Any) -> str:
    text = _text(value).strip()
    if not text.removeprefix("-").removeprefix("+")[:1].isdigit():
        raise ValueError(f"expected a number, found {_short(value)}")
    return text if text[0] in "+-" else f"+{text}"


class Filter(NamedTuple):
    """A filter: its function, and the minimum and maximum number of its arguments."""

    function: Callable[..., Any]
    arity: tuple[int, int]
    gives_bytes: bool = False
    """Whether the filter returns bytes, which only ``hex:`` and ``bytes:`` can send."""
    refuses: Callable[[str], str] | None = None
    """Function that checks a constant first argument and returns an error message or ""."""


FILTERS: dict[str, Filter] = {
    "abs": Filter(lambda value: abs(_number(value)), (0, 0)),
    "default": Filter(_default, (0, 1)),
    "fixed": Filter(_fixed, (1, 1)),
    "float": Filter(_float, (0, 1)),
    "hex": Filter(_hex, (0, 1)),
    "int": Filter(_int, (0, 2)),
    "length": Filter(_length, (0, 0)),
    "lower": Filter(lambda value: _require_text(value).lower(), (0, 0)),
    "pad": Filter(_pad, (1, 2)),
    "pitch": Filter(_rotation.pitch, (0, 0)),
    "poses": Filter(poses.poses, (1, 3)),
    "replace": Filter(_replace, (2, 2)),
    "roll": Filter(_rotation.roll, (0, 0)),
    "round": Filter(_round, (0, 1)),
    "sign": Filter(_sign, (0, 0)),
    "string": Filter(_text, (0, 0)),
    "trim": Filter(lambda value: _require_text(value).strip(), (0, 0)),
    "upper": Filter(lambda value: _require_text(value).upper(), (0, 0)),
    "yaw": Filter(_rotation.yaw, (0, 0)),
}

FILTERS |= {
    name: Filter(one, (0, 0), gives_bytes=True) for name, one in binary.BYTE_FILTERS.items()
}
FILTERS |= {name: Filter(one, (more, more)) for name, (one, more) in binary.TEXT_FILTERS.items()}

FILTERS |= {name: Filter(*one) for name, one in lists.LIST_FILTERS.items()}
FILTERS |= {name: Filter(*one) for name, one in math.GEOMETRY_FILTERS.items()}
FILTERS |= {name: Filter(*one) for name, one in parse.CUT_FILTERS.items()}


def _refused_type(word: str) -> str:
    if word in NUMBER_NAMES:
        return ""
    return f"there is no type {word[:40]!r}{_nearest(word, NUMBER_NAMES, 'u16le')}"


def _refused_checksum(word: str) -> str:
    if _checksum_math.algorithm_of(word) is not None:
        return ""
    known = _checksum_math.algorithm_names()
    return f"there is no checksum {word[:40]!r}{_nearest(word, known, 'crc16-modbus')}"


def _nearest(word: str, known: Iterable[str], otherwise: str) -> str:
    from difflib import get_close_matches  # takes 6 ms, and only broken documents need it

    near = get_close_matches(word[:80].lower(), sorted(known), 1, 0.5)
    return f"; did you mean {near[0]!r}?" if near else f", such as {otherwise!r}"


for _name in ("numbers", "unpack"):
    FILTERS[_name] = FILTERS[_name]._replace(refuses=_refused_type)
FILTERS["checksum"] = Filter(_checksum_math.sum_of, (1, 1), refuses=_refused_checksum)

_OPERATORS = (_add, _sub, _mul, _div, _floordiv, _mod, _pow, _item, _join)
_TESTS = (_is_defined, _is_none, _is_number, _is_string)

SCOPE: dict[str, Any] = {"__builtins__": {}}
"""Functions by name; compiled templates can access no other names."""
SCOPE |= {"_slice": lists.sliced, "_match": lists.is_match, "_search": lists.is_search}
SCOPE |= {function.__name__: function for function in (*_OPERATORS, *_TESTS)}
SCOPE |= {f"_filter_{name}": filter_.function for name, filter_ in FILTERS.items()}


def filter_names() -> str:
    """Return the names of all filters that do not return bytes, for error messages."""
    return ", ".join(sorted(name for name, one in FILTERS.items() if not one.gives_bytes))
